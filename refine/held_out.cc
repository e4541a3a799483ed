// SPDX-License-Identifier: BSD-3-Clause
#include "refine/held_out.h"

#include "refine/ray_point.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/random.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace vgtw {
namespace {

// Odd, so that seeds differ in all bits.
constexpr uint64_t kSeedSpread = 0x9e3779b97f4a7c15;

struct Mean {
  size_t num = 0;
  double sum = 0.0;
  double sum_of_squares = 0.0;

  void Add(double value) {
    ++num;
    sum += value;
    sum_of_squares += value * value;
  }
  double Value() const { return sum / static_cast<double>(num); }
  double StandardError() const {
    const auto n = static_cast<double>(num);
    return std::sqrt(std::max(sum_of_squares / n - Value() * Value(), 0.0) /
                     std::max(n - 1.0, 1.0));
  }
};

}  // namespace

SplitTracks HoldOutTracks(const std::vector<Track>& tracks, double percent, uint64_t seed) {
  VGTW_CHECK(percent >= 0.0 && percent < 100.0,
             "share of tracks held out = " + std::to_string(percent) + " %, must be in [0, 100)");
  SplitTracks split;
  for (const Track& track : tracks) {
    if (track.empty()) continue;
    const uint64_t key = (uint64_t{track.front().image_id} << 32) | track.front().point2D_idx;
    const bool is_held_out = 100.0 * RandomStream(key ^ (seed * kSeedSpread)).Uniform() < percent;
    (is_held_out ? split.held_out : split.adjusted).push_back(track);
  }
  return split;
}

HeldOutJudge::HeldOutJudge(std::vector<Track> tracks,
                           double scale_px,
                           double max_error_px,
                           int num_threads)
    : tracks_(std::move(tracks)),
      scale_px_(scale_px),
      max_error_px_(max_error_px),
      num_threads_(num_threads) {
  VGTW_CHECK(scale_px > 0.0 && max_error_px > scale_px, "limits of HeldOutJudge");
  for (const Track& track : tracks_) {
    for (const TrackElement& element : track) image_ids_.push_back(element.image_id);
  }
}

HeldOutJudge::Errors HeldOutJudge::Measure(const Reconstruction& model) const {
  std::vector<size_t> begins;
  size_t num = 0;
  for (const Track& track : tracks_) {
    begins.push_back(num);
    num += track.size();
  }
  Errors errors(num, max_error_px_);
  ParallelFor(static_cast<int64_t>(tracks_.size()), num_threads_, [&](int64_t track_idx) {
    const Track& track = tracks_[static_cast<size_t>(track_idx)];
    std::vector<std::optional<PixelRay>> rays(track.size());
    std::vector<const PixelRay*> usable;
    for (size_t i = 0; i < track.size(); ++i) {
      const auto image = model.images.find(track[i].image_id);
      if (image == model.images.end()) continue;
      rays[i] = MakePixelRay(model.cameras.at(image->second.camera_id),
                             image->second.cam_from_world,
                             image->second.points2D.at(track[i].point2D_idx).xy);
      if (rays[i]) usable.push_back(&*rays[i]);
    }
    if (usable.size() < 2) return;
    const auto point = EstimateRayPoint(usable, scale_px_);
    if (!point) return;
    for (size_t i = 0; i < track.size(); ++i) {
      if (!rays[i]) continue;
      errors[begins[static_cast<size_t>(track_idx)] + i] =
          std::min(ErrorPx(*rays[i], *point), max_error_px_);
    }
  });
  return errors;
}

double HeldOutJudge::Loss(double error_px) const {
  const double ratio = error_px / scale_px_;
  return std::log1p(ratio * ratio);
}

double HeldOutJudge::MeanPx(const Errors& errors) const {
  Mean mean;
  for (const double error : errors) mean.Add(Loss(error));
  return scale_px_ * std::sqrt(std::expm1(mean.Value()));
}

std::map<ImageId, double> HeldOutJudge::MeanPxByImage(const Errors& errors) const {
  std::map<ImageId, Mean> means;
  for (size_t i = 0; i < errors.size(); ++i) means[image_ids_[i]].Add(Loss(errors[i]));
  std::map<ImageId, double> mean_px;
  for (const auto& [id, mean] : means)
    mean_px[id] = scale_px_ * std::sqrt(std::expm1(mean.Value()));
  return mean_px;
}

std::map<ImageId, double> HeldOutJudge::MedianPxByImage(const Errors& errors) const {
  std::map<ImageId, std::vector<double>> errors_by_image;
  for (size_t i = 0; i < errors.size(); ++i) errors_by_image[image_ids_[i]].push_back(errors[i]);
  std::map<ImageId, double> median_px;
  for (auto& [id, errors_px] : errors_by_image) median_px[id] = Median(std::move(errors_px));
  return median_px;
}

std::map<ImageId, size_t> HeldOutJudge::NumObservations(size_t min_track_length) const {
  std::map<ImageId, size_t> num;
  for (const Track& track : tracks_) {
    if (track.size() < min_track_length) continue;
    for (const TrackElement& element : track) ++num[element.image_id];
  }
  return num;
}

std::vector<ImageId> HeldOutJudge::FindWorse(const Errors& before,
                                             const Errors& after,
                                             double num_sigmas) const {
  std::map<ImageId, Mean> differences;
  for (size_t i = 0; i < image_ids_.size(); ++i) {
    differences[image_ids_[i]].Add(Loss(after[i]) - Loss(before[i]));
  }
  std::vector<ImageId> worse;
  for (const auto& [id, mean] : differences) {
    if (mean.Value() > num_sigmas * mean.StandardError()) worse.push_back(id);
  }
  return worse;
}

bool HeldOutJudge::IsWorse(const Errors& before, const Errors& after, double num_sigmas) const {
  Mean difference;
  for (size_t i = 0; i < before.size(); ++i) difference.Add(Loss(after[i]) - Loss(before[i]));
  return difference.num > 0 && difference.Value() > num_sigmas * difference.StandardError();
}

}  // namespace vgtw
