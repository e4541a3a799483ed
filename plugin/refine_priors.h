// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/predictions.h"
#include "plugin/expected_errors.h"
#include "refine/bundle_priors.h"
#include "refine/triangulation.h"
#include "scene/reconstruction.h"

#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

struct PriorOptions {
  bool poses = true;           // as predicted
  bool focal_lengths = false;  // as predicted
  bool depths = true;          // as predicted, at the keypoints of tracks
  bool centres = false;        // the database's pose priors (GPS)
  ExpectedErrors errors;       // of predictions, where the measured sigmas start from
  // Of known centres without a covariance: metres for GPS, else the unit of the pose priors; > 0.
  double centre_sigma = 5.0;
  double keep_percent = 80.0;         // of a view's depths, by confidence, percent, (0, 100]
  double distractor_threshold = 0.5;  // depth on likelier distractors is not used; (0, 1]
  // Depths are thinned to the most confident of each cell of a grid over the image with so many
  // columns, and rows: errors of neighbours are alike, many of them outvote the pixels. >= 1.
  int num_depth_cells = 6;
  int num_threads = 0;

  bool UsePredictions() const { return poses || focal_lengths || depths; }
  void Check() const;
};
nlohmann::json AsJson(const PriorOptions& options);

// What predictions say of the seed's images, matched by name, and of its cameras. Depths are those
// of static, confident pixels, thinned; a depth's sigma is the expected error, more below the
// median confidence at the view's keypoints. What is not finite or not positive is left out. Throws
// Error if no image has a prediction.
BundlePriors PredictionPriors(const PriorOptions& options,
                              const PredictionReader& predictions,
                              const Reconstruction& seed,
                              const std::vector<Track>& tracks);

// The database's known centres of the seed's images, in a world of their own: cartesian, or metres
// east, north and up of the first. Sigmas are those of the covariance where there is one.
// Throws Error if there are fewer than three, or they are of an undefined or of different
// coordinate systems.
CentrePriors KnownCentres(const ColmapDatabase& database,
                          const Reconstruction& seed,
                          double default_sigma);

// The priors that the options ask for and that there are sources for. Centres need a database:
// without one std::invalid_argument.
BundlePriors MakePriors(const PriorOptions& options,
                        const PredictionReader* predictions,
                        const ColmapDatabase* database,
                        const Reconstruction& seed,
                        const std::vector<Track>& tracks);

}  // namespace vgtw
