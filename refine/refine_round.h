// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/refine_model.h"

#include <cstddef>
#include <map>
#include <set>
#include <vector>

namespace vgtw {

// Limits of one round; they only become tighter.
struct RoundLimits {
  double max_error_px = 0.0;
  double final_px = 0.0;  // max_error_px ends here

  bool IsFinal() const { return max_error_px <= final_px; }
  // After a round whose observations have this median error.
  void Tighten(double median_px);
};

struct RoundOutcome {
  std::set<ImageId> adjusted;  // images that took part; empty = nothing was changed
  std::map<ImageId, size_t> num_supporting;
  double median_px = 0.0;
  BundleAdjustmentSummary adjustment;  // the last one
};

// Triangulates the tracks, adjusts and drops what does not fit, twice: the first pass finds the
// poses, the second sharpens them without what the first dropped. Images in `held` and images with
// too few supporting observations take no part and stay as they are: as fixed cameras their few,
// often wrong, observations would turn all others around them.
RoundOutcome RunRefineRound(const RefineModelOptions& options,
                            const std::vector<Track>& tracks,
                            const std::set<ImageId>& held,
                            const RoundLimits& limits,
                            Reconstruction& model);

}  // namespace vgtw
