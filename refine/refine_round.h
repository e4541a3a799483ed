// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/refine_model.h"

#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <vector>

namespace vgtw {

// How far off observations may reproject, per image: some views of a seed are farther off than
// others. Limits only become tighter once something was adjusted.
struct RoundLimits {
  std::map<ImageId, double> max_error_px;
  double final_px = 0.0;  // where they end
  double worst_px = 0.0;  // as far as they are widened

  double MedianPx() const;
  bool IsFinal() const { return MedianPx() <= final_px; }
  // After an adjustment that left these median errors.
  void Tighten(const std::map<ImageId, double>& median_px);
  // Doubles them. Whether any changed.
  bool Widen();
  // Whether any is lower than it was by a share that lets observations go.
  bool IsTighterThan(const RoundLimits& before) const;
};

struct RoundOutcome {
  std::set<ImageId> adjusted;           // images that took part; empty = nothing was changed
  std::map<ImageId, double> median_px;  // of their observations
  BundleAdjustmentSummary adjustment;   // the last one
};

// Removes all that an image observes; returns the number of observations.
size_t RemoveObservationsOf(ImageId image_id, Reconstruction& model);

// The tracks' elements in the images that are wanted, where two or more are left.
std::vector<Track> TracksIn(const std::vector<Track>& tracks,
                            const std::function<bool(ImageId)>& is_wanted);

// Triangulates the tracks, adjusts and drops what does not fit, twice: the first pass finds the
// poses, the second sharpens them without what the first dropped. Images in `held` and images with
// too few supporting observations take no part and stay as they are: as fixed cameras their few,
// often wrong, observations would turn all others around them.
// The sigmas of `priors` become those that their residuals show. `goes_on` is asked before every
// iteration; what was reached when it says no is kept.
RoundOutcome RunRefineRound(const RefineModelOptions& options,
                            const std::vector<Track>& tracks,
                            const std::set<ImageId>& held,
                            const RoundLimits& limits,
                            BundlePriors& priors,
                            Reconstruction& model,
                            const std::function<bool()>& goes_on = {});

// How the model is adjusted: robustly at the scale of the error that it has.
BundleAdjustmentOptions AdjustmentOf(const RefineModelOptions& options,
                                     const Reconstruction& model,
                                     const BundlePriors& priors);

}  // namespace vgtw
