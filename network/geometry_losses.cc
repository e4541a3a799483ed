// SPDX-License-Identifier: BSD-3-Clause
#include "network/geometry_losses.h"

#include "network/camera_geometry.h"
#include "network/layers.h"
#include "scene/error.h"

#include <string>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

// [S, 3, 4] as seen from a world that is the frame of the first of them.
at::Tensor RelativeToFirst(const at::Tensor& cam_from_world) {
  const at::Tensor world_from_first = InvertPoses(cam_from_world.slice(0, 0, 1));
  const at::Tensor rotations = cam_from_world.slice(2, 0, 3);
  return at::cat({at::matmul(rotations, world_from_first.slice(2, 0, 3)),
                  at::matmul(rotations, world_from_first.slice(2, 3)) + cam_from_world.slice(2, 3)},
                 2);
}

at::Tensor MeanError(const at::Tensor& found, const at::Tensor& truth, double huber_scale) {
  if (huber_scale == 0.0) return (found - truth).abs().mean();
  return at::huber_loss(found, truth, at::Reduction::Mean, huber_scale) / huber_scale;
}

// Mean of |e(p) - e(q)| over pairs of pixels side by side or one below the other.
at::Tensor MeanDifference(const at::Tensor& error, const at::Tensor& is_known) {
  at::Tensor sum = at::zeros({}, error.options());
  at::Tensor count = at::zeros({}, error.options().dtype(at::kLong));
  for (const int64_t dim : {1, 2}) {
    const int64_t length = error.size(dim);
    const auto first = [&](const at::Tensor& x) { return x.slice(dim, 0, length - 1); };
    const auto second = [&](const at::Tensor& x) { return x.slice(dim, 1, length); };
    const at::Tensor both = first(is_known).logical_and(second(is_known));
    sum = sum + (both * (second(error) - first(error)).abs()).sum();
    count = count + both.sum();
  }
  return sum / count.clamp_min(1);
}

// Of errors [M, H, W] of maps and their confidences; errors count where they are known.
at::Tensor MapLoss(const at::Tensor& any_error,
                   const at::Tensor& confidence,
                   const at::Tensor& is_known,
                   const MapLossOptions& options) {
  options.Check();
  const at::Tensor error = any_error.masked_fill(is_known.logical_not(), 0.0);
  const at::Tensor c = AtLeastFloat(confidence);
  const at::Tensor weighted = (c * error.abs() - options.alpha * c.log()) * is_known;
  at::Tensor loss = weighted.sum() / is_known.sum().clamp_min(1);
  for (int scale = 0; scale < options.num_gradient_scales; ++scale) {
    const int64_t step = int64_t{1} << scale;
    const auto sampled = [&](const at::Tensor& x) {
      return x.slice(1, 0, x.size(1), step).slice(2, 0, x.size(2), step);
    };
    loss = loss + options.gradient_weight * MeanDifference(sampled(error), sampled(is_known));
  }
  return loss;
}

void CheckNotNegative(double value, const std::string& name) {
  VGTW_CHECK(value >= 0.0, name + " = " + std::to_string(value) + ", must be >= 0");
}

}  // namespace

at::Tensor IsKnownDepth(const at::Tensor& depth) { return depth.isfinite().logical_and(depth > 0); }

std::optional<NormalisedTruth> NormaliseTruth(const GeometryTruth& truth, ScaleViews scale_views) {
  const int64_t num_views = truth.depth.size(0);
  VGTW_CHECK(truth.depth.dim() == 3, "depth [S, H, W]");
  VGTW_CHECK(truth.cam_from_world.sizes() == at::IntArrayRef({num_views, 3, 4}),
             "cam_from_world [S, 3, 4]");
  VGTW_CHECK(truth.intrinsics.sizes() == at::IntArrayRef({num_views, 3, 3}),
             "intrinsics [S, 3, 3]");
  // In double: worlds may be far from their origin.
  const at::Tensor cameras = RelativeToFirst(truth.cam_from_world.to(at::kDouble));
  const at::Tensor is_known = IsKnownDepth(truth.depth);
  const at::Tensor depth = truth.depth.to(at::kDouble).masked_fill(is_known.logical_not(), 0.0);
  const int64_t num_used = scale_views == ScaleViews::kFirst ? 1 : num_views;
  const auto used = [&](const at::Tensor& x) { return x.slice(0, 0, num_used); };
  const at::Tensor points = Unproject(
      used(depth), {used(cameras), used(truth.intrinsics).to(at::kDouble)});  // [S, H, W, 3]
  const at::Tensor distances = used(is_known) * points.norm(2, {3});
  const double scale = (distances.sum() / used(is_known).sum()).item<double>();
  if (!(scale > 0.0)) return std::nullopt;  // also 0/0
  const at::Tensor normalised_cameras =
      at::cat({cameras.slice(2, 0, 3), cameras.slice(2, 3) / scale}, 2);
  return NormalisedTruth{{(depth / scale).to(truth.depth.scalar_type()),
                          normalised_cameras.to(truth.cam_from_world.scalar_type()),
                          truth.intrinsics},
                         scale};
}

