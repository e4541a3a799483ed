// SPDX-License-Identifier: BSD-3-Clause
// The program `vgtw-network`: what needs LibTorch. `vgtw` executes it, because a program linked to
// LibTorch takes 0.65 s to start.
#include "network/runtime.h"
#include "plugin/flags.h"

#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

std::string Summarise(const NetworkRuntime& runtime, double gflops) {
  std::string summary = "LibTorch " + runtime.libtorch_version + ", " +
                        std::to_string(runtime.num_threads) + " threads, " +
                        std::to_string(std::lround(gflops)) + " GFLOP/s (float32 products)";
  if (!runtime.cuda_available) return summary + ", no CUDA";
  for (const Gpu& gpu : runtime.gpus) summary += ", " + gpu.name;
  return summary;
}

nlohmann::json ToJson(const NetworkRuntime& runtime, double gflops) {
  nlohmann::json gpus = nlohmann::json::array();
  for (const Gpu& gpu : runtime.gpus) {
    gpus.push_back({{"name", gpu.name}, {"memory_bytes", gpu.memory_bytes}});
  }
  return {{"summary", Summarise(runtime, gflops)},
          {"advice", AdviseOnRuntime(runtime)},
          {"libtorch_version", runtime.libtorch_version},
          {"num_threads", runtime.num_threads},
          {"num_interop_threads", runtime.num_interop_threads},
          {"cpu_capability", runtime.cpu_capability},
          {"cpu_has_avx512", runtime.cpu_has_avx512},
          {"blas_library", runtime.blas_library},
          {"blas_core", runtime.blas_core},
          {"matrix_product_gflops", gflops},
          {"cuda_available", runtime.cuda_available},
          {"gpus", gpus}};
}

std::function<void()> DeclareRuntime(Flags&) {
  return [] {
    const double gflops = MeasureMatrixProductGflops();
    std::puts(ToJson(DescribeNetworkRuntime(), gflops).dump(2).c_str());
  };
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  return vgtw::RunProgram(
      {{"runtime", "The LibTorch at hand and its speed, as JSON", vgtw::DeclareRuntime}},
      argc,
      argv);
}
