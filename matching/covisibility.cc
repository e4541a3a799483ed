// SPDX-License-Identifier: BSD-3-Clause
#include "matching/covisibility.h"

#include "matching/assumed_depth.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

namespace vgtw {
namespace {

constexpr double kDegPerRad = 180.0 / std::numbers::pi;

bool IsSimilar(double a, double b, double max_relative_difference) {
  return a <= b * (1.0 + max_relative_difference) && b <= a * (1.0 + max_relative_difference);
}

double MaxRayRadius(const Camera& camera) {
  double radius = 0.0;
  const auto width = static_cast<double>(camera.width);
  const auto height = static_cast<double>(camera.height);
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(0, 0), {width, 0}, {0, height}, {width, height}}) {
    const auto ray = Unproject(camera, corner);
    // Where the lens model has no inverse there, every direction in front is tried.
    radius = std::max(radius, ray ? ray->norm() : std::numeric_limits<double>::infinity());
  }
  return radius;
}

std::vector<Eigen::Vector3d> AssumePoints(const View& view, double scene_depth) {
  constexpr int kNumPerSide = 8;
  const Rigid3d world_from_cam = Inverse(view.cam_from_world);
  const Eigen::Vector2d cell(static_cast<double>(view.camera.width) / kNumPerSide,
                             static_cast<double>(view.camera.height) / kNumPerSide);
  std::vector<Eigen::Vector3d> points;
  for (int y = 0; y < kNumPerSide; ++y) {
    for (int x = 0; x < kNumPerSide; ++x) {
      const auto ray = Unproject(view.camera, cell.cwiseProduct(Eigen::Vector2d(x + 0.5, y + 0.5)));
      if (!ray) continue;
      for (const double factor : {0.5, 1.0, 2.0}) {
        points.push_back(world_from_cam * (factor * scene_depth * ray->homogeneous()));
      }
    }
  }
  return points;
}

void CheckField(bool is_valid, double value, const char* name, const char* range) {
  VGTW_CHECK(is_valid,
             std::string("CovisibilityOptions::") + name + " = " + std::to_string(value) +
                 ", must be in " + range);
}

}  // namespace

void CovisibilityOptions::Check() const {
  CheckField(max_relative_depth_difference > 0.0 && max_relative_depth_difference <= 10.0,
             max_relative_depth_difference,
             "max_relative_depth_difference",
             "(0, 10]");
  CheckField(position_error_percent >= 0.0 && position_error_percent <= 100.0,
             position_error_percent,
             "position_error_percent",
             "[0, 100]");
  CheckField(max_ray_angle_deg > 0.0 && max_ray_angle_deg <= 180.0,
             max_ray_angle_deg,
             "max_ray_angle_deg",
             "(0, 180]");
  CheckField(max_size_ratio >= 1.0 && max_size_ratio <= 1000.0,
             max_size_ratio,
             "max_size_ratio",
             "[1, 1000]");
}

Covisibility::Covisibility(const std::vector<ViewSketch>& sketches,
                           const CovisibilityOptions& options)
    : sketches_(sketches), options_(options) {
  options.Check();
  min_cosine_ = std::cos(options.max_ray_angle_deg / kDegPerRad);
  for (const ViewSketch& sketch : sketches) {
    eyes_.push_back(MakeEye(sketch.view, options.position_error_percent));
  }
  const bool all_have_points = std::all_of(
      sketches.begin(), sketches.end(), [](const ViewSketch& s) { return !s.points.empty(); });
  const double scene_depth = all_have_points ? 0.0 : SceneDepth();
  for (size_t i = 0; i < sketches.size(); ++i) {
    Eye& eye = eyes_[i];
    if (!eye.is_usable) continue;
    if (!HasOwnPoints(i)) eye.assumed_points = AssumePoints(sketches[i].view, scene_depth);
    for (const Eigen::Vector3d& point : PointsOf(i)) {
      const double depth = eye.rotation.row(2).dot(point) + eye.translation.z();
      eye.footprints.push_back(depth * eye.footprint_per_depth);
    }
  }
}

Covisibility::Eye Covisibility::MakeEye(const View& view, double position_error_percent) {
  Eye eye;
  eye.is_usable = FindFault(view.cam_from_world).empty() && FindFault(view.camera).empty();
  if (!eye.is_usable) return eye;
  const auto longer_side = static_cast<double>(std::max(view.camera.width, view.camera.height));
  eye.rotation = view.cam_from_world.rotation.toRotationMatrix();
  eye.translation = view.cam_from_world.translation;
  eye.centre = OriginInSource(view.cam_from_world);
  eye.squared_ray_radius = std::pow(MaxRayRadius(view.camera), 2);
  eye.footprint_per_depth = longer_side / view.camera.MeanFocalLength();
  eye.position_error_px = position_error_percent / 100.0 * longer_side;
  return eye;
}

