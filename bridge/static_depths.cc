// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/static_depths.h"

#include "scene/confidence_histogram.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/static_view.h"

#include <cstdint>
#include <mutex>
#include <string>

namespace vgtw {

void StaticDepthFilter::Check() const {
  VGTW_CHECK(keep_percent > 0.0 && keep_percent <= 100.0,
             "StaticDepthFilter::keep_percent = " + std::to_string(keep_percent) +
                 ", must be in (0, 100]");
  VGTW_CHECK(distractor_threshold > 0.0 && distractor_threshold <= 1.0,
             "StaticDepthFilter::distractor_threshold = " + std::to_string(distractor_threshold) +
                 ", must be in (0, 1]");
}

double PooledConfidenceThreshold(const PredictionReader& predictions,
                                 const std::vector<size_t>& view_idxs,
                                 double keep_percent,
                                 int num_threads) {
  constexpr double kAnyDistractorThreshold = 1.0;
  ConfidenceHistogram histogram;
  std::mutex mutex;
  ParallelFor(static_cast<int64_t>(view_idxs.size()), num_threads, [&](int64_t i) {
    ConfidenceHistogram of_view;
    StaticView(predictions.Load(view_idxs[static_cast<size_t>(i)]), kAnyDistractorThreshold)
        .AddConfidencesTo(of_view);
    const std::lock_guard lock(mutex);
    histogram.Add(of_view);
  });
  return histogram.ThresholdKeeping(keep_percent);
}

RgbImage ReadPhotoOf(const View& view, const std::filesystem::path& image_folder) {
  const std::filesystem::path path = image_folder / view.name;
  RgbImage photo = ReadRgbImage(path);
  if (static_cast<uint64_t>(photo.width()) != view.camera.width ||
      static_cast<uint64_t>(photo.height()) != view.camera.height) {
    Fail(path,
         std::to_string(photo.width()) + " x " + std::to_string(photo.height()) + " pixels",
         std::to_string(view.camera.width) + " x " + std::to_string(view.camera.height) +
             " as in the predictions",
         "give the photos that were predicted from");
  }
  return photo;
}

Rgb ColorAt(const RgbImage& photo, const Eigen::Vector2d& pixel_in_original) {
  constexpr Rgb kGray = {128, 128, 128};
  const double x = pixel_in_original.x();
  const double y = pixel_in_original.y();
  if (!(x >= 0.0 && y >= 0.0 && x < photo.width() && y < photo.height())) return kGray;
  return photo(static_cast<int>(x), static_cast<int>(y));
}

}  // namespace vgtw
