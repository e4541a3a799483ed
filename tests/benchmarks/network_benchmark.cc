// SPDX-License-Identifier: BSD-3-Clause
// network_benchmark WEIGHTS NUM_VIEWS [HEIGHT WIDTH [cpu|cuda [fp32|bf16]]]
// One pass over random images with weights of any published network (write_formula_weights makes
// some). Prints seconds of the trunk, the cameras and the dense heads, and the peak memory.
// compare_networks runs it beside Python.
#include "network/weights.h"
#include "scene/error.h"
#include "scene/memory.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <thread>

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <c10/core/InferenceMode.h>

namespace vgtw {
namespace {

double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Waits for what was started on a GPU.
void Finish(const at::Tensor& result) { result.flatten()[0].item<float>(); }

int Run(int argc, char** argv) {
  const int64_t num_views = std::atoi(argv[2]);
  const int64_t height = argc > 4 ? std::atoi(argv[3]) : 392;
  const int64_t width = argc > 4 ? std::atoi(argv[4]) : 518;
  LoadOptions options;
  options.device = at::Device(argc > 5 ? argv[5] : "cpu");
  if (argc > 6 && std::string_view(argv[6]) == "bf16") options.product_type = at::kBFloat16;
  options.check_values = false;
  at::set_num_threads(static_cast<int>(std::thread::hardware_concurrency()));
  const c10::InferenceMode inference;
  const double start = Seconds();
  const LoadedNetwork network = LoadNetwork({argv[1]}, options);
  const at::Tensor images = at::rand({num_views, 3, height, width}).to(options.device);

  const double loaded = Seconds();
  EncodeOptions encode;
  encode.on_layer = [&](int64_t, const at::Tensor&) { network.ReleasePages(); };
  const Features features = network.model->Encode(images, encode);
  Finish(features.last);
  const double encoded = Seconds();
  Finish(network.model->PredictCameras(features).cam_from_world);
  const double cameras = Seconds();
  for (int64_t i = 0; i < num_views; ++i) {
    Finish(network.model->PredictMaps(features, i, i + 1, {}).depth);
  }
  const double heads = Seconds();
  std::printf(
      "{\"load_sec\": %.2f, \"encode_sec\": %.2f, \"cameras_sec\": %.2f, \"heads_sec\": %.2f, "
      "\"forward_sec\": %.2f, \"peak_gib\": %.2f}\n",
      loaded - start,
      encoded - loaded,
      cameras - encoded,
      heads - cameras,
      heads - loaded,
      static_cast<double>(PeakMemory()) / kGib);
  return 0;
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "network_benchmark WEIGHTS NUM_VIEWS [HEIGHT WIDTH [DEVICE [TYPE]]]\n");
    return 2;
  }
  try {
    return vgtw::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
