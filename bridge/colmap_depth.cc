// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_depth.h"

#include "bridge/colmap_model.h"
#include "bridge/undistorted_images.h"
#include "scene/depth_normals.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/parallel.h"
#include "scene/static_view.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

template <typename T, typename ValueOf>
void WriteMap(const fs::path& path, const Grid<T>& map, int num_channels, const ValueOf& value_of) {
  AtomicFile file(path);
  file.Write(std::to_string(map.width()) + "&" + std::to_string(map.height()) + "&" +
             std::to_string(num_channels) + "&");
  std::vector<float> row(static_cast<size_t>(map.width()));
  for (int channel = 0; channel < num_channels; ++channel) {
    for (int y = 0; y < map.height(); ++y) {
      for (int x = 0; x < map.width(); ++x) {
        row[static_cast<size_t>(x)] = value_of(map(x, y), channel);
      }
      file.Write(std::as_bytes(std::span(row)));
    }
  }
  file.Commit();
}

// A photo's depths where they are asked for.
struct PhotoDepths {
  StaticView view;
  Grid<Eigen::Vector3f> normals_in_cam;  // network pixels
  PixelMap network_from_original;
};

class DepthMapMaker {
 public:
  DepthMapMaker(const PredictionReader& predictions,
                const Reconstruction& model,
                const ColmapDepthOptions& options)
      : predictions_(predictions), model_(model), options_(options) {
    for (size_t i = 0; i < predictions.views().size(); ++i) {
      idx_by_name_[predictions.views()[i].name] = i;
    }
    for (const auto& [image_id, image] : model.images) image_by_name_[image.name] = &image;
    std::vector<size_t> all(predictions.views().size());
    std::iota(all.begin(), all.end(), size_t{0});
    confidence_threshold_ = PooledConfidenceThreshold(
        predictions, all, options.filter.keep_percent, options.num_threads);
  }

  // nullopt if the predictions have no map of depths of this photo.
  std::optional<PhotoDepths> Load(const std::string& name) const {
    const auto found = idx_by_name_.find(name);
    if (found == idx_by_name_.end()) return std::nullopt;
    ViewPrediction prediction = predictions_.Load(found->second);
    const View view = prediction.view;
    if (prediction.depth.empty()) prediction.depth = DepthFromPoints(view, prediction.points);
    if (prediction.depth.empty()) return std::nullopt;
    Grid<Eigen::Vector3f> normals;
    if (options_.with_normals) normals = NormalsFromDepth(view, prediction.depth);
    return PhotoDepths{StaticView(std::move(prediction), options_.filter.distractor_threshold),
                       std::move(normals),
                       Inverse(view.original_from_network)};
  }

  // Depth of each of the model's points over the depth predicted at its pixel, of one photo.
  std::vector<double> ScaleRatios(const UndistortedImage& image, const PhotoDepths& depths) const {
    const Image& of_model = *image_by_name_.at(image.name);
    std::vector<double> ratios;
    for (const Point2D& point2D : of_model.points2D) {
      if (!point2D.HasPoint3D()) continue;
      const Eigen::Vector3d point_in_cam =
          of_model.cam_from_world * model_.points3D.at(point2D.point3D_id).xyz;
      const auto pixel = Project(image.distorted, point_in_cam);
      if (!pixel) continue;
      if (const auto depth = DepthAt(depths, *pixel)) {
        ratios.push_back(point_in_cam.z() / *depth);
      }
    }
    return ratios;
  }

  // Depth map and, if wanted, normal map of an image.
  std::pair<DepthMap, Grid<Eigen::Vector3f>> Make(const UndistortedImage& image,
                                                  const PhotoDepths& depths,
                                                  double scale) const {
    const auto width = static_cast<int>(image.undistorted.width);
    const auto height = static_cast<int>(image.undistorted.height);
    DepthMap depth(width, height, std::numeric_limits<float>::quiet_NaN());
    Grid<Eigen::Vector3f> normals;
    if (options_.with_normals) normals = Grid<Eigen::Vector3f>(width, height);
    ParallelFor(height, options_.num_threads, [&](int64_t row) {
      const auto y = static_cast<int>(row);
      for (int x = 0; x < width; ++x) {
        const auto ray = Unproject(image.undistorted, {x + 0.5, y + 0.5});
        const auto pixel = ray ? Project(image.distorted, ray->homogeneous()) : std::nullopt;
        const auto z = pixel ? DepthAt(depths, *pixel) : std::nullopt;
        if (!z) continue;
        depth(x, y) = static_cast<float>(scale * *z);
        if (!options_.with_normals) continue;
        const Eigen::Vector2d in_network = Apply(depths.network_from_original, *pixel);
        normals(x, y) = depths.normals_in_cam(static_cast<int>(in_network.x()),
                                              static_cast<int>(in_network.y()));
      }
    });
    return {std::move(depth), std::move(normals)};
  }

 private:
  std::optional<double> DepthAt(const PhotoDepths& depths, const Eigen::Vector2d& pixel) const {
    const auto sample = depths.view.DepthAt(pixel);
    if (!sample || !(sample->confidence >= confidence_threshold_)) return std::nullopt;
    return sample->depth;
  }

