// SPDX-License-Identifier: BSD-3-Clause
#include "scene/reprojection.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

namespace vgtw {
namespace {

std::optional<double> ReprojectionError(const Camera& camera,
                                        const Rigid3d& cam_from_world,
                                        const Eigen::Vector3d& point_in_world,
                                        const Eigen::Vector2d& pixel) {
  const std::optional<Eigen::Vector2d> projected = Project(camera, cam_from_world * point_in_world);
  if (!projected) return std::nullopt;
  const double error = (*projected - pixel).norm();
  if (!std::isfinite(error)) return std::nullopt;
  return error;
}

// Calls visit(error) for every observation of `point`.
template <typename Visit>
void ForEachError(const Reconstruction& reconstruction, const Point3D& point, const Visit& visit) {
  for (const TrackElement& element : point.track) {
    const auto image = reconstruction.images.find(element.image_id);
    VGTW_CHECK(image != reconstruction.images.end(), "a track names a missing image");
    VGTW_CHECK(element.point2D_idx < image->second.points2D.size(),
               "a track names a missing point2D");
    const auto camera = reconstruction.cameras.find(image->second.camera_id);
    VGTW_CHECK(camera != reconstruction.cameras.end(), "an image names a missing camera");
    visit(ReprojectionError(camera->second,
                            image->second.cam_from_world,
                            point.xyz,
                            image->second.points2D[element.point2D_idx].xy));
  }
}

}  // namespace

std::optional<double> ReprojectionError(const Reconstruction& reconstruction,
                                        const Image& image,
                                        const Point2D& point2D) {
  const auto camera = reconstruction.cameras.find(image.camera_id);
  VGTW_CHECK(camera != reconstruction.cameras.end(), "an image names a missing camera");
  const auto point = reconstruction.points3D.find(point2D.point3D_id);
  VGTW_CHECK(point != reconstruction.points3D.end(), "a point2D names a missing point3D");
  return ReprojectionError(camera->second, image.cam_from_world, point->second.xyz, point2D.xy);
}

ReprojectionStats ComputeReprojectionStats(const Reconstruction& reconstruction) {
  ReprojectionStats stats;
  stats.num_images = reconstruction.images.size();
  stats.num_points3D = reconstruction.points3D.size();
  std::vector<double> errors;
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    stats.num_observations += point.track.size();
    ForEachError(reconstruction, point, [&](const std::optional<double>& error) {
      if (error) {
        errors.push_back(*error);
      } else {
        ++stats.num_behind_camera;
      }
    });
  }
  if (stats.num_points3D > 0) {
    stats.mean_track_length =
        static_cast<double>(stats.num_observations) / static_cast<double>(stats.num_points3D);
  }
  if (errors.empty()) return stats;
  stats.mean_px =
      std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
  stats.p90_px = Percentile(errors, 90.0);
  stats.median_px = Median(std::move(errors));
  return stats;
}

void UpdatePointError(const Reconstruction& reconstruction, Point3D& point) {
  double sum = 0.0;
  size_t num_errors = 0;
  ForEachError(reconstruction, point, [&](const std::optional<double>& error) {
    sum += error.value_or(0.0);
    num_errors += error.has_value();
  });
  point.error = num_errors > 0 ? sum / static_cast<double>(num_errors) : -1.0;
}

void UpdatePointErrors(Reconstruction& reconstruction) {
  for (auto& [point3D_id, point] : reconstruction.points3D) UpdatePointError(reconstruction, point);
}

}  // namespace vgtw
