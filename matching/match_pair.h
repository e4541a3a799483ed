// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/matching_view.h"
#include "matching/search_window.h"
#include "matching/two_view_estimation.h"
#include "matching/window_search.h"
#include "scene/features.h"

#include <optional>
#include <string_view>

namespace vgtw {

struct MatchPairOptions {
  PredictionUncertainty uncertainty;
  // Windows reach so many standard deviations; > 0.
  double num_sigmas = 2.0;
  // Windows are doubled so many times to begin with, and where they prove too small, up to so many
  // times in all; both in [0, 16].
  int min_num_widenings = 0;
  int max_num_widenings = 2;
  // Features, the largest first, that find out how wrong the prediction is; >= 1.
  int num_coarse_features = 1500;
  WindowSearchOptions search;
  TwoViewOptions two_view;

  void Check() const;
};

enum class MatchMethod {
  kNone,      // no geometry was found
  kGuided,    // the prediction led to it
  kWidened,   // only with wider windows
  kUnguided,  // the prediction proved wrong: found by plain matching
};
std::string_view Name(MatchMethod method);

// How the measured relative pose differs from the predicted one.
struct RelativePoseError {
  double rotation_deg = 0.0;
  // Between the directions of the translations; nullopt if one of them is 0.
  std::optional<double> direction_deg;
};

struct MatchedPair {
  MatchMethod method = MatchMethod::kNone;
  FeatureMatches matches;    // before verification
  TwoViewGeometry geometry;  // measured; the prediction only told where to look
  std::optional<RelativePoseError> prediction_error;
  int num_widenings = 0;          // of the windows of the prediction
  float window_radius_px = 0.0f;  // of the last search
};

// Matches two views in two passes.
//   Coarse: large features in the windows of the prediction (see WindowPredictor), verified. If too
//   few agree, or those that agree crowd at the rims of their windows, windows are doubled; if that
//   does not help either, the same features are matched without windows.
//   Fine: the coarse inliers tell by how much the prediction misses, all over the image. All
//   features are matched in windows around the corrected prediction, as wide as the inliers deviate
//   from it, and within max_error_px of the measured epipolar lines; then verified again.
// The result is at worst that of the coarse pass.
MatchedPair MatchPair(const MatchingView& view1,
                      const MatchingView& view2,
                      const MatchPairOptions& options);

// Without prediction: all features of both views, ratio test, mutual, verified.
MatchedPair MatchPairUnguided(const MatchingView& view1,
                              const MatchingView& view2,
                              const MatchPairOptions& options);

}  // namespace vgtw