  const PredictionReader& predictions_;
  const Reconstruction& model_;
  const ColmapDepthOptions& options_;
  std::map<std::string, size_t> idx_by_name_;
  std::map<std::string, const Image*> image_by_name_;
  double confidence_threshold_ = 0.0;
};

// Sets has_map and, where these are wanted, the scales.
std::vector<DepthMapSummary> Summarize(const std::vector<UndistortedImage>& images,
                                       const DepthMapMaker& maker,
                                       const ColmapDepthOptions& options) {
  std::vector<DepthMapSummary> summaries(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), options.num_threads, [&](int64_t i) {
    const UndistortedImage& image = images[static_cast<size_t>(i)];
    DepthMapSummary& summary = summaries[static_cast<size_t>(i)];
    summary.image_name = image.name;
    const auto depths = maker.Load(image.name);
    summary.has_map = depths.has_value();
    if (!depths || !options.rescale) return;
    const std::vector<double> ratios = maker.ScaleRatios(image, *depths);
    if (ratios.size() < kMinScalePoints) return;
    summary.scale = Median(ratios);
    summary.num_scale_points = ratios.size();
  });
  std::vector<double> scales;
  for (const DepthMapSummary& summary : summaries) {
    if (summary.num_scale_points > 0) scales.push_back(summary.scale);
  }
  if (scales.empty()) return summaries;
  const double common_scale = Median(scales);
  for (DepthMapSummary& summary : summaries) {
    if (summary.num_scale_points == 0) summary.scale = common_scale;
  }
  return summaries;
}

bool HoldsAFile(const fs::path& folder) {
  if (!fs::exists(folder)) return false;
  return std::ranges::any_of(
      fs::recursive_directory_iterator(folder),
      [](const fs::directory_entry& entry) { return !entry.is_directory(); });
}

// image_undistorter leaves empty folders, with sub-folders where images have them.
std::unique_ptr<AtomicFolder> MakeMapFolder(const fs::path& folder, bool overwrite) {
  return std::make_unique<AtomicFolder>(folder, overwrite || !HoldsAFile(folder));
}

fs::path MapPath(const fs::path& folder, const std::string& image_name) {
  fs::path path = folder / (image_name + ".geometric.bin");
  fs::create_directories(path.parent_path());
  return path;
}

void WriteFusionConfig(const fs::path& path, const std::vector<DepthMapSummary>& summaries) {
  if (fs::exists(path)) return;
  std::string names;
  for (const DepthMapSummary& summary : summaries) {
    if (summary.has_map) names += summary.image_name + "\n";
  }
  WriteFileAtomically(path, names);
}

}  // namespace

void WriteColmapDepthMap(const fs::path& path, const DepthMap& depth) {
  WriteMap(path, depth, 1, [](float z, int) { return std::isfinite(z) && z > 0.0f ? z : 0.0f; });
}

void WriteColmapNormalMap(const fs::path& path, const Grid<Eigen::Vector3f>& normals) {
  WriteMap(path, normals, 3, [](const Eigen::Vector3f& n, int channel) { return n[channel]; });
}

std::vector<DepthMapSummary> WriteColmapDepthMaps(const PredictionReader& predictions,
                                                  const fs::path& model_folder,
                                                  const fs::path& workspace_folder,
                                                  const ColmapDepthOptions& options,
                                                  const ProgressCallback& progress) {
  options.filter.Check();
  const bool is_workspace = fs::exists(workspace_folder / "sparse");
  const Reconstruction model = ReadModel(model_folder);
  const std::vector<UndistortedImage> images =
      FindUndistortedImages(model, model_folder, is_workspace ? workspace_folder : fs::path());
  const fs::path stereo = workspace_folder / "stereo";
  const auto depth_folder = MakeMapFolder(stereo / "depth_maps", options.overwrite);
  const auto normal_folder =
      options.with_normals ? MakeMapFolder(stereo / "normal_maps", options.overwrite) : nullptr;

  const DepthMapMaker maker(predictions, model, options);
  std::vector<DepthMapSummary> summaries = Summarize(images, maker, options);
  if (std::ranges::none_of(summaries, &DepthMapSummary::has_map)) {
    Fail(predictions.folder(),
         "has no depth map of an image of " + model_folder.string(),
         "predictions of the model's photos");
  }
  // One image at a time, its rows in parallel: maps of large photos take 200 MB.
  for (size_t i = 0; i < images.size(); ++i) {
    DepthMapSummary& summary = summaries[i];
    if (summary.has_map) {
      const auto [depth, normals] =
          maker.Make(images[i], *maker.Load(summary.image_name), summary.scale);
      const auto num_known =
          std::ranges::count_if(depth.data(), [](float z) { return std::isfinite(z); });
      summary.known_share = static_cast<double>(num_known) / static_cast<double>(depth.size());
      WriteColmapDepthMap(MapPath(depth_folder->path(), summary.image_name), depth);
      if (normal_folder) {
        WriteColmapNormalMap(MapPath(normal_folder->path(), summary.image_name), normals);
      }
    }
    if (progress) progress(static_cast<int64_t>(i + 1), static_cast<int64_t>(images.size()));
  }
  depth_folder->Commit();
  if (normal_folder) normal_folder->Commit();
  WriteFusionConfig(stereo / "fusion.cfg", summaries);
  return summaries;
}

}  // namespace vgtw
