// SPDX-License-Identifier: BSD-3-Clause
#include "scene/synthetic.h"

#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/statistics.h"
#include "scene/synthetic_renderer.h"
#include "scene/synthetic_world.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace vgtw {

struct SyntheticScene::Impl {
  SyntheticOptions options;
  SyntheticWorld world;
};

namespace {

void CheckRange(double value, double min, double max, const std::string& name) {
  VGTW_CHECK(value >= min && value <= max,
             "SyntheticOptions::" + name + " = " + std::to_string(value) + ", must be in [" +
                 std::to_string(min) + ", " + std::to_string(max) + "]");
}

// Static surfaces seen at the corners of network pixels.
class CornerHits {
 public:
  CornerHits(const SyntheticWorld& world, const View& view)
      : hits_(view.network_width + 1, view.network_height + 1) {
    for (int y = 0; y < hits_.height(); ++y) {
      for (int x = 0; x < hits_.width(); ++x) {
        const auto ray = PixelRay(view, Apply(view.original_from_network, Eigen::Vector2d(x, y)));
        if (ray) hits_(x, y) = FindNearest(world.static_shapes, *ray);
      }
    }
  }

  // Whether network pixel (x, y) shows another surface than `hit` that is nearer or farther by more
  // than a slanted surface would be.
  bool HasEdge(int x, int y, const Hit& hit) const {
    constexpr double kMaxRelativeStep = 0.02;
    for (const int corner : {0, 1, 2, 3}) {
      const auto& other = hits_(x + corner % 2, y + corner / 2);
      if (!other) return true;
      if (other->shape != hit.shape &&
          std::abs(other->depth - hit.depth) > kMaxRelativeStep * hit.depth) {
        return true;
      }
    }
    return false;
  }

 private:
  Grid<std::optional<Hit>> hits_;
};

float ConfidenceAtDepth(double depth) {
  constexpr double kFallOff = 6.0;  // scene units
  return static_cast<float>(1.0 + 9.0 * std::exp(-depth / kFallOff));
}

bool ShowsDistractor(const SyntheticWorld& world, size_t view_idx, const Eigen::Vector2d& pixel) {
  const auto ray = PixelRay(world.views[view_idx], pixel);
  if (!ray) return false;
  const auto before = FindNearest(world.distractor_shapes[view_idx], *ray);
  if (!before) return false;
  const auto behind = FindNearest(world.static_shapes, *ray);
  return !behind || before->depth < behind->depth;
}

ViewPrediction PredictView(const SyntheticWorld& world, size_t view_idx, int network_width) {
  ViewPrediction prediction;
  View& view = prediction.view;
  view = world.views[view_idx];
  const NetworkGeometry geometry = MakeNetworkGeometry(
      ResizePolicy::kCrop, view.camera.width, view.camera.height, network_width, 0);
  view.network_width = geometry.network_width;
  view.network_height = geometry.network_height;
  view.original_from_network = geometry.original_from_network;
  prediction.depth =
      DepthMap(view.network_width, view.network_height, std::numeric_limits<float>::quiet_NaN());
  prediction.depth_conf = ConfidenceMap(view.network_width, view.network_height, 1.0f);
  prediction.distractor = DistractorMask(view.network_width, view.network_height, 0.0f);
  const CornerHits corner_hits(world, view);
  for (int y = 0; y < view.network_height; ++y) {
    for (int x = 0; x < view.network_width; ++x) {
      const Eigen::Vector2d pixel = Apply(view.original_from_network, {x + 0.5, y + 0.5});
      const Eigen::Vector2d nearest_centre = pixel.array().floor() + 0.5;
      const bool is_distractor = ShowsDistractor(world, view_idx, nearest_centre);
      if (is_distractor) prediction.distractor(x, y) = 1.0f;
      const auto ray = PixelRay(view, pixel);
      const auto hit = ray ? FindNearest(world.static_shapes, *ray) : std::nullopt;
      if (!hit || corner_hits.HasEdge(x, y, *hit)) continue;
      prediction.depth(x, y) = static_cast<float>(hit->depth);
      if (!is_distractor) prediction.depth_conf(x, y) = ConfidenceAtDepth(hit->depth);
    }
  }
  return prediction;
}

}  // namespace

void SyntheticOptions::Check() const {
  constexpr double kMaxSide = 32768.0;
  CheckRange(num_views, 1, 1e6, "num_views");
  CheckRange(width, 32, kMaxSide, "width");
  CheckRange(height, 32, kMaxSide, "height");
  CheckRange(focal_length_factor, 0.3, 10.0, "focal_length_factor");
  CheckRange(radial_distortion, -0.3, 0.3, "radial_distortion");
  CheckRange(path_extent_deg, 0.0, 360.0, "path_extent_deg");
  CheckRange(num_distractors, 0, 1000, "num_distractors");
  CheckRange(distractor_size, 0.01, 100.0, "distractor_size");
  CheckRange(distractor_absence, 0.0, 1.0, "distractor_absence");
  CheckRange(image_noise, 0.0, 255.0, "image_noise");
  CheckRange(exposure_change, 0.0, 3.0, "exposure_change");
}

SyntheticScene::SyntheticScene(const SyntheticOptions& options) {
  options.Check();
  impl_ = std::make_unique<Impl>(Impl{options, MakeSyntheticWorld(options)});
}

SyntheticScene::~SyntheticScene() = default;
SyntheticScene::SyntheticScene(SyntheticScene&&) noexcept = default;

const SyntheticOptions& SyntheticScene::options() const { return impl_->options; }

const std::vector<View>& SyntheticScene::views() const { return impl_->world.views; }

double SyntheticScene::CameraExtent() const {
  std::vector<Eigen::Vector3d> centres;
  for (const View& view : views()) centres.push_back(OriginInSource(view.cam_from_world));
  return Diameter(centres);
}

SyntheticView SyntheticScene::Render(size_t view_idx) const {
  VGTW_CHECK(view_idx < views().size(), "there is no view " + std::to_string(view_idx));
  return RenderView(impl_->world, impl_->options, view_idx);
}

std::optional<Eigen::Vector3d> SyntheticScene::StaticPoint(size_t view_idx,
                                                           const Eigen::Vector2d& pixel) const {
  VGTW_CHECK(view_idx < views().size(), "there is no view " + std::to_string(view_idx));
  const auto ray = PixelRay(views()[view_idx], pixel);
  const auto hit = ray ? FindNearest(impl_->world.static_shapes, *ray) : std::nullopt;
  if (!hit) return std::nullopt;
  return ray->At(hit->depth);
}

Prediction MakeTruePrediction(const SyntheticScene& scene, int network_width) {
  VGTW_CHECK(network_width >= 14, "network_width = " + std::to_string(network_width));
  Prediction prediction;
  prediction.producer = "synthetic truth";
  prediction.views.resize(scene.views().size());
  ParallelFor(
      static_cast<int64_t>(scene.views().size()), scene.options().num_threads, [&](int64_t i) {
        const auto view_idx = static_cast<size_t>(i);
        prediction.views[view_idx] = PredictView(scene.impl_->world, view_idx, network_width);
      });
  return prediction;
}

}  // namespace vgtw
