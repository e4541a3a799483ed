// SPDX-License-Identifier: BSD-3-Clause
#include "network/gpu.h"

#include <cstdlib>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(ListGpus, AsksTheDriverForNameAndMemory) {
  const std::vector<Gpu> gpus = ListGpus(VGTW_FAKE_CUDA_DRIVER);
  ASSERT_EQ(gpus.size(), 1u);  // the second device refuses to answer
  EXPECT_EQ(gpus[0].name, "Fake 9000");
  EXPECT_EQ(gpus[0].memory_bytes, uint64_t{6} << 30);
}

TEST(ListGpus, IsEmptyWhereTheDriverCannotStart) {
  ::setenv("VGTW_FAKE_CUDA_ERROR", "1", 1);
  EXPECT_TRUE(ListGpus(VGTW_FAKE_CUDA_DRIVER).empty());
  ::unsetenv("VGTW_FAKE_CUDA_ERROR");
}

TEST(ListGpus, IsEmptyWithoutDriver) { EXPECT_TRUE(ListGpus("libno-such-driver.so.1").empty()); }

TEST(ListGpus, IsEmptyWhereTheLibraryIsNoDriver) { EXPECT_TRUE(ListGpus("libm.so.6").empty()); }

}  // namespace
}  // namespace vgtw
