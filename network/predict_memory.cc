// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_memory.h"

#include "network/config.h"

namespace vgtw {
namespace {

constexpr int64_t kFloatBytes = 4;

// Width of a network's tokens, how many layers its heads read, and the features of its dense heads.
struct Sizes {
  int64_t dim = 0;
  int64_t num_kept_layers = 0;
  int64_t num_features = 0;
};

Sizes SizesOf(const NetworkDescription& description) {
  if (const auto* vggt = std::get_if<VggtConfig>(&description.config)) {
    return {vggt->dim, 4, vggt->dpt.num_features};
  }
  const auto& pi3 = std::get<Pi3Config>(description.config);
  if (!pi3.has_distractor_head) return {pi3.encoder.dim, 1, 0};
  return {pi3.encoder.dim, 5, pi3.dpt.num_features};
}

}  // namespace

MemoryEstimate EstimateMemory(const NetworkDescription& description, int width, int height) {
  const Sizes sizes = SizesOf(description);
  const int64_t num_pixels = static_cast<int64_t>(width) * height;
  const int64_t num_tokens = num_pixels / (kPatchSize * kPatchSize) + kNumSpecialTokens;
  constexpr int64_t kBlockWidths = 15;
  const int64_t widths_per_view = 2 * sizes.num_kept_layers + 2 + kBlockWidths;
  constexpr int64_t kImageCopies = 3;
  MemoryEstimate estimate;
  estimate.per_view =
      kFloatBytes * (widths_per_view * sizes.dim * num_tokens + kImageCopies * 3 * num_pixels);
  constexpr int64_t kMapsPerFeature = 4;
  estimate.fixed = kFloatBytes * num_pixels * kMapsPerFeature * (sizes.num_features + 32);
  return estimate;
}

}  // namespace vgtw
