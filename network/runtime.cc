// SPDX-License-Identifier: BSD-3-Clause
#include "network/runtime.h"

#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <string_view>

#include <ATen/Context.h>
#include <ATen/Parallel.h>
#include <ATen/Version.h>
#include <ATen/core/Tensor.h>
#include <ATen/ops/mm.h>
#include <ATen/ops/ones.h>
#include <c10/core/InferenceMode.h>
#include <dlfcn.h>
#include <torch/version.h>

namespace vgtw {
namespace {

// at::show_config() has one line "  - CPU capability usage: AVX2".
std::string CpuCapability() {
  constexpr std::string_view kLabel = "CPU capability usage: ";
  const std::string config = at::show_config();
  const size_t label = config.find(kLabel);
  if (label == std::string::npos) return "";
  const size_t begin = label + kLabel.size();
  return config.substr(begin, config.find('\n', begin) - begin);
}

std::string BlasLibrary() {
  Dl_info info;
  void* product = ::dlsym(RTLD_DEFAULT, "sgemm_");
  if (product == nullptr || ::dladdr(product, &info) == 0) return "";
  std::error_code ignored;
  return std::filesystem::canonical(info.dli_fname, ignored).string();
}

std::string BlasCore() {
  const auto core_name =
      reinterpret_cast<char* (*)()>(::dlsym(RTLD_DEFAULT, "openblas_get_corename"));
  return core_name != nullptr ? core_name() : "";
}

bool CpuHasAvx512() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512vl") != 0;
#else
  return false;
#endif
}

// OpenBLAS' names of processors whose kernels it does use AVX512 on.
bool IsAvx512Core(std::string_view core) {
  return core == "SkylakeX" || core == "Cooperlake" || core == "Sapphirerapids" || core == "Zen4";
}

}  // namespace

NetworkRuntime DescribeNetworkRuntime() {
  NetworkRuntime runtime;
  runtime.libtorch_version = TORCH_VERSION;
  runtime.num_threads = at::get_num_threads();
  runtime.num_interop_threads = at::get_num_interop_threads();
  runtime.cpu_capability = CpuCapability();
  runtime.cpu_has_avx512 = CpuHasAvx512();
  runtime.blas_library = BlasLibrary();
  runtime.blas_core = BlasCore();
  runtime.cuda_available = at::getNumGPUs() > 0;
  runtime.gpus = ListGpus();
  return runtime;
}

void UseThreads(int num_threads) { at::set_num_threads(ResolveThreads(num_threads)); }

double MeasureMatrixProductGflops(int size) {
  VGTW_CHECK(size >= 1, "size = " + std::to_string(size));
  using Clock = std::chrono::steady_clock;
  const c10::InferenceMode inference;
  const at::Tensor a = at::ones({size, size});
  at::mm(a, a);
  double best_sec = std::numeric_limits<double>::infinity();
  for (int repeat = 0; repeat < 3; ++repeat) {
    const Clock::time_point start = Clock::now();
    at::mm(a, a);
    best_sec = std::min(best_sec, std::chrono::duration<double>(Clock::now() - start).count());
  }
  return 2e-9 * size * size * size / best_sec;
}

std::vector<std::string> AdviseOnRuntime(const NetworkRuntime& runtime) {
  std::vector<std::string> advice;
  const bool is_own_blas = runtime.blas_library.empty() ||
                           runtime.blas_library.find("torch") != std::string::npos ||
                           runtime.blas_library.find("mkl") != std::string::npos;
  if (runtime.blas_core.empty() && !is_own_blas) {
    advice.push_back("matrix products run on " + runtime.blas_library +
                     ": apt-get install libopenblas0-openmp makes them many times faster");
  } else if (!runtime.blas_core.empty() && runtime.cpu_has_avx512 &&
             !IsAvx512Core(runtime.blas_core)) {
    advice.push_back("OpenBLAS takes this processor for " + runtime.blas_core +
                     ": set OPENBLAS_CORETYPE=SkylakeX in the environment to use its AVX512");
  }
  if (!runtime.gpus.empty() && !runtime.cuda_available) {
    advice.push_back("this LibTorch cannot use " + runtime.gpus.front().name +
                     ": build with a CUDA LibTorch on CMAKE_PREFIX_PATH");
  }
  return advice;
}

}  // namespace vgtw
