// SPDX-License-Identifier: BSD-3-Clause
#include "network/correspondence_loss.h"

#include "network/camera_geometry.h"
#include "network/layers.h"
#include "scene/error.h"

#include <string>
#include <vector>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

// The middles of all patches, pixels [P, 2] (x, y) of long.
at::Tensor PatchMiddles(int64_t height, int64_t width, int64_t patch_size) {
  const auto middles = [&](int64_t side) {
    return at::arange(patch_size / 2, side, patch_size, at::kLong);
  };
  const auto grid = at::meshgrid({middles(height), middles(width)}, "ij");
  return at::stack({grid[1].flatten(), grid[0].flatten()}, 1);
}

// Of maps [S, H, W] at pixels [S', N, 2] of long, S' = S or 1: [S, N].
at::Tensor Look(const at::Tensor& maps, const at::Tensor& pixels) {
  const at::Tensor idx = pixels.select(-1, 1) * maps.size(2) + pixels.select(-1, 0);
  return maps.flatten(1).gather(1, idx.expand({maps.size(0), -1}));
}

struct Projection {
  at::Tensor pixels;  // [S, N, 2]
  at::Tensor depth;   // [S, N]
};

// World points [N, 3] in all views.
Projection Project(const at::Tensor& points, const GeometryTruth& truth) {
  const at::Tensor in_camera =
      at::matmul(points, truth.cam_from_world.slice(2, 0, 3).transpose(1, 2)) +
      truth.cam_from_world.slice(2, 3).transpose(1, 2);
  const at::Tensor homogeneous = at::matmul(in_camera, truth.intrinsics.transpose(1, 2));
  const at::Tensor depth = homogeneous.select(2, 2);
  return {homogeneous.slice(2, 0, 2) / depth.unsqueeze(2), depth};
}

// Points [N, 3] of the world that view i shows at pixels [N, 2] in depths [N].
at::Tensor Lift(const GeometryTruth& truth,
                int64_t view,
                const at::Tensor& pixels,
                const at::Tensor& depth) {
  const at::Tensor homogeneous =
      at::cat({pixels, at::ones({pixels.size(0), 1}, pixels.options())}, 1);
  const at::Tensor rays =
      at::matmul(homogeneous, at::inverse(truth.intrinsics[view]).transpose(0, 1));
  const at::Tensor in_camera = rays * depth.unsqueeze(1);
  const at::Tensor world_from_cam = InvertPoses(truth.cam_from_world.slice(0, view, view + 1))[0];
  return at::matmul(in_camera, world_from_cam.slice(1, 0, 3).transpose(0, 1)) +
         world_from_cam.select(1, 3);
}

// A grid of patches over images.
struct PatchGrid {
  int64_t rows = 0;
  int64_t columns = 0;
  int64_t patch_size = 0;
};

// The four patches around pixels [S, N, 2] and their bilinear weights, 0 where not seen.
PatchMatches PatchesAround(const at::Tensor& pixels,
                           const at::Tensor& is_seen,
                           const PatchGrid& grid) {
  const at::Tensor last =
      at::tensor({grid.columns - 1, grid.rows - 1}, pixels.options().dtype(at::kLong));
  const at::Tensor place =  // in patches from the middle of the first
      ((pixels - static_cast<double>(grid.patch_size / 2)) / static_cast<double>(grid.patch_size))
          .masked_fill(is_seen.logical_not().unsqueeze(2), 0.0);
  const at::Tensor clamped = at::minimum(place.clamp_min(0.0), last.to(at::kDouble));
  const at::Tensor low = clamped.floor().to(at::kLong);
  const at::Tensor high = at::minimum(low + 1, last);
  const at::Tensor share = clamped - clamped.floor();  // of the higher one
  std::vector<at::Tensor> patches, weights;
  for (const bool is_below : {false, true}) {
    for (const bool is_right : {false, true}) {
      const auto axis_share = [&](bool is_high, int64_t axis) {
        return is_high ? share.select(2, axis) : 1.0 - share.select(2, axis);
      };
      patches.push_back((is_below ? high : low).select(2, 1) * grid.columns +
                        (is_right ? high : low).select(2, 0));
      weights.push_back(axis_share(is_right, 0) * axis_share(is_below, 1) * is_seen);
    }
  }
  return {at::stack(patches, 2), at::stack(weights, 2)};
}

