// SPDX-License-Identifier: BSD-3-Clause
#include "network/dpt_head.h"

#include <cmath>
#include <utility>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr double kNormEps = 1e-5;
constexpr double kPositionScale = 0.1;
constexpr double kPositionBase = 100.0;
constexpr int64_t kNumHiddenOutputs = 32;

ConvolutionConfig Kernel3(int64_t num_inputs, int64_t num_outputs) {
  return {.num_inputs = num_inputs, .num_outputs = num_outputs, .kernel = 3, .padding = 1};
}

ConvolutionConfig Kernel1(int64_t num_inputs, int64_t num_outputs) {
  return {.num_inputs = num_inputs, .num_outputs = num_outputs};
}

at::Tensor Resize(const at::Tensor& x, int64_t height, int64_t width) {
  return at::upsample_bilinear2d(x, {height, width}, /*align_corners=*/true);
}

// [n, C]: sines, then cosines of positions * frequencies, computed in double.
at::Tensor SinesAndCosines(const at::Tensor& positions, int64_t num_channels) {
  const int64_t num_frequencies = num_channels / 2;
  const at::Tensor exponents =
      at::arange(num_frequencies, at::kDouble) / static_cast<double>(num_frequencies);
  const at::Tensor angles =
      positions.to(at::kDouble).unsqueeze(1) * at::pow(kPositionBase, exponents).reciprocal();
  return at::cat({angles.sin(), angles.cos()}, 1);
}

at::Tensor PixelCentres(int64_t num_pixels, double span) {
  const double end = span * static_cast<double>(num_pixels - 1) / static_cast<double>(num_pixels);
  return at::linspace(-end, end, num_pixels, at::kFloat);
}

void AddPositions(at::Tensor& x, int64_t image_height, int64_t image_width) {
  const double aspect = static_cast<double>(image_width) / static_cast<double>(image_height);
  x = x + PositionMap(x.size(1), x.size(2), x.size(3), aspect).to(x.device());
}

}  // namespace

at::Tensor PositionGrid(int64_t height, int64_t width, double aspect) {
  const double diagonal = std::sqrt(aspect * aspect + 1.0);
  const at::Tensor x = PixelCentres(width, aspect / diagonal);
  const at::Tensor y = PixelCentres(height, 1.0 / diagonal);
  return at::stack({x.expand({height, width}), y.unsqueeze(1).expand({height, width})}, 2);
}

at::Tensor PositionMap(int64_t num_channels, int64_t height, int64_t width, double aspect) {
  const at::Tensor grid = PositionGrid(height, width, aspect);
  const at::Tensor x = SinesAndCosines(grid.select(2, 0)[0], num_channels / 2);
  const at::Tensor y = SinesAndCosines(grid.select(2, 1).select(1, 0), num_channels / 2);
  const at::Tensor map = at::cat(
      {x.t().unsqueeze(1).expand({-1, height, -1}), y.t().unsqueeze(2).expand({-1, -1, width})}, 0);
  return (map.to(at::kFloat) * kPositionScale).unsqueeze(0);
}

ResidualUnit::ResidualUnit(const ParameterScope& scope, int64_t num_features)
    : conv1_(scope["conv1"], Kernel3(num_features, num_features)),
      conv2_(scope["conv2"], Kernel3(num_features, num_features)) {}

at::Tensor ResidualUnit::operator()(const at::Tensor& x) const {
  const at::Tensor active = x.relu();
  return conv2_(conv1_(active).relu()) + active;
}

FusionBlock::FusionBlock(const ParameterScope& scope, int64_t num_features, bool has_side)
    : unit_(scope["resConfUnit2"], num_features),
      out_conv_(scope["out_conv"], Kernel1(num_features, num_features)) {
  if (has_side) side_unit_.emplace(scope["resConfUnit1"], num_features);
}

at::Tensor FusionBlock::operator()(const at::Tensor& x,
                                   const at::Tensor& side,
                                   int64_t height,
                                   int64_t width) const {
  const at::Tensor joined = side_unit_ ? x + (*side_unit_)(side) : x;
  return out_conv_(Resize(unit_(joined), height, width));
}

DptHead::DptHead(const ParameterScope& scope, const DptHeadConfig& config)
    : config_(config),
      norm_(scope["norm"], config.token_dim, kNormEps),
      downsampling_(scope["resize_layers"][3],
                    {.num_inputs = config.dpt.num_channels[3],
                     .num_outputs = config.dpt.num_channels[3],
                     .kernel = 3,
                     .stride = 2,
                     .padding = 1}),
      output1_(scope["scratch"]["output_conv1"],
               Kernel3(config.dpt.num_features, config.dpt.num_features / 2)),
      output2_(scope["scratch"]["output_conv2"][0],
               Kernel3(config.dpt.num_features / 2, kNumHiddenOutputs)),
      output3_(scope["scratch"]["output_conv2"][2],
               Kernel1(kNumHiddenOutputs, config.num_outputs)) {
  const ParameterScope scratch = scope["scratch"];
  upsamplings_.emplace_back(scope["resize_layers"][0], config.dpt.num_channels[0], 4);
  upsamplings_.emplace_back(scope["resize_layers"][1], config.dpt.num_channels[1], 2);
  for (int64_t k = 0; k < 4; ++k) {
    const int64_t num_channels = config.dpt.num_channels[static_cast<size_t>(k)];
    const std::string number = std::to_string(k + 1);
    projects_.emplace_back(scope["projects"][k], Kernel1(config.token_dim, num_channels));
    ConvolutionConfig to_features = Kernel3(num_channels, config.dpt.num_features);
    to_features.has_bias = false;
    to_features_.emplace_back(scratch["layer" + number + "_rn"], to_features);
    fusions_.emplace_back(
        scratch["refinenet" + number], config.dpt.num_features, /*has_side=*/k < 3);
  }
}

at::Tensor DptHead::Reassemble(size_t k,
                               const at::Tensor& tokens,
                               int64_t rows,
                               int64_t columns) const {
  at::Tensor x = norm_(tokens.slice(1, kNumSpecialTokens))
                     .transpose(1, 2)
                     .reshape({tokens.size(0), config_.token_dim, rows, columns});
  x = projects_[k](x);
  if (config_.adds_positions) AddPositions(x, rows, columns);
  if (k < 2) x = upsamplings_[k](x);
  if (k == 3) x = downsampling_(x);
  return to_features_[k](x);
}

at::Tensor DptHead::operator()(const std::array<at::Tensor, 4>& layers,
                               int64_t height,
                               int64_t width) const {
  std::array<at::Tensor, 4> maps;
  for (size_t k = 0; k < 4; ++k) {
    maps[k] = Reassemble(k, layers[k], height / kPatchSize, width / kPatchSize);
  }
  const auto resolution = [&](size_t k) { return std::pair(maps[k].size(2), maps[k].size(3)); };
  at::Tensor x = maps[3];
  for (size_t k = 4; k-- > 0;) {
    const auto [rows, columns] =
        k > 0 ? resolution(k - 1) : std::pair(2 * x.size(2), 2 * x.size(3));
    x = fusions_[k](x, k < 3 ? maps[k] : at::Tensor(), rows, columns);
  }
  x = Resize(output1_(x), height, width);
  if (config_.adds_positions) AddPositions(x, height, width);
  return AtLeastFloat(output3_(output2_(x).relu()));
}

}  // namespace vgtw
