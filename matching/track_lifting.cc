// SPDX-License-Identifier: BSD-3-Clause
#include "matching/track_lifting.h"

#include "matching/point_estimate.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/reprojection.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

namespace vgtw {
namespace {

constexpr double kRadFromDeg = std::numbers::pi / 180.0;

// A view as far as it concerns its rays.
struct LiftingView {
  const ViewFeatures* features = nullptr;
  Eigen::Matrix3d world_from_cam_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // in the world
  double scale = 1.0;
  double depth_sigma = 0.0;  // relative
  double median_confidence = 0.0;
};

class Lifter {
 public:
  Lifter(const std::map<ImageId, ViewFeatures>& views,
         const DepthScales& scales,
         const LiftOptions& options)
      : options_(options) {
    for (const auto& [image_id, features] : views) {
      LiftingView& view = views_[image_id];
      view.features = &features;
      const Rigid3d world_from_cam = Inverse(features.view.cam_from_world);
      view.world_from_cam_rotation = world_from_cam.rotation.toRotationMatrix();
      view.centre = world_from_cam.translation;
      const auto scale = scales.find(image_id);
      if (scale != scales.end()) view.scale = scale->second.scale;
      view.depth_sigma = scale == scales.end() || std::isnan(scale->second.spread)
                             ? options.default_depth_sigma
                             : scale->second.spread;
      view.depth_sigma = std::max(view.depth_sigma, options.min_depth_sigma);
      std::vector<double> confidences;
      for (size_t i = 0; i < features.size(); ++i) {
        if (!std::isnan(features.depths[i])) confidences.push_back(features.depth_confs[i]);
      }
      if (!confidences.empty()) view.median_confidence = Median(std::move(confidences));
    }
  }

  LiftedTracks Lift(const std::vector<std::vector<TrackElement>>& tracks) const {
    LiftedTracks lifted;
    const double ray_sigma_rad = MeasureRaySigma(tracks);
    lifted.ray_sigma_deg = ray_sigma_rad / kRadFromDeg;
    lifted.points.resize(tracks.size());
    constexpr size_t kTracksPerTask = 1024;
    const size_t num_tasks = (tracks.size() + kTracksPerTask - 1) / kTracksPerTask;
    ParallelFor(static_cast<int64_t>(num_tasks), options_.num_threads, [&](int64_t task) {
      const size_t begin = static_cast<size_t>(task) * kTracksPerTask;
      const size_t end = std::min(begin + kTracksPerTask, tracks.size());
      for (size_t i = begin; i < end; ++i) {
        lifted.points[i] = LiftTrack(tracks[i], LimitsFor(ray_sigma_rad));
      }
    });
    for (const auto& point : lifted.points) lifted.num_lifted += point.has_value();
    return lifted;
  }

 private:
  // `elements` are those of the track that see something.
  std::vector<Sighting> SightingsOf(const std::vector<TrackElement>& track,
                                    std::vector<TrackElement>& elements) const {
    std::vector<Sighting> sightings;
    elements.clear();
    for (const TrackElement& element : track) {
      const auto found = views_.find(element.image_id);
      if (found == views_.end()) continue;
      const LiftingView& view = found->second;
      const size_t idx = element.point2D_idx;
      VGTW_CHECK(
          idx < view.features->size(),
          "image " + std::to_string(element.image_id) + " has no keypoint " + std::to_string(idx));
      const Eigen::Vector3d ray_in_cam = view.features->rays[idx].cast<double>().homogeneous();
      if (!ray_in_cam.allFinite()) continue;
      Sighting sighting;
      sighting.centre = view.centre;
      sighting.axis = view.world_from_cam_rotation.col(2);
      sighting.ray = view.world_from_cam_rotation * ray_in_cam.normalized();
      const double depth = view.features->depths[idx];
      if (depth > 0.0 && std::isfinite(depth)) {
        sighting.range = view.scale * depth * ray_in_cam.norm();
      }
      sighting.range_sigma =
          view.depth_sigma / std::sqrt(WeightOf(view, view.features->depth_confs[idx]));
      sightings.push_back(sighting);
      elements.push_back(element);
    }
    return sightings;
  }

  std::optional<LiftedPoint> LiftTrack(const std::vector<TrackElement>& track,
                                       const PointLimits& limits) const {
    std::vector<TrackElement> elements;
    const auto estimate = EstimatePoint(SightingsOf(track, elements), limits);
    if (!estimate) return std::nullopt;
    LiftedPoint lifted;
    lifted.xyz = estimate->xyz;
    lifted.sigma = estimate->sigma;
    double sum_of_squares = 0.0;
    for (const size_t i : estimate->agreeing) {
      lifted.track.push_back(elements[i]);
      sum_of_squares += estimate->errors_rad[i] * estimate->errors_rad[i];
    }
    const auto num_agreeing = static_cast<double>(estimate->agreeing.size());
    lifted.error_deg = std::sqrt(sum_of_squares / num_agreeing) / kRadFromDeg;
    return lifted;
  }