// Whether views [S, N] show points at these pixels and depths, and not something else.
at::Tensor AreSeen(const Projection& projection,
                   const GeometryTruth& truth,
                   const at::Tensor& is_static,
                   double same_depth) {
  const at::Tensor nearest = projection.pixels.round();
  const at::Tensor limits =
      at::tensor({truth.depth.size(2) - 1, truth.depth.size(1) - 1}, nearest.options());
  const at::Tensor is_inside =
      nearest.ge(0).logical_and(nearest.le(limits)).all(2).logical_and(projection.depth > 0);
  const at::Tensor pixels =
      nearest.masked_fill(is_inside.logical_not().unsqueeze(2), 0.0).to(at::kLong);
  const at::Tensor difference = (Look(truth.depth, pixels) - projection.depth).abs();
  return (difference < same_depth * projection.depth)
      .logical_and(Look(is_static, pixels))
      .logical_and(is_inside);
}

}  // namespace

void PatchMatchOptions::Check() const {
  VGTW_CHECK(patch_size > 0, "PatchMatchOptions::patch_size = " + std::to_string(patch_size));
  VGTW_CHECK(
      same_depth > 0.0 && same_depth < 1.0,
      "PatchMatchOptions::same_depth = " + std::to_string(same_depth) + ", must be in (0, 1)");
}

PatchMatches MatchPatches(const GeometryTruth& truth,
                          const at::Tensor& distractor,
                          const PatchMatchOptions& options) {
  options.Check();
  VGTW_CHECK(truth.depth.dim() == 3 && distractor.sizes() == truth.depth.sizes(),
             "depth and distractor [S, H, W]");
  const int64_t height = truth.depth.size(1), width = truth.depth.size(2);
  VGTW_CHECK(height % options.patch_size == 0 && width % options.patch_size == 0,
             "sides that are multiples of the patch size");
  const PatchGrid grid = {
      height / options.patch_size, width / options.patch_size, options.patch_size};
  const GeometryTruth exact = {truth.depth.to(at::kDouble),
                               truth.cam_from_world.to(at::kDouble),
                               truth.intrinsics.to(at::kDouble)};
  const at::Tensor is_static = IsKnownDepth(exact.depth).logical_and(distractor.eq(0));
  const at::Tensor middles =
      PatchMiddles(height, width, options.patch_size).to(exact.depth.device());
  const at::Tensor is_asked = Look(is_static, middles.unsqueeze(0));
  const at::Tensor depth =
      Look(exact.depth, middles.unsqueeze(0)).masked_fill(is_asked.logical_not(), 1.0);
  std::vector<at::Tensor> patches, weights;
  for (int64_t view = 0; view < truth.depth.size(0); ++view) {
    const at::Tensor points = Lift(exact, view, middles.to(at::kDouble), depth[view]);
    const Projection projection = Project(points, exact);
    const at::Tensor is_seen = AreSeen(projection, exact, is_static, options.same_depth)
                                   .logical_and(is_asked[view].unsqueeze(0));
    const PatchMatches found = PatchesAround(projection.pixels, is_seen, grid);
    found.weight.select(0, view).zero_();  // a view finds itself without learning
    patches.push_back(found.patch);
    weights.push_back(found.weight);
  }
  return {at::stack(patches), at::stack(weights).to(at::kFloat)};
}

at::Tensor CorrespondenceLoss(const at::Tensor& features,
                              const PatchMatches& matches,
                              double temperature) {
  VGTW_CHECK(features.dim() == 3, "features [S, P, C]");
  VGTW_CHECK(matches.patch.dim() == 4 && matches.patch.size(0) == features.size(0) &&
                 matches.patch.size(2) == features.size(1),
             "matches of the same views and patches");
  VGTW_CHECK(temperature > 0.0, "temperature = " + std::to_string(temperature));
  constexpr double kMinLength = 1e-8;
  const at::Tensor found = AtLeastFloat(features);
  const at::Tensor unit = found / found.norm(2, {2}, /*keepdim=*/true).clamp_min(kMinLength);
  // [S, 1, P, C] x [1, S, C, P]
  const at::Tensor similarity =
      at::matmul(unit.unsqueeze(1), unit.transpose(1, 2).unsqueeze(0)) / temperature;
  const at::Tensor log_shares = at::log_softmax(similarity, 3).gather(3, matches.patch);
  const at::Tensor weight = matches.weight.to(found.scalar_type());
  return -(weight * log_shares).sum() / weight.sum().clamp_min(1.0);
}

}  // namespace vgtw
