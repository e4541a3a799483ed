// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/model_quality.h"

#include "evaluation/distractor_points.h"
#include "scene/statistics.h"
#include "scene/triangulation_angle.h"

#include <algorithm>
#include <bitset>
#include <utility>
#include <vector>

namespace vgtw {
namespace {

constexpr int kCellsPerSide = 10;

using AnglesDeg = std::map<Point3DId, double>;

AnglesDeg AnglesOf(const Reconstruction& model) {
  AnglesDeg angles_deg;
  for (const auto& [id, point] : model.points3D) {
    std::vector<Eigen::Vector3d> centres;
    for (const TrackElement& element : point.track) {
      centres.push_back(OriginInSource(model.images.at(element.image_id).cam_from_world));
    }
    angles_deg[id] = TriangulationAngleDeg(centres, point.xyz);
  }
  return angles_deg;
}

double CoveragePercent(const Image& image, const Camera& camera) {
  std::bitset<kCellsPerSide * kCellsPerSide> cells;
  const auto cell_of = [](double position, double size) {
    return std::clamp(static_cast<int>(position / size * kCellsPerSide), 0, kCellsPerSide - 1);
  };
  for (const Point2D& point2D : image.points2D) {
    if (!point2D.HasPoint3D()) continue;
    const int column = cell_of(point2D.xy.x(), static_cast<double>(camera.width));
    const int row = cell_of(point2D.xy.y(), static_cast<double>(camera.height));
    cells.set(static_cast<size_t>(row * kCellsPerSide + column));
  }
  return 100.0 * static_cast<double>(cells.count()) / static_cast<double>(cells.size());
}

ViewQuality QualityOf(const Reconstruction& model,
                      const Image& image,
                      const AnglesDeg& angles_deg,
                      std::vector<double>& all_errors_px) {
  ViewQuality quality;
  std::vector<double> errors_px;
  std::vector<double> view_angles_deg;
  size_t sum_track_lengths = 0;
  for (const Point2D& point2D : image.points2D) {
    if (!point2D.HasPoint3D()) continue;
    ++quality.num_observations;
    sum_track_lengths += model.points3D.at(point2D.point3D_id).track.size();
    view_angles_deg.push_back(angles_deg.at(point2D.point3D_id));
    if (const auto error = ReprojectionError(model, image, point2D)) errors_px.push_back(*error);
  }
  quality.coverage_percent = CoveragePercent(image, model.cameras.at(image.camera_id));
  if (quality.num_observations == 0) return quality;
  quality.mean_track_length =
      static_cast<double>(sum_track_lengths) / static_cast<double>(quality.num_observations);
  quality.median_angle_deg = Median(std::move(view_angles_deg));
  all_errors_px.insert(all_errors_px.end(), errors_px.begin(), errors_px.end());
  if (!errors_px.empty()) quality.median_px = Median(std::move(errors_px));
  return quality;
}

}  // namespace

ModelQuality MeasureQuality(const Reconstruction& model,
                            const std::function<StaticMask(const std::string&)>& mask) {
  ModelQuality quality;
  quality.reprojection = ComputeReprojectionStats(model);
  const AnglesDeg angles_deg = AnglesOf(model);
  double sum_coverage = 0.0;
  for (const auto& [id, image] : model.images) {
    quality.views[id] = QualityOf(model, image, angles_deg, quality.errors_px);
    sum_coverage += quality.views[id].coverage_percent;
  }
  if (!model.images.empty()) {
    quality.coverage_percent = sum_coverage / static_cast<double>(model.images.size());
  }
  for (const auto& [id, point] : model.points3D) {
    quality.track_lengths.push_back(static_cast<double>(point.track.size()));
  }
  std::vector<double> all_angles_deg;
  for (const auto& [id, angle_deg] : angles_deg) all_angles_deg.push_back(angle_deg);
  if (!all_angles_deg.empty()) quality.median_angle_deg = Median(std::move(all_angles_deg));
  if (!mask) return quality;
  const DistractorCount count = CountOnDistractors(model, mask);
  quality.num_points_on_distractors = count.num_points3D;
  for (const auto& [id, num] : count.num_observations_by_image) {
    quality.views.at(id).num_on_distractors = num;
  }
  return quality;
}

}  // namespace vgtw
