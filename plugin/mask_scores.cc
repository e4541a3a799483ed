// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/mask_scores.h"

#include "bridge/colmap_database.h"
#include "bridge/mask_convert.h"
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// May be called by several threads at once.
using MaskSource = std::function<StaticMask(const std::string& name, const ImageSize& size)>;
using FeatureSource = std::function<std::vector<Eigen::Vector2d>(const std::string& name)>;

ImageSize SizeOf(const StaticMask& mask) {
  return {static_cast<uint64_t>(mask.width()), static_cast<uint64_t>(mask.height())};
}

std::vector<std::string> NamesOfMasks(const fs::path& mask_folder) {
  constexpr std::string_view kExtension = ".png";
  std::vector<std::string> names;
  for (std::string& file : ListImages(mask_folder)) {
    if (!file.ends_with(kExtension) || file.size() == kExtension.size()) {
      Fail(mask_folder / file, "is not named as a mask", "<image name>.png");
    }
    file.resize(file.size() - kExtension.size());
    names.push_back(std::move(file));
  }
  return names;
}

MaskSource FromFolder(const fs::path& folder) {
  return [folder](const std::string& name, const ImageSize& size) {
    const fs::path path = MaskPath(folder, name);
    if (fs::exists(path)) return ReadMaskOfSize(path, size);
    return StaticMask(static_cast<int>(size.width), static_cast<int>(size.height), 255);
  };
}

MaskSource FromPredictions(const fs::path& folder, double threshold) {
  const StaticMaskOptions options{.threshold = threshold, .dilate_px = 0};
  options.Check();
  const auto reader = std::make_shared<PredictionReader>(folder);
  std::map<std::string, size_t> idx_by_name;
  for (size_t i = 0; i < reader->views().size(); ++i) idx_by_name[reader->views()[i].name] = i;
  return [=](const std::string& name, const ImageSize& size) {
    const auto found = idx_by_name.find(name);
    if (found == idx_by_name.end()) {
      Fail(folder, "has no view " + Printable(name), "every image that has a true mask");
    }
    const ViewPrediction prediction = reader->Load(found->second);
    CheckSize(folder / name,
              {prediction.view.camera.width, prediction.view.camera.height},
              size,
              "the size of its true mask",
              "");
    if (prediction.distractor.empty()) {
      Fail(folder, "has no distractor probability for " + Printable(name), "one per view");
    }
    return MakeStaticMask(prediction.view, prediction.distractor, options);
  };
}

FeatureSource FromDatabase(const fs::path& path) {
  if (path.empty()) return [](const std::string&) { return std::vector<Eigen::Vector2d>(); };
  const auto database = std::make_shared<ColmapDatabase>(path, ColmapDatabase::Mode::kReadOnly);
  const auto mutex = std::make_shared<std::mutex>();
  std::map<std::string, ImageId> id_by_name;
  for (const DatabaseImage& image : database->ReadImages()) id_by_name[image.name] = image.image_id;
  return [=](const std::string& name) {
    const auto found = id_by_name.find(name);
    if (found == id_by_name.end()) {
      Fail(path, "has no image " + Printable(name), "every image that has a true mask");
    }
    const std::lock_guard lock(*mutex);
    const std::optional<Keypoints> keypoints = database->ReadKeypoints(found->second);
    std::vector<Eigen::Vector2d> features;
    for (size_t i = 0; keypoints && i < keypoints->rows; ++i) {
      features.emplace_back(keypoints->x(i), keypoints->y(i));
    }
    return features;
  };
}

// What the scored images are, and their true masks.
struct TrueMasks {
  std::vector<std::string> names;
  std::function<StaticMask(size_t idx)> mask;  // may be called by several threads at once
};

TrueMasks InFolder(const MaskScoresOptions& options) {
  TrueMasks truth;
  truth.names = NamesOfMasks(options.reference_mask_path);
  truth.mask = [&options, names = truth.names](size_t idx) {
    const fs::path path = MaskPath(options.reference_mask_path, names[idx]);
    if (options.image_path.empty()) return ReadStaticMask(path);
    return ReadMaskOfSize(path, ReadImageSize(options.image_path / names[idx]));
  };
  return truth;
}

TrueMasks OfImages(const MaskScoresOptions& options) {
  VGTW_CHECK(!options.image_path.empty(), "image_path belongs to image_names");
  const MaskConvention& convention = GetMaskConvention(options.reference_convention);
  const auto found = FindMasks(convention, options.reference_mask_path, options.image_names);
  TrueMasks truth;
  std::vector<std::vector<fs::path>> files;
  for (size_t i = 0; i < found.size(); ++i) {
    if (found[i].empty()) continue;
    truth.names.push_back(options.image_names[i]);
    files.push_back(found[i]);
  }
  if (files.empty()) {
    Fail(options.reference_mask_path,
         "has a true mask of none of " + std::to_string(options.image_names.size()) + " images",
         "masks named as " + std::string(convention.tool) + " names them");
  }
  truth.mask = [&options, &convention, names = truth.names, files](size_t idx) {
    const fs::path photo = options.image_path / names[idx];
    return ReadMaskIn(convention, files[idx], photo, ReadImageSize(photo));
  };
  return truth;
}

}  // namespace

std::vector<ImageMaskScore> ScoreMasks(const MaskScoresOptions& options,
                                       const ProgressCallback& progress) {
  const TrueMasks true_masks = options.image_names.empty() ? InFolder(options) : OfImages(options);
  const std::vector<std::string>& names = true_masks.names;
  if (options.predictions_path.empty()) {
    CheckMasksExist(options.mask_path, names, options.allow_missing_masks);
  }
  const MaskSource predicted = options.predictions_path.empty()
                                   ? FromFolder(options.mask_path)
                                   : FromPredictions(options.predictions_path, options.threshold);
  const FeatureSource features = FromDatabase(options.database_path);
  std::vector<ImageMaskScore> scores(names.size());
  const auto score_image = [&](int64_t i) {
    const std::string& name = names[static_cast<size_t>(i)];
    const StaticMask truth = true_masks.mask(static_cast<size_t>(i));
    const double tolerance_px = options.tolerance_px != 0.0
                                    ? options.tolerance_px
                                    : DefaultBoundaryTolerancePx(truth.width(), truth.height());
    scores[static_cast<size_t>(i)] = {
        name, ScoreMask(predicted(name, SizeOf(truth)), truth, tolerance_px, features(name))};
  };
  ParallelFor(static_cast<int64_t>(names.size()), options.num_threads, score_image, progress);
  return scores;
}

}  // namespace vgtw
