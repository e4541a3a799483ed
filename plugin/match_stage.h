// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/predictions.h"
#include "matching/match_views.h"
#include "matching/pair_selection.h"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

struct MatchStageOptions {
  PairSelectionOptions pairs;
  MatchViewsOptions views;
  // Share of a view's depths that is believed, by confidence, percent, (0, 100].
  double keep_percent = 80.0;
  double distractor_threshold = 0.5;  // depth on likelier distractors is not used; (0, 1]
  // Error of the vector between two camera centres, percent of the cameras' extent or of the middle
  // depth, whichever is less; [0, 100].
  double centre_percent = 2.0;
  int num_threads = 0;
};

// What the matches of one image say.
struct MatchedImage {
  std::string name;
  size_t num_keypoints = 0;
  size_t num_pairs = 0;  // with a geometry
  size_t num_inlier_matches = 0;
  // Measured against predicted relative rotations, median over its pairs; nullopt without any.
  std::optional<double> prediction_error_deg;
};

struct MatchStageSummary {
  std::vector<MatchedImage> images;              // sorted by name
  std::vector<std::string> without_predictions;  // images of the database that take no part
  size_t num_pairs = 0;                          // selected
  size_t num_guided = 0, num_widened = 0, num_unguided = 0, num_unmatched = 0;
  size_t num_inlier_matches = 0;
};
nlohmann::json AsJson(const MatchStageSummary& summary);

// Replaces all matches and two-view geometries of a database, which has cameras, images and
// features of any kind, by those of the pairs that predictions call co-visible. One transaction.
// Throws Error if fewer than two images have a prediction and features, if their descriptors are
// missing or of different kinds, or if no pair is co-visible.
MatchStageSummary MatchDatabase(const PredictionReader& predictions,
                                const MatchStageOptions& options,
                                ColmapDatabase& database);

}  // namespace vgtw
