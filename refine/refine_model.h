// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/bundle_adjustment.h"
#include "refine/triangulation.h"
#include "refine/uncertainty.h"
#include "scene/progress.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

struct RefineModelOptions {
  int max_num_rounds = 6;  // of triangulation and adjustment, >= 1
  // Share of the tracks that only judge; in (0, 50].
  double held_out_percent = 10.0;
  uint64_t seed = 0;  // of the choice of these tracks
  // Views with fewer supporting observations (see below) are not refined.
  int min_num_observations = 30;
  // Nor are views that would turn by more than this, more than their observations say that they
  // are off and more than 4 times what the views turn in the median, for a seed's errors are of one
  // size: unless 20 observations held out, of tracks of three views, confirm it; (0, 180].
  double max_turn_deg = 5.0;
  double max_error_px = 4.0;   // of observations in the end; > 0
  double min_angle_deg = 1.5;  // of points; in [0, 90)
  bool refine_focal_length = true;
  bool refine_principal_point = false;
  bool refine_extra_params = true;  // distortion, where the camera's model has it
  // What is known besides pixels. Stated sigmas are where the measured ones start from: residuals
  // give them anew after every adjustment (of up to 1500 poses and intrinsics).
  BundlePriors priors;
  // No round and no iteration begins later; what helped until then stays.
  double max_seconds = std::numeric_limits<double>::infinity();
  int num_threads = 0;        // 0 = all cores
  ProgressCallback progress;  // a hundred for each round, never backwards

  void Check() const;
};

enum class ViewOutcome {
  kRefined,   // has a new pose that explains what was held out no worse
  kKept,      // has the seed's pose, for too little is known of it
  kRejected,  // has the seed's pose, for another one was found and not believed
};
std::string_view Name(ViewOutcome outcome);  // "refined", "kept", "rejected"

struct RefinedView {
  std::string name;
  ViewOutcome outcome = ViewOutcome::kKept;
  std::string reason;           // why it is not refined; "" if it is
  size_t num_observations = 0;  // in the refined model
  size_t num_supporting = 0;    // of these, of points that three views see
  size_t num_held_out = 0;      // observations that judged it
  double held_out_before_px = std::numeric_limits<double>::quiet_NaN();
  double held_out_after_px = std::numeric_limits<double>::quiet_NaN();
  // Standard deviations of a refined pose, relative to what Uncertainty::gauge holds; scene units.
  double sigma_rotation_deg = std::numeric_limits<double>::quiet_NaN();
  double sigma_centre = std::numeric_limits<double>::quiet_NaN();
  double turn_deg = 0.0;  // from the seed's pose, the whole aligned with the seed
  double move = 0.0;      // of the camera centre, scene units, likewise
};

struct RefineRound {
  double max_error_px = 0.0;  // limit of observations
  size_t num_points3D = 0;    // that were adjusted
  double median_px = 0.0;     // of their observations after adjustment
  double held_out_px = 0.0;   // after adjustment, all views
  bool is_accepted = false;   // else undone
  std::vector<std::string>
      put_back;  // views that it left worse, hence back at their last good pose
  BundleAdjustmentSummary adjustment;
};

struct RefineModelResult {
  Reconstruction feedforward;  // the seed's poses and intrinsics, points triangulated with them
  Reconstruction refined;
  std::map<ImageId, RefinedView> views;
  std::vector<RefineRound> rounds;
  bool is_out_of_time = false;  // max_seconds were over
  size_t num_held_out_tracks = 0;
  double held_out_max_px = 0.0;  // errors beyond count alike
  double held_out_before_px = std::numeric_limits<double>::quiet_NaN();
  double held_out_after_px = std::numeric_limits<double>::quiet_NaN();
  Uncertainty uncertainty;  // of what was refined

  bool IsRefined() const;  // whether any view is
};

// Observations of each image that tie its pose and scale down: those of points that three images
// see. A chain of points seen by two leaves the scale of each link free. (Of two images: all.)
std::map<ImageId, size_t> NumSupportingObservations(const Reconstruction& model);

// Coarse to fine, and never worse than the seed. Each round triangulates the tracks, adjusts
// robustly at the scale of the error that is measured and drops what does not fit; the first limit
// follows from the error of the seed itself. Tracks that were held out judge each round: a view
// that they find worse than the seed, or much worse than the round before, goes back to its last
// good pose and the round is repeated without it, unless this leaves the view worse still; a round
// that raises their mean error by more than chance is undone. So with
//   held_out = the mean error of all observations held out, robust and bounded (refine/held_out.h)
// held_out_after_px <= held_out_before_px, and where nothing helps the refined model has the seed's
// poses and intrinsics bit by bit. Models stay in the world of the seed (refine/align.h).
// Where the observations determine focal lengths no better than to 1 %, intrinsics stay the seed's
// unless what is held out asks for others: they would take up noise, and the poses with them.
// Views whose pose or camera cannot be used (not finite) are left out of both models.
// Points of `seed` are starts for triangulation, nothing else.
RefineModelResult RefineModel(const RefineModelOptions& options,
                              const Reconstruction& seed,
                              const std::vector<Track>& tracks);

}  // namespace vgtw
