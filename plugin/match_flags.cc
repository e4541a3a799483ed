// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/match_flags.h"

namespace vgtw {

void MatchFlags::Declare(Flags& flags) {
  PredictionUncertainty& uncertainty = match_.views.pair.uncertainty;
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
  flags.Group("Errors to expect of predictions (standard deviations)")
      .Add("expected_rotation_deg",
           &uncertainty.rotation_deg,
           "Rotation between two photos, degrees")
      .Add("expected_centre_percent",
           &match_.centre_percent,
           "Vector between two centres, percent of the cameras' extent or of the middle depth, "
           "whichever is less")
      .Add("expected_focal_percent", &focal_percent_, "Focal length, percent")
      .Add("expected_depth_percent", &depth_percent_, "Depth of a pixel, percent");
}

void MatchFlags::ApplyTo(SiftOptions& sift, MatchStageOptions& match) const {
  sift = sift_;
  match = match_;
  match.views.pair.uncertainty.focal = focal_percent_ / 100.0;
  match.views.pair.uncertainty.depth = depth_percent_ / 100.0;
}

}  // namespace vgtw
