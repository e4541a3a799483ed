// SPDX-License-Identifier: BSD-3-Clause
#include "matching/search_window.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <cmath>
#include <numbers>

namespace vgtw {
namespace {

// What localisation in the image itself costs, whatever the prediction.
constexpr double kMinRadiusPx = 3.0;
// Where no depth is known, points nearer than this times the baseline are not expected.
constexpr double kMinDepthPerBaseline = 0.5;
constexpr double kFarthestPerBaseline = 1e4;
// A lens bends the image of a ray: by how much shows in its middle and its quarters, which inverse
// depth divides evenly.
constexpr double kPlacesOfBow[] = {0.25, 0.5, 0.75};

}  // namespace

void PredictionUncertainty::Check() const {
  VGTW_CHECK(rotation_deg >= 0.0 && rotation_deg <= 90.0, "PredictionUncertainty::rotation_deg");
  VGTW_CHECK(centre >= 0.0 && std::isfinite(centre), "PredictionUncertainty::centre");
  VGTW_CHECK(focal >= 0.0 && focal <= 1.0, "PredictionUncertainty::focal");
  VGTW_CHECK(depth >= 0.0 && depth <= 1.0, "PredictionUncertainty::depth");
}

WindowPredictor::WindowPredictor(const ViewFeatures& view1,
                                 const ViewFeatures& view2,
                                 const PredictionUncertainty& uncertainty,
                                 double num_sigmas)
    : view1_(view1),
      camera2_(view2.view.camera),
      cam2_from_cam1_(view2.view.cam_from_world * Inverse(view1.view.cam_from_world)),
      uncertainty_(uncertainty),
      num_sigmas_(num_sigmas) {
  uncertainty.Check();
  std::vector<double> depths;
  for (const float depth : view1.depths) {
    if (std::isfinite(depth)) depths.push_back(depth);
  }
  if (depths.empty()) {
    // The baseline may be as long as its uncertainty; without any all depths look alike.
    const double longest = std::max(cam2_from_cam1_.translation.norm(), uncertainty.centre);
    const double baseline = longest > 0.0 ? longest : 1.0;
    known_depths_ = {kMinDepthPerBaseline * baseline, kFarthestPerBaseline * baseline};
  } else {
    const double margin = std::exp(num_sigmas * uncertainty.depth);
    known_depths_ = {Percentile(depths, 1.0) / margin, Percentile(depths, 99.0) * margin};
  }
}

std::optional<WindowPredictor::DepthRange> WindowPredictor::InFrontOfView2(
    const Eigen::Vector3d& ray, DepthRange range) const {
  // z in view 2 is slope * depth + offset; near its plane an image of the ray says nothing.
  const double slope = (cam2_from_cam1_.rotation * ray).z();
  const double offset = cam2_from_cam1_.translation.z();
  const double min_z = 1e-2 * range.nearest;
  if (slope > 0.0) range.nearest = std::max(range.nearest, (min_z - offset) / slope);
  if (slope < 0.0) range.farthest = std::min(range.farthest, (min_z - offset) / slope);
  if (slope == 0.0 && offset < min_z) return std::nullopt;
  if (!(range.nearest <= range.farthest)) return std::nullopt;
  return range;
}

double WindowPredictor::Radius(const Eigen::Vector2d& pixel1,
                               const Eigen::Vector2d& pixel2,
                               const Eigen::Vector3d& point_in_cam2) const {
  const double focal1 = view1_.view.camera.MeanFocalLength();
  const double focal2 = camera2_.MeanFocalLength();
  const double rotation_rad = uncertainty_.rotation_deg * std::numbers::pi / 180.0;
  const Eigen::Vector3d errors(
      focal2 * rotation_rad * (1.0 + point_in_cam2.hnormalized().squaredNorm()),
      focal2 / point_in_cam2.z() * uncertainty_.centre,
      uncertainty_.focal *
          ((pixel2 - camera2_.PrincipalPoint()).norm() +
           focal2 / focal1 * (pixel1 - view1_.view.camera.PrincipalPoint()).norm()));
  return std::max(kMinRadiusPx, num_sigmas_ * errors.norm());
}

float WindowPredictor::Bow(const Eigen::Vector3d& ray,
                           const DepthRange& range,
                           const Capsule& axis) const {
  float bow2 = 0.0f;
  for (const double share : kPlacesOfBow) {
    const double depth = 1.0 / ((1.0 - share) / range.nearest + share / range.farthest);
    const auto pixel = Project(camera2_, cam2_from_cam1_ * (depth * ray));
    if (pixel) bow2 = std::max(bow2, axis.SquaredDistanceToAxis(pixel->cast<float>()));
  }
  return std::sqrt(bow2);
}

bool WindowPredictor::IsOutside(const Capsule& capsule) const {
  const Eigen::Array2f lowest = capsule.start.cwiseMin(capsule.end).array() - capsule.radius;
  const Eigen::Array2f highest = capsule.start.cwiseMax(capsule.end).array() + capsule.radius;
  const Eigen::Array2f size(static_cast<float>(camera2_.width),
                            static_cast<float>(camera2_.height));
  return !((highest >= 0.0f).all() && (lowest <= size).all());
}

std::optional<SearchWindow> WindowPredictor::WindowOf(size_t idx1) const {
  if (view1_.rays[idx1].hasNaN()) return std::nullopt;
  const Eigen::Vector3d ray = view1_.rays[idx1].cast<double>().homogeneous();
  const double depth = view1_.depths[idx1];
  const bool has_depth = std::isfinite(depth);
  const double spread = std::exp(num_sigmas_ * uncertainty_.depth);
  const auto range =
      InFrontOfView2(ray, has_depth ? DepthRange{depth / spread, depth * spread} : known_depths_);
  if (!range) return std::nullopt;
  const double middle = std::sqrt(range->nearest * range->farthest);
  const Eigen::Vector3d point_in_cam2 = cam2_from_cam1_ * (middle * ray);
  const auto nearest = Project(camera2_, cam2_from_cam1_ * (range->nearest * ray));
  const auto farthest = Project(camera2_, cam2_from_cam1_ * (range->farthest * ray));
  const auto centre = Project(camera2_, point_in_cam2);
  if (!nearest || !farthest || !centre) return std::nullopt;
  SearchWindow window;
  window.capsule = {nearest->cast<float>(), farthest->cast<float>(), 0.0f};
  window.centre = centre->cast<float>();
  const Eigen::Vector2d pixel1 = view1_.pixels[idx1].cast<double>();
  window.capsule.radius =
      Bow(ray, *range, window.capsule) + static_cast<float>(Radius(pixel1, *centre, point_in_cam2));
  if (!std::isfinite(window.capsule.radius) || IsOutside(window.capsule)) return std::nullopt;
  if (has_depth) {
    window.scale_ratio = static_cast<float>(camera2_.MeanFocalLength() / point_in_cam2.z() * depth /
                                            view1_.view.camera.MeanFocalLength());
  }
  return window;
}

}  // namespace vgtw
