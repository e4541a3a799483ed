// SPDX-License-Identifier: BSD-3-Clause
#include "network/runtime.h"

#include "tests/support/colmap.h"

#include <filesystem>
#include <stdexcept>

#include <ATen/Parallel.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/mm.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A wrong BLAS or a LibTorch of another ABI links and loads, and computes nonsense.
TEST(LibTorch, MultipliesMatrices) {
  const at::Tensor a = at::arange(6, at::kFloat).view({2, 3});  // 0 1 2 / 3 4 5
  const at::Tensor product = at::mm(a, a.t());
  EXPECT_EQ(product[0][0].item<float>(), 0 * 0 + 1 * 1 + 2 * 2);
  EXPECT_EQ(product[0][1].item<float>(), 0 * 3 + 1 * 4 + 2 * 5);
  EXPECT_EQ(product[1][1].item<float>(), 3 * 3 + 4 * 4 + 5 * 5);
}

// Sums of 300 products of small integers are exact in float32 in any order of summation, and 300 is
// larger than the blocks that a BLAS cuts its work into.
TEST(LibTorch, MultipliesMatricesLargerThanABlock) {
  const int size = 300;
  const at::Tensor a = at::arange(size, at::kFloat).remainder(7).expand({size, size});
  const at::Tensor product = at::mm(a, a.t());
  double expected = 0;
  for (int k = 0; k < size; ++k) expected += (k % 7) * (k % 7);
  EXPECT_EQ(product.min().item<float>(), expected);
  EXPECT_EQ(product.max().item<float>(), expected);
}

TEST(NetworkRuntime, ReportsTheThreadsInUse) {
  const int num_threads = at::get_num_threads();
  EXPECT_EQ(DescribeNetworkRuntime().num_threads, num_threads);
  at::set_num_threads(num_threads + 1);
  EXPECT_EQ(DescribeNetworkRuntime().num_threads, num_threads + 1);
  UseThreads(num_threads);
  EXPECT_EQ(at::get_num_threads(), num_threads);
  EXPECT_EQ(DescribeNetworkRuntime().num_interop_threads, at::get_num_interop_threads());
}

// Other libraries bring a BLAS of their own, Debian's Ceres ATLAS, whose products are several times
// slower: the program must be linked so that the one of LibTorch answers, as it does here.
TEST(NetworkRuntime, TheProgramHasTheSameBlas) {
  const ColmapRun run = RunColmap({"runtime"}, VGTW_NETWORK_PROGRAM);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const std::string expected = DescribeNetworkRuntime().blas_library;
  EXPECT_THAT(run.output, HasSubstr("\"blas_library\": \"" + expected + "\""));
  EXPECT_EQ(expected.find("f77blas"), std::string::npos);
}

TEST(NetworkRuntime, NamesTheLibrariesAtHand) {
  const NetworkRuntime runtime = DescribeNetworkRuntime();
  EXPECT_NE(runtime.libtorch_version.find('.'), std::string::npos);
  EXPECT_FALSE(runtime.cpu_capability.empty());
  EXPECT_EQ(runtime.cpu_capability.find_first_of(" \n:"), std::string::npos);
  EXPECT_TRUE(std::filesystem::is_regular_file(runtime.blas_library)) << runtime.blas_library;
  const bool is_openblas = runtime.blas_library.find("openblas") != std::string::npos;
  EXPECT_EQ(is_openblas, !runtime.blas_core.empty()) << runtime.blas_library;
}

TEST(AdviseOnRuntime, NamesTheSlowBlasTheMisjudgedProcessorAndTheIdleGpu) {
  NetworkRuntime runtime;
  runtime.cpu_has_avx512 = true;
  runtime.blas_library = "/usr/lib/openblas/libblas.so.3";
  runtime.blas_core = "SkylakeX";
  EXPECT_THAT(AdviseOnRuntime(runtime), IsEmpty());

  runtime.blas_core = "Prescott";
  EXPECT_THAT(AdviseOnRuntime(runtime), ElementsAre(HasSubstr("OPENBLAS_CORETYPE=SkylakeX")));
  runtime.cpu_has_avx512 = false;
  EXPECT_THAT(AdviseOnRuntime(runtime), IsEmpty());

  runtime.blas_library = "/usr/lib/atlas/libblas.so.3";
  runtime.blas_core = "";
  EXPECT_THAT(AdviseOnRuntime(runtime), ElementsAre(HasSubstr("install libopenblas0-openmp")));
  runtime.blas_library = "/opt/libtorch/lib/libtorch_cpu.so";
  EXPECT_THAT(AdviseOnRuntime(runtime), IsEmpty());

  runtime.gpus = {{"Fake 9000", 1}};
  EXPECT_THAT(AdviseOnRuntime(runtime), ElementsAre(HasSubstr("Fake 9000")));
  runtime.cuda_available = true;
  EXPECT_THAT(AdviseOnRuntime(runtime), IsEmpty());
}

TEST(MeasureMatrixProductGflops, IsPositiveAndRefusesNothing) {
  EXPECT_GT(MeasureMatrixProductGflops(64), 0.0);
  EXPECT_THROW(MeasureMatrixProductGflops(0), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
