// SPDX-License-Identifier: BSD-3-Clause
// distractor_losses_benchmark ours|naive NUM_VIEWS [NUM_TOKENS CHANNELS [cpu|cuda]]
// Losses of random features and their gradient, ours or by automatic differentiation. Prints
// seconds, and the peak memory of the process with its two buffers for features and gradient, both
// before the losses and after. On a CPU; memory of a GPU is not counted.
#include "network/distractor_losses.h"
#include "scene/error.h"
#include "scene/memory.h"
#include "tests/network/naive_losses.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <thread>

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

namespace vgtw {
namespace {

double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int Run(int argc, char** argv) {
  const bool is_naive = std::string_view(argv[1]) == "naive";
  const int64_t num_views = std::atoi(argv[2]);
  const int64_t num_tokens = argc > 4 ? std::atoi(argv[3]) : 1369;
  const int64_t num_channels = argc > 4 ? std::atoi(argv[4]) : 2048;
  const at::Device device(argc > 5 ? argv[5] : "cpu");
  at::set_num_threads(static_cast<int>(std::thread::hardware_concurrency()));
  at::manual_seed(0);
  const at::Tensor features =
      at::randn({num_views, num_tokens, num_channels}).to(device).requires_grad_();
  const at::Tensor kind = at::rand({num_views, num_tokens}).to(device);
  const TokenLabels labels = {kind > 0.8, kind < 0.75};
  features.mutable_grad() = at::zeros_like(features);
  const int64_t memory_before = PeakMemory();

  const double start = Seconds();
  const FeatureLosses losses =
      is_naive ? NaiveLosses(features, labels) : ComputeFeatureLosses(features, labels);
  const at::Tensor loss = losses.suppression + losses.consistency;
  const double value = loss.item<double>();
  const double forward = Seconds();
  loss.backward();
  const double slope = features.grad().norm().item<double>();
  const double backward = Seconds();
  std::printf(
      "{\"forward_sec\": %.2f, \"backward_sec\": %.2f, \"loss\": %.6f, \"gradient_norm\": %.6g, "
      "\"memory_before_gib\": %.2f, \"peak_gib\": %.2f}\n",
      forward - start,
      backward - forward,
      value,
      slope,
      static_cast<double>(memory_before) / kGib,
      static_cast<double>(PeakMemory()) / kGib);
  return 0;
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(
        stderr,
        "distractor_losses_benchmark ours|naive NUM_VIEWS [NUM_TOKENS CHANNELS [cpu|cuda]]\n");
    return 2;
  }
  try {
    return vgtw::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
