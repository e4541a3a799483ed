// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/sift.h"
#include "plugin/flags.h"
#include "plugin/match_stage.h"

namespace vgtw {

// Flags of guided matching that `run` and `match` share.
class MatchFlags {
 public:
  void Declare(Flags& flags);
  void ApplyTo(SiftOptions& sift, MatchStageOptions& match) const;

 private:
  SiftOptions sift_;
  MatchStageOptions match_;
  double focal_percent_ = 100.0 * PredictionUncertainty().focal;
  double depth_percent_ = 100.0 * PredictionUncertainty().depth;
};

}  // namespace vgtw
