// SPDX-License-Identifier: BSD-3-Clause
#include "refine/filter.h"

#include "scene/error.h"
#include "scene/reprojection.h"

#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {
namespace {

bool HasTriangulationAngle(const std::vector<Eigen::Vector3d>& unit_rays, double min_angle_rad) {
  for (size_t i = 0; i < unit_rays.size(); ++i) {
    for (size_t j = i + 1; j < unit_rays.size(); ++j) {
      const double angle_rad =
          std::atan2(unit_rays[i].cross(unit_rays[j]).norm(), unit_rays[i].dot(unit_rays[j]));
      if (angle_rad >= min_angle_rad) return true;
    }
  }
  return false;
}

}  // namespace

void FilterOptions::Check() const {
  VGTW_CHECK(max_reprojection_error_px > 0.0,
             "FilterOptions::max_reprojection_error_px = " +
                 std::to_string(max_reprojection_error_px) + ", must be > 0");
  VGTW_CHECK(min_triangulation_angle_deg >= 0.0 && min_triangulation_angle_deg < 90.0,
             "FilterOptions::min_triangulation_angle_deg = " +
                 std::to_string(min_triangulation_angle_deg) + ", must be in [0, 90)");
}

FilterSummary FilterObservations(const FilterOptions& options, Reconstruction& reconstruction) {
  options.Check();
  const double min_angle_rad = options.min_triangulation_angle_deg * std::numbers::pi / 180.0;
  FilterSummary summary;
  std::vector<Point3DId> bad_points;
  std::vector<TrackElement> bad_observations;
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    std::vector<TrackElement> bad;
    std::vector<Eigen::Vector3d> unit_rays;
    for (const TrackElement& element : point.track) {
      const Image& image = reconstruction.images.at(element.image_id);
      const std::optional<double> error_px =
          ReprojectionError(reconstruction, image, image.points2D.at(element.point2D_idx));
      const auto own = options.max_reprojection_error_px_by_image.find(element.image_id);
      const double max_px = own == options.max_reprojection_error_px_by_image.end()
                                ? options.max_reprojection_error_px
                                : own->second;
      if (error_px && *error_px <= max_px) {
        unit_rays.push_back((point.xyz - OriginInSource(image.cam_from_world)).normalized());
      } else {
        bad.push_back(element);
      }
    }
    if (unit_rays.size() < 2 || !HasTriangulationAngle(unit_rays, min_angle_rad)) {
      bad_points.push_back(point3D_id);
      summary.num_removed_observations += point.track.size();
    } else {
      bad_observations.insert(bad_observations.end(), bad.begin(), bad.end());
    }
  }
  for (const TrackElement& element : bad_observations) RemoveObservation(reconstruction, element);
  for (const Point3DId point3D_id : bad_points) RemovePoint3D(reconstruction, point3D_id);
  summary.num_removed_observations += bad_observations.size();
  summary.num_removed_points3D = bad_points.size();
  return summary;
}

}  // namespace vgtw
