// SPDX-License-Identifier: BSD-3-Clause
#include "refine/triangulation.h"

#include "refine/ray_point.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/reprojection.h"
#include "scene/triangulation_angle.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

namespace vgtw {
namespace {

// The robust estimate begins to doubt an observation at this share of its limit.
constexpr double kScaleShare = 0.5;

struct TrackRay {
  TrackElement element;
  PixelRay ray;
};

const Image& FindImage(const Reconstruction& model, const TrackElement& element) {
  const auto found = model.images.find(element.image_id);
  VGTW_CHECK(found != model.images.end() && element.point2D_idx < found->second.points2D.size(),
             "a track names keypoint " + std::to_string(element.point2D_idx) + " of image " +
                 std::to_string(element.image_id) + ", which the model lacks");
  return found->second;
}

// Rays whose errors are 1 at their limits.
std::vector<TrackRay> RaysOf(const TriangulationOptions& options,
                             const Reconstruction& model,
                             const Track& track) {
  std::vector<TrackRay> rays;
  rays.reserve(track.size());
  for (const TrackElement& element : track) {
    const Image& image = FindImage(model, element);
    auto ray = MakePixelRay(model.cameras.at(image.camera_id),
                            image.cam_from_world,
                            image.points2D[element.point2D_idx].xy);
    if (!ray) continue;
    ray->pixel_from_x /= options.MaxErrorPx(element.image_id);
    rays.push_back({element, *ray});
  }
  return rays;
}

// Of the points that the model has for these observations the one with the most, if any.
const Point3D* FindOldPoint(const Reconstruction& model, const std::vector<TrackRay>& rays) {
  const Point3D* best = nullptr;
  for (const TrackRay& ray : rays) {
    const Point3DId id =
        model.images.at(ray.element.image_id).points2D[ray.element.point2D_idx].point3D_id;
    if (id == kInvalidPoint3DId) continue;
    const Point3D& point = model.points3D.at(id);
    if (!best || point.track.size() > best->track.size()) best = &point;
  }
  return best;
}

std::vector<const PixelRay*> Pointers(const std::vector<TrackRay>& rays) {
  std::vector<const PixelRay*> pointers;
  pointers.reserve(rays.size());
  for (const TrackRay& ray : rays) pointers.push_back(&ray.ray);
  return pointers;
}

// Moves what the point explains, the best keypoint of each image, out of `rays`.
std::vector<TrackRay> TakeInliers(const Eigen::Vector3d& xyz, std::vector<TrackRay>& rays) {
  std::vector<TrackRay> inliers;
  std::vector<TrackRay> rest;
  for (const TrackRay& ray : rays) {
    const double error = ErrorPx(ray.ray, xyz);
    if (error > 1.0) {
      rest.push_back(ray);
      continue;
    }
    const auto twin = std::find_if(inliers.begin(), inliers.end(), [&](const TrackRay& other) {
      return other.element.image_id == ray.element.image_id;
    });
    if (twin == inliers.end()) {
      inliers.push_back(ray);
    } else if (error < ErrorPx(twin->ray, xyz)) {
      rest.push_back(std::exchange(*twin, ray));
    } else {
      rest.push_back(ray);
    }
  }
  rays = std::move(rest);
  return inliers;
}

double AngleDeg(const std::vector<TrackRay>& rays, const Eigen::Vector3d& xyz, double enough_deg) {
  std::vector<Eigen::Vector3d> centres;
  centres.reserve(rays.size());
  for (const TrackRay& ray : rays) centres.push_back(ray.ray.centre);
  return TriangulationAngleDeg(centres, xyz, enough_deg);
}

std::vector<Point3D> TriangulateTrack(const TriangulationOptions& options,
                                      const Reconstruction& model,
                                      const Track& track) {
  std::vector<Point3D> points;
  std::vector<TrackRay> rays = RaysOf(options, model, track);
  const Point3D* old = FindOldPoint(model, rays);
  std::optional<Eigen::Vector3d> start;
  if (old) start = old->xyz;
  while (rays.size() >= 2) {
    const auto xyz = EstimateRayPoint(Pointers(rays), kScaleShare, start);
    if (!xyz) break;
    const std::vector<TrackRay> inliers = TakeInliers(*xyz, rays);
    if (inliers.size() < 2) break;
    start.reset();
    if (AngleDeg(inliers, *xyz, options.min_angle_deg) < options.min_angle_deg) continue;
    Point3D point;
    point.xyz = *xyz;
    if (old) point.rgb = old->rgb;
    for (const TrackRay& ray : inliers) point.track.push_back(ray.element);
    points.push_back(std::move(point));
  }
  return points;
}

void ReplacePoints(std::vector<std::vector<Point3D>> points_by_track, Reconstruction& model) {
  model.points3D.clear();
  for (auto& [id, image] : model.images) {
    for (Point2D& point2D : image.points2D) point2D.point3D_id = kInvalidPoint3DId;
  }
  Point3DId next_id = 1;
  for (std::vector<Point3D>& points : points_by_track) {
    for (Point3D& point : points) {
      for (const TrackElement& element : point.track) {
        Point2D& point2D = model.images.at(element.image_id).points2D[element.point2D_idx];
        VGTW_CHECK(!point2D.HasPoint3D(),
                   "two tracks name keypoint " + std::to_string(element.point2D_idx) +
                       " of image " + std::to_string(element.image_id));
        point2D.point3D_id = next_id;
      }
      UpdatePointError(model, point);
      model.points3D.emplace(next_id++, std::move(point));
    }
  }
}

}  // namespace

double TriangulationOptions::MaxErrorPx(ImageId image_id) const {
  const auto found = max_error_px_by_image.find(image_id);
  return found == max_error_px_by_image.end() ? max_error_px : found->second;
}

void TriangulationOptions::Check() const {
  const auto check_limit = [](double limit_px) {
    VGTW_CHECK(
        limit_px > 0.0,
        "TriangulationOptions::max_error_px = " + std::to_string(limit_px) + ", must be > 0");
  };
  check_limit(max_error_px);
  for (const auto& [image_id, limit_px] : max_error_px_by_image) check_limit(limit_px);
  VGTW_CHECK(min_angle_deg >= 0.0 && min_angle_deg < 90.0,
             "TriangulationOptions::min_angle_deg = " + std::to_string(min_angle_deg) +
                 ", must be in [0, 90)");
}

TriangulationSummary TriangulateTracks(const TriangulationOptions& options,
                                       const std::vector<Track>& tracks,
                                       Reconstruction& model) {
  options.Check();
  // Tracks are short: handed out in pieces, the threads have more to do than to ask for work.
  constexpr size_t kTracksPerPiece = 256;
  std::vector<std::vector<Point3D>> points_by_track(tracks.size());
  const size_t num_pieces = (tracks.size() + kTracksPerPiece - 1) / kTracksPerPiece;
  ParallelFor(static_cast<int64_t>(num_pieces), options.num_threads, [&](int64_t piece) {
    const size_t begin = static_cast<size_t>(piece) * kTracksPerPiece;
    const size_t end = std::min(begin + kTracksPerPiece, tracks.size());
    for (size_t i = begin; i < end; ++i) {
      points_by_track[i] = TriangulateTrack(options, model, tracks[i]);
    }
  });
  ReplacePoints(std::move(points_by_track), model);
  TriangulationSummary summary;
  summary.num_tracks = tracks.size();
  summary.num_points3D = model.points3D.size();
  for (const auto& [id, point] : model.points3D) summary.num_observations += point.track.size();
  return summary;
}

std::vector<Track> TracksOf(const Reconstruction& model) {
  std::vector<Track> tracks;
  tracks.reserve(model.points3D.size());
  for (const auto& [id, point] : model.points3D) tracks.push_back(point.track);
  return tracks;
}

}  // namespace vgtw