  // Producers give confidences in units of their own.
  static double WeightOf(const LiftingView& view, double confidence) {
    constexpr double kMaxWeight = 4.0;
    if (!(view.median_confidence > 0.0) || std::isnan(confidence)) return 1.0;
    return std::clamp(confidence / view.median_confidence, 1.0 / kMaxWeight, kMaxWeight);
  }

  PointLimits LimitsFor(double ray_sigma_rad) const {
    return {ray_sigma_rad, options_.max_error_deg * kRadFromDeg, options_.max_sigmas};
  }

  // From the largest sigma down to the one that the points have which are lifted with it.
  double MeasureRaySigma(const std::vector<std::vector<TrackElement>>& tracks) const {
    constexpr size_t kMaxTracks = 3000;
    constexpr int kMaxIterations = 20;
    constexpr double kMedianOfRayleigh = 1.1774;  // length of a 2-vector of sigma 1
    const double min_sigma = options_.min_ray_sigma_deg * kRadFromDeg;
    const double max_sigma =
        std::max(min_sigma, options_.max_error_deg * kRadFromDeg / options_.max_sigmas);
    double sigma = max_sigma;
    const size_t num_tracks = std::min(tracks.size(), kMaxTracks);
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
      std::vector<double> errors;
      for (size_t i = 0; i < num_tracks; ++i) {
        AppendErrors(tracks[i * tracks.size() / num_tracks], LimitsFor(sigma), errors);
      }
      if (errors.empty()) break;
      const double last_sigma = sigma;
      sigma = std::clamp(Median(std::move(errors)) / kMedianOfRayleigh, min_sigma, max_sigma);
      if (std::abs(sigma - last_sigma) < 0.01 * last_sigma) break;
    }
    return sigma;
  }

  // The errors of all rays. Were it only those that agree, the sigma would shrink from one
  // iteration to the next until few are left.
  void AppendErrors(const std::vector<TrackElement>& track,
                    const PointLimits& limits,
                    std::vector<double>& errors) const {
    std::vector<TrackElement> elements;
    const std::vector<Sighting> sightings = SightingsOf(track, elements);
    const bool has_depth = std::any_of(
        sightings.begin(), sightings.end(), [](const Sighting& s) { return !std::isnan(s.range); });
    if (sightings.size() < 2 || !has_depth) return;
    const auto estimate = EstimatePoint(sightings, limits);
    if (!estimate) {
      errors.insert(errors.end(), sightings.size(), limits.RayRad());
      return;
    }
    // A point that is fitted to n rays lies closer to them than the true one.
    const auto num_rays = static_cast<double>(sightings.size());
    const double correction = std::sqrt(num_rays / (num_rays - 1.0));
    for (const double error_rad : estimate->errors_rad) errors.push_back(correction * error_rad);
  }

  LiftOptions options_;
  std::map<ImageId, LiftingView> views_;
};

}  // namespace

void LiftOptions::Check() const {
  const auto check = [](double value, double min, double max, const std::string& name) {
    VGTW_CHECK(value >= min && value <= max,
               "LiftOptions::" + name + " = " + std::to_string(value) + ", must be in [" +
                   std::to_string(min) + ", " + std::to_string(max) + "]");
  };
  check(max_sigmas, 1.0, 100.0, "max_sigmas");
  check(max_error_deg, 1e-6, 45.0, "max_error_deg");
  check(min_ray_sigma_deg, 1e-6, max_error_deg, "min_ray_sigma_deg");
  check(min_depth_sigma, 1e-6, 1.0, "min_depth_sigma");
  check(default_depth_sigma, 1e-6, 1.0, "default_depth_sigma");
}

LiftedTracks LiftTracks(const std::map<ImageId, ViewFeatures>& views,
                        const std::vector<std::vector<TrackElement>>& tracks,
                        const DepthScales& scales,
                        const LiftOptions& options) {
  options.Check();
  return Lifter(views, scales, options).Lift(tracks);
}

size_t AddPoints(const LiftedTracks& lifted, Reconstruction& reconstruction) {
  Point3DId next_id =
      reconstruction.points3D.empty() ? 1 : reconstruction.points3D.rbegin()->first + 1;
  size_t num_added = 0;
  for (const std::optional<LiftedPoint>& source : lifted.points) {
    if (!source) continue;
    Point3D point;
    point.xyz = source->xyz;
    std::vector<Point2D*> points2D;
    for (const TrackElement& element : source->track) {
      const auto image = reconstruction.images.find(element.image_id);
      if (image == reconstruction.images.end()) continue;
      VGTW_CHECK(element.point2D_idx < image->second.points2D.size(),
                 "image " + std::to_string(element.image_id) + " has no point2D " +
                     std::to_string(element.point2D_idx));
      Point2D& point2D = image->second.points2D[element.point2D_idx];
      if (point2D.HasPoint3D()) continue;
      point.track.push_back(element);
      points2D.push_back(&point2D);
    }
    if (point.track.size() < 2) continue;
    UpdatePointError(reconstruction, point);
    for (Point2D* point2D : points2D) point2D->point3D_id = next_id;
    reconstruction.points3D.emplace_hint(reconstruction.points3D.end(), next_id, std::move(point));
    ++next_id;
    ++num_added;
  }
  return num_added;
}

}  // namespace vgtw
