// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/export_points.h"

#include "bridge/voxel_means.h"
#include "scene/depth_normals.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/static_view.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

namespace vgtw {
namespace {

// nullopt if nothing is to be thinned: 0 was asked for, or all cameras are at one place.
std::optional<VoxelMeans> MakeVoxels(const std::vector<Eigen::Vector3d>& camera_centres,
                                     double voxel_size) {
  const double edge = voxel_size > 0.0 ? voxel_size * Diameter(camera_centres) : 0.0;
  return edge > 0.0 ? std::optional<VoxelMeans>(edge) : std::nullopt;
}

class PointExporter {
 public:
  PointExporter(const PredictionReader& predictions, const ExportPointsOptions& options)
      : predictions_(predictions), options_(options) {
    std::vector<size_t> all(predictions.views().size());
    std::iota(all.begin(), all.end(), size_t{0});
    confidence_threshold_ = PooledConfidenceThreshold(
        predictions, all, options.filter.keep_percent, options.num_threads);
  }

  SurfaceCloud Make(const ProgressCallback& progress) {
    std::optional<VoxelMeans> means = MakeVoxels(CameraCentres(), options_.voxel_size);
    SurfaceCloud cloud;
    const size_t num_views = predictions_.views().size();
    const auto num_threads = static_cast<size_t>(ResolveThreads(options_.num_threads));
    for (size_t first = 0; first < num_views; first += num_threads) {
      std::vector<ViewCloud> parts(std::min(num_threads, num_views - first));
      ParallelFor(static_cast<int64_t>(parts.size()), options_.num_threads, [&](int64_t i) {
        parts[static_cast<size_t>(i)] = CloudOfView(first + static_cast<size_t>(i));
      });
      for (const ViewCloud& part : parts) {
        has_normals_ |= part.has_normals;
        has_confidence_ |= part.has_confidence;
        if (means) {
          means->Add(part.cloud);
        } else {
          Append(part.cloud, cloud);
        }
      }
      if (progress) {
        progress(static_cast<int64_t>(first + parts.size()), static_cast<int64_t>(num_views));
      }
    }
    if (means) cloud = means->Means();
    if (!has_normals_) cloud.normals.clear();
    if (!has_confidence_) cloud.scalars.clear();
    return cloud;
  }

 private:
  // Has all lists, so that clouds of views can be joined; those of which nothing is known hold
  // zeros and ones.
  struct ViewCloud {
    SurfaceCloud cloud;
    bool has_normals = false;
    bool has_confidence = false;
  };

  std::vector<Eigen::Vector3d> CameraCentres() const {
    std::vector<Eigen::Vector3d> centres;
    for (const View& view : predictions_.views()) {
      centres.push_back(OriginInSource(view.cam_from_world));
    }
    return centres;
  }

  ViewCloud CloudOfView(size_t idx) const {
    ViewPrediction prediction = predictions_.Load(idx);
    const View view = prediction.view;
    if (prediction.depth.empty()) prediction.depth = DepthFromPoints(view, prediction.points);
    const Grid<Eigen::Vector3f> normals_in_cam = NormalsFromDepth(view, prediction.depth);
    const PixelMap network_from_original = Inverse(view.original_from_network);
    const Eigen::Matrix3f world_from_cam =
        view.cam_from_world.rotation.conjugate().toRotationMatrix().cast<float>();
    ViewCloud result;
    result.has_normals = !prediction.depth.empty();
    result.has_confidence = !prediction.depth_conf.empty() || !prediction.depth_samples.empty();
    RgbImage photo;
    if (!options_.image_folder.empty()) photo = ReadPhotoOf(view, options_.image_folder);
    CloudScalar confidence{"confidence", {}};
    const StaticView static_view(std::move(prediction), options_.filter.distractor_threshold);
    for (const StaticView::Point& point : static_view.StaticPoints(confidence_threshold_)) {
      result.cloud.points.push_back(
          {point.xyz.cast<float>(), ColorAt(photo, point.pixel_in_original)});
      const Eigen::Vector2d pixel = Apply(network_from_original, point.pixel_in_original);
      result.cloud.normals.push_back(
          result.has_normals
              ? Eigen::Vector3f(world_from_cam * normals_in_cam(static_cast<int>(pixel.x()),
                                                                static_cast<int>(pixel.y())))
              : Eigen::Vector3f::Zero());
      confidence.values.push_back(point.confidence);
    }
    result.cloud.scalars.push_back(std::move(confidence));
    return result;
  }

  const PredictionReader& predictions_;
  const ExportPointsOptions& options_;
  double confidence_threshold_ = 0.0;
  bool has_normals_ = false;
  bool has_confidence_ = false;
};

}  // namespace

void ExportPointsOptions::Check() const {
  filter.Check();
  VGTW_CHECK(voxel_size >= 0.0,
             "ExportPointsOptions::voxel_size = " + std::to_string(voxel_size) + ", must be >= 0");
}

SurfaceCloud PointsOfPredictions(const PredictionReader& predictions,
                                 const ExportPointsOptions& options,
                                 const ProgressCallback& progress) {
  options.Check();
  SurfaceCloud cloud = PointExporter(predictions, options).Make(progress);
  if (cloud.points.empty()) {
    Fail(predictions.folder(),
         "has no static depth that is confident enough",
         "points",
         "raise --keep_percent or --mask_threshold");
  }
  return cloud;
}

SurfaceCloud PointsOfModel(const Reconstruction& model, double voxel_size) {
  SurfaceCloud cloud;
  cloud.points = PointsOf(model);
  CloudScalar error{"error", {}};
  CloudScalar track_length{"track_length", {}};
  for (const auto& [point3D_id, point] : model.points3D) {
    error.values.push_back(static_cast<float>(point.error));
    track_length.values.push_back(static_cast<float>(point.track.size()));
  }
  cloud.scalars = {std::move(error), std::move(track_length)};
  std::vector<Eigen::Vector3d> centres;
  for (const auto& [image_id, image] : model.images) {
    centres.push_back(OriginInSource(image.cam_from_world));
  }
  std::optional<VoxelMeans> means = MakeVoxels(centres, voxel_size);
  if (!means) return cloud;
  means->Add(cloud);
  return means->Means();
}

}  // namespace vgtw
