// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_files.h"
#include "bridge/training_folders.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cmath>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr int kPatchPx = 14;
constexpr int kMaxSidePx = 4096;
// As the trainer labels patches, see docs/training.md.
constexpr double kDistractorAbove = 0.5;
constexpr double kStaticBelow = 0.1;
// What sums of parts of pixels may be off: exactly half is not more than half.
constexpr double kRounding = 1e-9;

struct ViewStats {
  bool is_view = false;
  ImageSize size;
  double share = 0.0;
  uint64_t num_distractor = 0, num_static = 0, num_mixed = 0;  // patches
};

struct Interval {
  double begin = 0.0;
  double end = 0.0;

  // Length of the pixel that the interval covers.
  double Covers(int pixel) const {
    return std::max(0.0, std::min(end, pixel + 1.0) - std::max(begin, static_cast<double>(pixel)));
  }
  int FirstPixel() const { return static_cast<int>(std::floor(begin)); }
  int EndPixel(int size) const { return std::min(size, static_cast<int>(std::ceil(end))); }
};

// The idx-th of `num` equal parts of `length` in the middle of `size` pixels.
Interval PartOf(int size, double length, int num, int idx) {
  const double begin = (size - length) / 2.0;
  return {begin + length * idx / num, begin + length * (idx + 1) / num};
}

double DistractorShare(const StaticMask& static_mask, const Interval& x, const Interval& y) {
  const int x_end = x.EndPixel(static_mask.width());
  const int y_end = y.EndPixel(static_mask.height());
  double area = 0.0;
  for (int row = y.FirstPixel(); row < y_end; ++row) {
    double length = 0.0;
    for (int column = x.FirstPixel(); column < x_end; ++column) {
      if (static_mask(column, row) == 0) length += x.Covers(column);
    }
    area += length * y.Covers(row);
  }
  return area / ((x.end - x.begin) * (y.end - y.begin));
}

void CountPatches(const StaticMask& static_mask,
                  const TrainingFolderOptions& options,
                  ViewStats& view) {
  const double aspect = static_cast<double>(options.width) / options.height;
  const double width =
      std::min(static_cast<double>(static_mask.width()), static_mask.height() * aspect);
  const double height = std::min(static_cast<double>(static_mask.height()), width / aspect);
  const int num_columns = options.width / kPatchPx;
  const int num_rows = options.height / kPatchPx;
  for (int row = 0; row < num_rows; ++row) {
    const Interval y = PartOf(static_mask.height(), height, num_rows, row);
    for (int column = 0; column < num_columns; ++column) {
      const Interval x = PartOf(static_mask.width(), width, num_columns, column);
      const double share = DistractorShare(static_mask, x, y);
      if (share > kDistractorAbove + kRounding) {
        ++view.num_distractor;
      } else if (share < kStaticBelow - kRounding) {
        ++view.num_static;
      } else {
        ++view.num_mixed;
      }
    }
  }
}

ViewStats MeasureView(const TrainingScene& scene,
                      const std::string& name,
                      const TrainingFolderOptions& options) {
  const fs::path mask = MaskPath(scene.mask_path, name);
  ViewStats view;
  StaticMask static_mask;
  if (!fs::exists(mask)) return view;
  try {
    view.size = ReadImageSize(scene.image_path / name);
    static_mask = ReadMaskOfSize(mask, view.size);
  } catch (const Error&) {  // CheckTrainingScenes says why
    return view;
  }
  view.is_view = true;
  view.share = ExcludedShare(static_mask);
  CountPatches(static_mask, options, view);
  return view;
}

void CountSize(const ImageSize& size, std::vector<std::pair<ImageSize, size_t>>& sizes) {
  const auto found = std::find_if(
      sizes.begin(), sizes.end(), [&](const auto& entry) { return entry.first == size; });
  if (found == sizes.end()) {
    sizes.emplace_back(size, 1);
  } else {
    ++found->second;
  }
}

TrainingStats Summarise(const std::vector<ViewStats>& views) {
  TrainingStats stats;
  stats.num_photos = views.size();
  double sum = 0.0;
  for (const ViewStats& view : views) {
    if (!view.is_view) continue;
    ++stats.num_views;
    CountSize(view.size, stats.sizes);
    sum += view.share;
    stats.min_share = std::fmin(stats.min_share, view.share);
    stats.max_share = std::fmax(stats.max_share, view.share);
    stats.num_without_distractor += view.share == 0.0 ? 1 : 0;
    stats.num_distractor_patches += view.num_distractor;
    stats.num_static_patches += view.num_static;
    stats.num_mixed_patches += view.num_mixed;
  }
  if (stats.num_views > 0) stats.mean_share = sum / static_cast<double>(stats.num_views);
  std::stable_sort(stats.sizes.begin(), stats.sizes.end(), [](const auto& a, const auto& b) {
    return a.second > b.second;
  });
  return stats;
}

}  // namespace

void TrainingFolderOptions::Check() const {
  const auto check = [](const char* field, int value) {
    VGTW_CHECK(value >= kPatchPx && value <= kMaxSidePx && value % kPatchPx == 0,
               std::string(field) + " = " + std::to_string(value) +
                   ", must be a multiple of 14 in [14, 4096]");
  };
  check("width", width);
  check("height", height);
}

TrainingFolderStats ComputeTrainingStats(const std::vector<TrainingScene>& scenes,
                                         const TrainingFolderOptions& options,
                                         const ProgressCallback& progress) {
  options.Check();
  struct Photo {
    size_t scene_idx;
    std::string name;
  };
  std::vector<Photo> photos;
  for (size_t i = 0; i < scenes.size(); ++i) {
    for (std::string& name : ListImages(scenes[i].image_path)) {
      photos.push_back({i, std::move(name)});
    }
  }
  std::vector<ViewStats> views(photos.size());
  const auto measure = [&](int64_t i) {
    const Photo& photo = photos[static_cast<size_t>(i)];
    views[static_cast<size_t>(i)] = MeasureView(scenes[photo.scene_idx], photo.name, options);
  };
  ParallelFor(static_cast<int64_t>(photos.size()), options.num_threads, measure, progress);
  TrainingFolderStats result;
  for (size_t i = 0; i < scenes.size(); ++i) {
    std::vector<ViewStats> of_scene;
    for (size_t k = 0; k < photos.size(); ++k) {
      if (photos[k].scene_idx == i) of_scene.push_back(views[k]);
    }
    result.scenes.push_back({scenes[i], Summarise(of_scene)});
  }
  result.total = Summarise(views);
  return result;
}

}  // namespace vgtw
