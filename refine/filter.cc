// SPDX-License-Identifier: BSD-3-Clause
#include "refine/filter.h"

#include "scene/error.h"
#include "scene/reprojection.h"
#include "scene/triangulation_angle.h"

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {
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
  FilterSummary summary;
  std::vector<Point3DId> bad_points;
  std::vector<TrackElement> bad_observations;
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    std::vector<TrackElement> bad;
    std::vector<Eigen::Vector3d> centres;
    for (const TrackElement& element : point.track) {
      const Image& image = reconstruction.images.at(element.image_id);
      const std::optional<double> error_px =
          ReprojectionError(reconstruction, image, image.points2D.at(element.point2D_idx));
      const auto own = options.max_reprojection_error_px_by_image.find(element.image_id);
      const double max_px = own == options.max_reprojection_error_px_by_image.end()
                                ? options.max_reprojection_error_px
                                : own->second;
      if (error_px && *error_px <= max_px) {
        centres.push_back(OriginInSource(image.cam_from_world));
      } else {
        bad.push_back(element);
      }
    }
    const double min_angle_deg = options.min_triangulation_angle_deg;
    if (centres.size() < 2 ||
        TriangulationAngleDeg(centres, point.xyz, min_angle_deg) < min_angle_deg) {
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