double Covisibility::SceneDepth() const {
  std::vector<double> medians;
  std::vector<View> views;
  for (size_t i = 0; i < eyes_.size(); ++i) {
    if (!eyes_[i].is_usable) continue;
    views.push_back(sketches_[i].view);
    std::vector<double> depths;
    for (const Eigen::Vector3d& point : sketches_[i].points) {
      depths.push_back((sketches_[i].view.cam_from_world * point).z());
    }
    if (!depths.empty()) medians.push_back(Median(std::move(depths)));
  }
  if (!medians.empty()) return Median(std::move(medians));
  return views.empty() ? 1.0 : AssumedDepth(views);
}

bool Covisibility::HasOwnPoints(size_t view_idx) const {
  return !sketches_[view_idx].points.empty();
}

const std::vector<Eigen::Vector3d>& Covisibility::PointsOf(size_t view_idx) const {
  return HasOwnPoints(view_idx) ? sketches_[view_idx].points : eyes_[view_idx].assumed_points;
}

const std::vector<double>& Covisibility::FootprintsOf(size_t view_idx) const {
  return eyes_[view_idx].footprints;
}

bool Covisibility::HasAtItsDepth(size_t view_idx, const Eigen::Vector3d& point_in_cam) const {
  const Eye& eye = eyes_[view_idx];
  const Camera& camera = sketches_[view_idx].view.camera;
  const auto pixel = Project(camera, point_in_cam);
  if (!pixel) return false;
  const Eigen::Array2d size(static_cast<double>(camera.width), static_cast<double>(camera.height));
  if (!((pixel->array() >= 0.0).all() && (pixel->array() < size).all())) return false;
  const DepthMap& map = sketches_[view_idx].depth;
  if (map.empty()) return true;
  const Eigen::Array2i num_cells(map.width(), map.height());
  const Eigen::Array2d cells_per_px = num_cells.cast<double>() / size;
  const auto cell_of = [&](double shift_px) -> Eigen::Array2i {
    const Eigen::Array2d position = (pixel->array() + shift_px) * cells_per_px;
    return position.max(0.0).cast<int>().min(num_cells - 1);
  };
  const Eigen::Array2i min = cell_of(-eye.position_error_px);
  const Eigen::Array2i max = cell_of(eye.position_error_px);
  for (int y = min.y(); y <= max.y(); ++y) {
    for (int x = min.x(); x <= max.x(); ++x) {
      if (IsSimilar(map(x, y), point_in_cam.z(), options_.max_relative_depth_difference))
        return true;
    }
  }
  return false;
}

double Covisibility::SeenFraction(size_t from_idx,
                                  size_t by_idx,
                                  std::vector<double>& cosines) const {
  const Eye& from = eyes_[from_idx];
  const Eye& by = eyes_[by_idx];
  const std::vector<Eigen::Vector3d>& points = PointsOf(from_idx);
  size_t num_seen = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d point_in_cam = by.rotation * points[i] + by.translation;
    const double depth = point_in_cam.z();
    // Beyond the corners, the formula of a distorted lens may fold points back into the image.
    if (!(depth > 0.0 &&
          point_in_cam.head<2>().squaredNorm() <= by.squared_ray_radius * depth * depth)) {
      continue;
    }
    const double footprint = depth * by.footprint_per_depth;
    if (!IsSimilar(footprint, from.footprints[i], options_.max_size_ratio - 1.0)) continue;
    const Eigen::Vector3d ray = points[i] - from.centre;
    const Eigen::Vector3d other_ray = points[i] - by.centre;
    const double cosine =
        ray.dot(other_ray) / std::sqrt(ray.squaredNorm() * other_ray.squaredNorm());
    if (!(cosine >= min_cosine_) || !HasAtItsDepth(by_idx, point_in_cam)) continue;
    cosines.push_back(cosine);
    ++num_seen;
  }
  return points.empty() ? 0.0 : static_cast<double>(num_seen) / static_cast<double>(points.size());
}

std::optional<ViewPair> Covisibility::Measure(size_t view_idx1, size_t view_idx2) const {
  VGTW_CHECK(view_idx1 < eyes_.size() && view_idx2 < eyes_.size() && view_idx1 != view_idx2,
             "two views");
  if (!eyes_[view_idx1].is_usable || !eyes_[view_idx2].is_usable) return std::nullopt;
  const auto [idx1, idx2] = std::minmax(view_idx1, view_idx2);
  ViewPair pair{.view_idx1 = idx1, .view_idx2 = idx2, .covisibility = 1.0};
  std::vector<double> cosines;
  for (const auto& [from, by] : {std::pair(idx1, idx2), std::pair(idx2, idx1)}) {
    if (!HasOwnPoints(from) && HasOwnPoints(by)) continue;
    pair.covisibility = std::min(pair.covisibility, SeenFraction(from, by, cosines));
    if (pair.covisibility == 0.0) return std::nullopt;
  }
  pair.angle_deg = std::acos(std::clamp(Median(std::move(cosines)), -1.0, 1.0)) * kDegPerRad;
  return pair;
}

}  // namespace vgtw
