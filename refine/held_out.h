// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/triangulation.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

namespace vgtw {

// Tracks by what they are for: adjusting, or judging what adjustment did. A track's side depends on
// its first element and the seed alone, so that it stays on its side whatever else changes.
struct SplitTracks {
  std::vector<Track> adjusted;
  std::vector<Track> held_out;
};
SplitTracks HoldOutTracks(const std::vector<Track>& tracks, double percent, uint64_t seed);

// How well poses and intrinsics explain tracks that had no part in them.
class HeldOutJudge {
 public:
  // Errors count as  log(1 + (error / scale_px)^2)  up to `max_error_px`, so that neither wrong
  // matches nor a few large errors decide.
  HeldOutJudge(std::vector<Track> tracks, double scale_px, double max_error_px, int num_threads);

  double max_error_px() const { return max_error_px_; }

  // Reprojection errors (pixels, at most max_error_px) of all observations, at the point of each
  // track that is best under `model`. An error is max_error_px where the image is missing.
  using Errors = std::vector<double>;
  Errors Measure(const Reconstruction& model) const;

  // scale_px * sqrt(exp(mean log(1 + (error / scale_px)^2)) - 1): a mean in pixels. NaN without
  // observations.
  double MeanPx(const Errors& errors) const;
  std::map<ImageId, double> MeanPxByImage(const Errors& errors) const;
  std::map<ImageId, double> MedianPxByImage(const Errors& errors) const;
  // Of the tracks that have so many elements.
  std::map<ImageId, size_t> NumObservations(size_t min_track_length = 0) const;

  // Images whose observations got worse by more than `num_sigmas` standard errors of the mean
  // difference.
  std::vector<ImageId> FindWorse(const Errors& before,
                                 const Errors& after,
                                 double num_sigmas) const;

  // Whether all observations together did.
  bool IsWorse(const Errors& before, const Errors& after, double num_sigmas) const;

 private:
  double Loss(double error_px) const;

  std::vector<Track> tracks_;
  std::vector<ImageId> image_ids_;  // of all observations
  double scale_px_;
  double max_error_px_;
  int num_threads_;
};

}  // namespace vgtw
