// SPDX-License-Identifier: BSD-3-Clause
#include "scene/memory.h"

#include <memory>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(Memory, CountsWhatIsTouched) {
  constexpr int64_t kBytes = int64_t{128} << 20;
  constexpr int64_t kSlack = int64_t{16} << 20;  // what else the process allocates or gives back
  const int64_t before = ResidentMemory();
  auto bytes = std::make_unique<std::vector<char>>(kBytes, 'x');
  EXPECT_GE(ResidentMemory(), before + kBytes - kSlack);
  bytes.reset();
  EXPECT_LE(ResidentMemory(), before + kSlack);
  EXPECT_GE(PeakMemory(), before + kBytes - kSlack);
}

TEST(Memory, NoMoreIsFreeThanThereIs) {
  EXPECT_GT(AvailableMemory(), 0);
  EXPECT_LE(AvailableMemory(), TotalMemory());
}

}  // namespace
}  // namespace vgtw
