// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/match_flags.h"

namespace vgtw {

void MatchFlags::Declare(Flags& flags) {
  flags.Group("Features")
      .Add("max_num_features", &sift_.max_num_features, "Features per photo")
      .Add("max_image_size", &sift_.max_image_size, "Larger photos are reduced, pixels")
      .Add("mask_margin_scales",
           &sift_.mask_margin_scales,
           "Distance of features to excluded pixels, in multiples of their scale");
  flags.Group("Pairs")
      .Add("num_best", &match_.pairs.num_best, "Most co-visible partners of each photo")
      .Add("num_diverse", &match_.pairs.num_diverse, "Further ones, unlike those")
      .Add("min_covisibility",
           &match_.pairs.min_covisibility,
           "Share of the static scene that both photos must see, in [0,1]");
  AddExpectedErrors(flags, errors_);
}

void MatchFlags::ApplyTo(SiftOptions& sift, MatchStageOptions& match) const {
  sift = sift_;
  match = match_;
  match.centre_percent = errors_.centre_percent;
  PredictionUncertainty& uncertainty = match.views.pair.uncertainty;
  uncertainty.rotation_deg = errors_.rotation_deg;
  uncertainty.focal = errors_.focal_percent / 100.0;
  uncertainty.depth = errors_.depth_percent / 100.0;
}

}  // namespace vgtw
