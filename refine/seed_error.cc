// SPDX-License-Identifier: BSD-3-Clause
#include "refine/seed_error.h"

#include "refine/held_out.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace vgtw {
namespace {

constexpr size_t kMaxTracks = 4000;
// So many tracks of three views speak for all.
constexpr size_t kMinLongTracks = 30;
constexpr double kWorstErrorDeg = 15.0;
// Errors beyond so many medians are those of wrong matches: of normal errors in two dimensions 1 in
// 10^10 is.
constexpr double kMaxMedians = 6.0;
constexpr int kNumPasses = 3;

double PixelsOfAngle(const Reconstruction& model, double angle_deg) {
  double focal_length = 0.0;
  for (const auto& [id, image] : model.images) {
    focal_length = std::max(focal_length, model.cameras.at(image.camera_id).MeanFocalLength());
  }
  return focal_length * std::tan(angle_deg * std::numbers::pi / 180.0);
}

// Sorts long tracks first. Returns how many observations, from the first on, tell the error.
size_t PutLongTracksFirst(std::vector<Track>& tracks) {
  std::stable_sort(tracks.begin(), tracks.end(), [](const Track& a, const Track& b) {
    return a.size() > b.size();
  });
  if (tracks.size() > kMaxTracks) tracks.resize(kMaxTracks);
  size_t num_long_tracks = 0;
  size_t num_of_long = 0;
  size_t num_of_all = 0;
  for (const Track& track : tracks) {
    num_of_all += track.size();
    if (track.size() < 3) continue;
    ++num_long_tracks;
    num_of_long += track.size();
  }
  return num_long_tracks < kMinLongTracks ? num_of_all : num_of_long;
}

}  // namespace

SeedError MeasureSeedError(const Reconstruction& model,
                           const std::vector<Track>& tracks,
                           int num_threads) {
  std::vector<Track> longest = tracks;
  const size_t num_telling = PutLongTracksFirst(longest);
  SeedError error;
  error.worst_px = PixelsOfAngle(model, kWorstErrorDeg);
  error.max_px = error.worst_px;
  for (const auto& [id, image] : model.images) error.max_px_by_image[id] = error.max_px;
  if (longest.empty()) return error;
  for (int i = 0; i < kNumPasses; ++i) {
    const HeldOutJudge judge(
        longest, error.max_px / kMaxMedians, 2.0 * error.worst_px, num_threads);
    const HeldOutJudge::Errors errors = judge.Measure(model);
    error.median_px = Median({errors.begin(), std::next(errors.begin(), num_telling)});
    error.max_px = std::clamp(kMaxMedians * error.median_px, 1.0, error.worst_px);
    for (const auto& [id, median_px] : judge.MedianPxByImage(errors)) {
      error.max_px_by_image[id] = std::clamp(kMaxMedians * median_px, error.max_px, error.worst_px);
    }
  }
  return error;
}

}  // namespace vgtw
