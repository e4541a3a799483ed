// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict.h"

#include "network/device.h"
#include "network/plain_errors.h"
#include "network/predict_run.h"
#include "network/probe_run.h"
#include "network/runtime.h"
#include "network/vggt.h"
#include "network/weights.h"
#include "scene/error.h"

#include <cmath>
#include <utility>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr char kMemoryAdvice[] = "; use a smaller --max_views or --max_memory";

at::ScalarType ProductType(Precision precision, const at::Device& device) {
  if (precision == Precision::kFloat32) return at::kFloat;
  if (precision == Precision::kBfloat16) return at::kBFloat16;
  if (device.is_cpu()) throw Error("fp16 runs on a GPU only; use fp32 or bf16 on the CPU");
  return at::kHalf;
}

at::Tensor DescribeViews(const VisionTransformer& encoder, const at::Tensor& images) {
  return encoder(NormaliseImages(images)).to(at::kFloat).mean(1);
}

}  // namespace

void PredictOptions::Check() const {
  VGTW_CHECK(side_px >= 0 && side_px <= 1 << 14 && side_px % kPatchSize == 0,
             "side_px = " + std::to_string(side_px) + ", must be a multiple of 14");
  VGTW_CHECK(max_pixels >= kPatchSize * kPatchSize && max_pixels <= 1 << 28,
             "max_pixels = " + std::to_string(max_pixels));
  VGTW_CHECK(max_views_at_once >= 0 && max_views_at_once != 1,
             "max_views = " + std::to_string(max_views_at_once));
  VGTW_CHECK(num_overlap_views >= 1, "overlap = " + std::to_string(num_overlap_views));
  VGTW_CHECK(std::isfinite(max_memory_gib) && max_memory_gib >= 0.0 && max_memory_gib < 1e6,
             "max_memory = " + std::to_string(max_memory_gib));
}

struct Predictor::Impl {
  PredictOptions options;
  LoadedNetwork loaded;
  ReadyNetwork network;
};

Predictor::Predictor(const std::vector<std::filesystem::path>& weights,
                     const PredictOptions& options) {
  options.Check();
  LoadOptions load;
  load.kind = options.kind;
  load.device = ParseDevice(options.device);
  load.product_type = ProductType(options.precision, load.device);
  load.num_threads = options.num_threads;
  // Loading converts types, which is LibTorch's work.
  UseThreads(options.num_threads);
  impl_.reset(new Impl{
      options, WithPlainErrors([&] { return LoadNetwork(weights, load); }, kMemoryAdvice), {}});
  const LoadedNetwork& loaded = impl_->loaded;
  ReadyNetwork& network = impl_->network;
  network.model = loaded.model.get();
  network.description = loaded.description;
  network.device = load.device;
  if (load.device.is_cpu()) {
    network.release_memory = [&loaded] { loaded.ReleasePages(); };
  } else {
    for (const auto& [name, tensor] : loaded.weights.tensors()) {
      network.weights_bytes += static_cast<int64_t>(tensor.NumElements() * sizeof(float));
    }
  }
  const auto* vggt = dynamic_cast<const Vggt*>(network.model);
  if (vggt != nullptr && vggt->aggregator().encoder()) {
    network.describe_views = [&encoder = *vggt->aggregator().encoder()](const at::Tensor& images) {
      return DescribeViews(encoder, images);
    };
  }
}

Predictor::~Predictor() = default;

NetworkKind Predictor::kind() const { return impl_->loaded.description.kind; }

PredictSummary Predictor::Run(const std::filesystem::path& image_folder,
                              const std::vector<std::string>& image_names,
                              const std::function<void(const ViewPrediction&)>& on_prediction,
                              const ProgressCallback& progress) const {
  return WithPlainErrors(
      [&] {
        return PredictViews(
            impl_->network, impl_->options, image_folder, image_names, on_prediction, progress);
      },
      kMemoryAdvice);
}

ProbeSummary Predictor::Probe(const std::filesystem::path& image_folder,
                              const std::vector<std::string>& image_names,
                              const ProbeRequest& request,
                              const ProgressCallback& progress) const {
  return WithPlainErrors(
      [&] {
        return ProbeViews(
            impl_->network, impl_->options, image_folder, image_names, request, progress);
      },
      kMemoryAdvice);
}

}  // namespace vgtw
