// SPDX-License-Identifier: BSD-3-Clause
// The program `vgtw-network`: what needs LibTorch. `vgtw` executes it, because a program linked to
// LibTorch takes 0.65 s to start.
#include "network/runtime.h"
#include "plugin/network_commands.h"
#include "plugin/network_program.h"

#include <cmath>
#include <csignal>
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
    UseThreads(0);  // as `predict` does
    const double gflops = MeasureMatrixProductGflops();
    std::puts(ToJson(DescribeNetworkRuntime(), gflops).dump(2).c_str());
  };
}

std::vector<Command> NetworkCommands() {
  return {
      {"runtime", "The LibTorch at hand and its speed, as JSON", DeclareRuntime},
      {"predict",
       kPredictSummary,
       DeclarePredict,
       "  vgtw predict --image_path photos/ --weights_path vgtw.safetensors --output_path "
       "predictions/\n"
       "  vgtw predict --image_path photos/ --weights_path vggt.safetensors --lora_path lora.pt "
       "--output_path predictions/"},
      {"probe",
       kProbeSummary,
       DeclareProbe,
       "  vgtw probe --image_path photos/ --weights_path vgtw.safetensors --mask_path masks/ "
       "--query_image a.jpg --query_x 640 --query_y 360 --output_path probe/"},
      {"train",
       kTrainSummary,
       DeclareTrain,
       "  vgtw train --weights_path vggt.safetensors --image_path scenes/ --mask_path masks/ "
       "--output_path run/\n"
       "  vgtw train --config examples/train_tiny.conf --output_path run/"},
      {"weights", kWeightsSummary},
      {"weights inspect",
       kWeightsInspectSummary,
       DeclareWeightsInspect,
       "  vgtw weights inspect --weights_path vgtw_lora_fp32.pt"},
      {"weights check",
       kWeightsCheckSummary,
       DeclareWeightsCheck,
       "  vgtw weights check --weights_path vggt.safetensors --lora_path lora.pt"},
      {"weights convert",
       kWeightsConvertSummary,
       DeclareWeightsConvert,
       "  vgtw weights convert --weights_path vgtw_lora_fp32.pt --output_path vgtw.safetensors"},
  };
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  // A file-size limit is then an ordinary write error, which is reported and cleaned up after.
  std::signal(SIGXFSZ, SIG_IGN);
  return vgtw::RunProgram(vgtw::NetworkCommands(), argc, argv);
}