void CameraLossOptions::Check() const {
  CheckNotNegative(huber_scale, "CameraLossOptions::huber_scale");
  CheckNotNegative(translation_weight, "CameraLossOptions::translation_weight");
  CheckNotNegative(rotation_weight, "CameraLossOptions::rotation_weight");
  CheckNotNegative(field_of_view_weight, "CameraLossOptions::field_of_view_weight");
  VGTW_CHECK(iteration_decay > 0.0 && iteration_decay <= 1.0,
             "CameraLossOptions::iteration_decay = " + std::to_string(iteration_decay) +
                 ", must be in (0, 1]");
}

at::Tensor CameraLoss(const std::vector<at::Tensor>& encodings,
                      const at::Tensor& true_encodings,
                      const CameraLossOptions& options) {
  options.Check();
  VGTW_CHECK(!encodings.empty(), "an iteration");
  VGTW_CHECK(true_encodings.dim() == 2 && true_encodings.size(1) == 9, "encodings [S, 9]");
  at::Tensor loss;
  for (const at::Tensor& encoding : encodings) {
    VGTW_CHECK(encoding.sizes() == true_encodings.sizes(), "one true encoding per view");
    const at::Tensor found = AtLeastFloat(encoding);
    const at::Tensor truth = true_encodings.to(found.scalar_type());
    const at::Tensor quaternions = found.slice(1, 3, 7);
    const at::Tensor true_quaternions = truth.slice(1, 3, 7);
    const at::Tensor is_other =
        (quaternions.detach() * true_quaternions).sum(1, /*keepdim=*/true) < 0.0;
    const auto part = [&](int64_t begin, int64_t end) {
      return MeanError(found.slice(1, begin, end), truth.slice(1, begin, end), options.huber_scale);
    };
    const at::Tensor error = options.translation_weight * part(0, 3) +
                             options.rotation_weight *
                                 MeanError(quaternions,
                                           at::where(is_other, -true_quaternions, true_quaternions),
                                           options.huber_scale) +
                             options.field_of_view_weight * part(7, 9);
    loss = loss.defined() ? options.iteration_decay * loss + error : error;
  }
  return loss / static_cast<double>(encodings.size());
}

void MapLossOptions::Check() const {
  VGTW_CHECK(alpha > 0.0, "MapLossOptions::alpha = " + std::to_string(alpha) + ", must be > 0");
  CheckNotNegative(gradient_weight, "MapLossOptions::gradient_weight");
  VGTW_CHECK(num_gradient_scales >= 0 && num_gradient_scales <= 16,
             "MapLossOptions::num_gradient_scales = " + std::to_string(num_gradient_scales) +
                 ", must be in [0, 16]");
}

at::Tensor DepthLoss(const at::Tensor& depth,
                     const at::Tensor& confidence,
                     const at::Tensor& true_depth,
                     const MapLossOptions& options) {
  VGTW_CHECK(depth.dim() == 3, "depth [S, H, W]");
  VGTW_CHECK(confidence.sizes() == depth.sizes() && true_depth.sizes() == depth.sizes(),
             "one confidence and one true depth per pixel");
  const at::Tensor is_known = IsKnownDepth(true_depth);
  const at::Tensor found = AtLeastFloat(depth);
  const at::Tensor truth =
      true_depth.masked_fill(is_known.logical_not(), 0.0).to(found.scalar_type());
  return MapLoss(found - truth, confidence, is_known, options);
}

at::Tensor PointLoss(const at::Tensor& points,
                     const at::Tensor& confidence,
                     const GeometryTruth& truth,
                     const MapLossOptions& options) {
  VGTW_CHECK(points.dim() == 4 && points.size(3) == 3, "points [S, H, W, 3]");
  VGTW_CHECK(points.slice(3, 0, 1).squeeze(3).sizes() == truth.depth.sizes() &&
                 confidence.sizes() == truth.depth.sizes(),
             "one confidence and one true depth per pixel");
  const at::Tensor is_known = IsKnownDepth(truth.depth);
  const at::Tensor found = AtLeastFloat(points);
  const at::Tensor true_points = Unproject(truth.depth.masked_fill(is_known.logical_not(), 0.0),
                                           {truth.cam_from_world, truth.intrinsics})
                                     .to(found.scalar_type());
  // x, y and z are maps of their own.
  const auto maps = [](const at::Tensor& x) { return x.permute({3, 0, 1, 2}).flatten(0, 1); };
  return MapLoss(
      maps(found - true_points), confidence.repeat({3, 1, 1}), is_known.repeat({3, 1, 1}), options);
}

}  // namespace vgtw
