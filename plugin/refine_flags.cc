// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/refine_flags.h"

namespace vgtw {

void RefineFlags::Declare(Flags& flags) {
  flags.Group("Refinement")
      .Add("num_rounds", &options_.max_num_rounds, "Triangulate and adjust at most this often")
      .Add("held_out_percent",
           &options_.held_out_percent,
           "Share of the tracks that is not adjusted and judges every round, percent")
      .Add("held_out_seed", &options_.seed, "Of the random choice of these tracks")
      .Add("min_num_observations",
           &options_.min_num_observations,
           "A photo with fewer observations of points that three photos see keeps its pose")
      .Add("max_turn_deg",
           &options_.max_turn_deg,
           "So does one that would turn farther, and 4 times as far as the others, degrees, unless "
           "tracks held out confirm it")
      .Add("max_error_px",
           &options_.max_error_px,
           "Observations that reproject farther off are dropped in the end, pixels")
      .Add("max_seconds",
           &max_seconds_,
           "Begin no round or iteration later, keep what helped until then; 0 = no limit")
      .Add("min_angle_deg", &options_.min_angle_deg, "Least angle between rays of a point, degrees")
      .Add("refine_focal_length", &options_.refine_focal_length, "Refine focal lengths")
      .Add("refine_principal_point", &options_.refine_principal_point, "Refine principal points")
      .Add("refine_extra_params",
           &options_.refine_extra_params,
           "Refine lens distortion, where the model has it");
  flags.Group("Priors of refinement (their errors are measured on the way)")
      .Add("pose_priors", &priors_.poses, "Draw poses to the predicted ones")
      .Add("focal_priors", &priors_.focal_lengths, "Draw focal lengths to the predicted ones")
      .Add("depth_priors", &priors_.depths, "Draw points to the predicted depths")
      .Add("centre_priors",
           &priors_.centres,
           "Draw camera centres to the database's pose priors, as of GPS")
      .Add("centre_sigma",
           &priors_.centre_sigma,
           "Standard deviation of pose priors without covariance, metres for GPS, else their unit");
}

void RefineFlags::ApplyTo(RefineModelOptions& options) const {
  options = options_;
  if (max_seconds_ != 0.0) options.max_seconds = max_seconds_;
}

}  // namespace vgtw
