// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/seed_points.h"

#include "bridge/point_cloud.h"
#include "bridge/static_depths.h"
#include "bridge/voxel_grid.h"
#include "scene/image_io.h"
#include "scene/parallel.h"
#include "scene/static_view.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace vgtw {
namespace {

// Points while they are merged: floats in units of the voxels' edge around the cameras, so that
// neither large world coordinates nor the size of the scene cost precision.
struct MergeFrame {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double unit = 1.0;
  bool has_voxels = false;  // else the unit is the scene's

  Eigen::Vector3f FromWorld(const Eigen::Vector3d& xyz) const {
    return ((xyz - origin) / unit).cast<float>();
  }
  Eigen::Vector3d ToWorld(const Eigen::Vector3f& xyz) const {
    return origin + unit * xyz.cast<double>();
  }
};

MergeFrame MakeMergeFrame(const Reconstruction& reconstruction, double voxel_size) {
  std::vector<Eigen::Vector3d> centres;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& [image_id, image] : reconstruction.images) {
    centres.push_back(OriginInSource(image.cam_from_world));
    sum += centres.back();
  }
  const double edge = voxel_size * Diameter(centres);
  return {sum / static_cast<double>(centres.size()), edge > 0.0 ? edge : 1.0, edge > 0.0};
}

class SeedPointMaker {
 public:
  SeedPointMaker(const PredictionReader& predictions,
                 const std::vector<SeedView>& views,
                 const SeedOptions& options,
                 Reconstruction& reconstruction)
      : predictions_(predictions),
        views_(views),
        options_(options),
        reconstruction_(reconstruction),
        frame_(MakeMergeFrame(reconstruction, options.voxel_size)) {}

  // Views enter in their order and merges depend on sizes only, so the number of threads does not
  // change the result.
  std::vector<ColoredPoint> MergePoints(double confidence_threshold) const {
    std::vector<ColoredPoint> merged;
    size_t size_after_merge = 0;
    const auto num_threads = static_cast<size_t>(ResolveThreads(options_.num_threads));
    for (size_t first = 0; first < views_.size(); first += num_threads) {
      std::vector<std::vector<ColoredPoint>> clouds(std::min(num_threads, views_.size() - first));
      ParallelFor(static_cast<int64_t>(clouds.size()), options_.num_threads, [&](int64_t i) {
        clouds[static_cast<size_t>(i)] =
            ColorPoints(first + static_cast<size_t>(i), confidence_threshold);
      });
      for (const std::vector<ColoredPoint>& cloud : clouds) {
        merged.insert(merged.end(), cloud.begin(), cloud.end());
        if (!frame_.has_voxels || merged.size() < 2 * size_after_merge) continue;
        merged = MergeInVoxels(merged);
        size_after_merge = merged.size();
      }
    }
    return frame_.has_voxels ? MergeInVoxels(merged) : merged;
  }

  // Gives every point that enough views see to the reconstruction.
  void AddObserved(const std::vector<ColoredPoint>& points) {
    std::vector<std::vector<Sighting>> sightings(views_.size());
    ForEachView([&](size_t i) { sightings[i] = FindSightings(i, points); });
    std::vector<int> num_views(points.size(), 0);
    for (const std::vector<Sighting>& of_view : sightings) {
      for (const Sighting& sighting : of_view) ++num_views[sighting.point_idx];
    }
    std::vector<Point3DId> ids(points.size(), kInvalidPoint3DId);
    Point3DId next_id = 1;
    for (size_t i = 0; i < points.size(); ++i) {
      if (num_views[i] < options_.min_track_length) continue;
      ids[i] = next_id++;
      Point3D& point = reconstruction_.points3D[ids[i]];
      point.xyz = frame_.ToWorld(points[i].xyz);
      point.rgb = points[i].rgb;
      point.track.reserve(static_cast<size_t>(num_views[i]));
    }
    for (size_t i = 0; i < views_.size(); ++i) {
      Image& image = reconstruction_.images.at(views_[i].image_id);
      for (const Sighting& sighting : sightings[i]) {
        const Point3DId id = ids[sighting.point_idx];
        if (id == kInvalidPoint3DId) continue;
        reconstruction_.points3D.at(id).track.push_back(
            {image.image_id, static_cast<uint32_t>(image.points2D.size())});
        image.points2D.push_back({sighting.pixel.cast<double>(), id});
      }
    }
  }

 private:
  struct Sighting {
    uint32_t point_idx = 0;
    Eigen::Vector2f pixel;
  };

  template <typename Work>
  void ForEachView(const Work& work) const {
    ParallelFor(static_cast<int64_t>(views_.size()), options_.num_threads, [&](int64_t i) {
      work(static_cast<size_t>(i));
    });
  }

  const Camera& CameraOf(size_t i) const {
    return reconstruction_.cameras.at(reconstruction_.images.at(views_[i].image_id).camera_id);
  }

  // With the intrinsics of the seed, so that points project onto the pixels that they came from.
  StaticView Load(size_t i) const {
    ViewPrediction prediction = predictions_.Load(views_[i].view_idx);
    prediction.view.camera = CameraOf(i);
    return StaticView(std::move(prediction), options_.distractor_threshold);
  }

  std::vector<ColoredPoint> ColorPoints(size_t i, double confidence_threshold) const {
    std::vector<ColoredPoint> colored;
    RgbImage photo;
    if (!options_.image_folder.empty()) {
      photo = ReadPhotoOf(predictions_.views()[views_[i].view_idx], options_.image_folder);
    }
    for (const StaticView::Point& point : Load(i).StaticPoints(confidence_threshold)) {
      colored.push_back({frame_.FromWorld(point.xyz), ColorAt(photo, point.pixel_in_original)});
    }
    return frame_.has_voxels ? MergeInVoxels(colored) : colored;
  }

  std::vector<Sighting> FindSightings(size_t i, const std::vector<ColoredPoint>& points) const {
    const StaticView view = Load(i);
    std::vector<Sighting> sightings;
    for (size_t k = 0; k < points.size(); ++k) {
      const auto pixel =
          view.See(frame_.ToWorld(points[k].xyz), options_.max_relative_depth_difference);
      if (pixel) sightings.push_back({static_cast<uint32_t>(k), pixel->cast<float>()});
    }
    return sightings;
  }

  const PredictionReader& predictions_;
  const std::vector<SeedView>& views_;
  const SeedOptions& options_;
  Reconstruction& reconstruction_;
  MergeFrame frame_;
};

}  // namespace

void AddSeedPoints(const PredictionReader& predictions,
                   const std::vector<SeedView>& views,
                   const SeedOptions& options,
                   Reconstruction& reconstruction,
                   SeedSummary& summary) {
  SeedPointMaker maker(predictions, views, options, reconstruction);
  std::vector<size_t> view_idxs;
  for (const SeedView& view : views) view_idxs.push_back(view.view_idx);
  summary.confidence_threshold =
      PooledConfidenceThreshold(predictions, view_idxs, options.keep_percent, options.num_threads);
  maker.AddObserved(maker.MergePoints(summary.confidence_threshold));
  size_t num_observations = 0;
  for (const auto& [id, point] : reconstruction.points3D) num_observations += point.track.size();
  summary.num_points3D = reconstruction.points3D.size();
  if (summary.num_points3D > 0) {
    summary.mean_track_length =
        static_cast<double>(num_observations) / static_cast<double>(summary.num_points3D);
  }
}

}  // namespace vgtw
