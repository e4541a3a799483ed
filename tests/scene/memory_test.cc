// SPDX-License-Identifier: BSD-3-Clause
#include "scene/memory.h"

#include <cstring>
#include <sys/mman.h>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Pages come straight from the kernel: allocators, above all those of sanitizers, keep what is
// freed.
TEST(Memory, CountsWhatIsTouched) {
  constexpr int64_t kBytes = int64_t{128} << 20;
  constexpr int64_t kSlack = int64_t{16} << 20;  // what else the process allocates or gives back
  const int64_t before = ResidentMemory();
  void* pages = ::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(pages, MAP_FAILED);
  std::memset(pages, 'x', kBytes);
  EXPECT_GE(ResidentMemory(), before + kBytes - kSlack);
  ::munmap(pages, kBytes);
  EXPECT_LE(ResidentMemory(), before + kSlack);
  EXPECT_GE(PeakMemory(), before + kBytes - kSlack);
}

TEST(Memory, NoMoreIsFreeThanThereIs) {
  EXPECT_GT(AvailableMemory(), 0);
  EXPECT_LE(AvailableMemory(), TotalMemory());
}

}  // namespace
}  // namespace vgtw
