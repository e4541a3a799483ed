// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/reconstruction.h"
#include "scene/reprojection.h"

#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

// What an image contributes to a model. Medians and means are NaN without observations.
struct ViewQuality {
  size_t num_observations = 0;
  double median_px = std::numeric_limits<double>::quiet_NaN();  // in front of the camera
  double mean_track_length = std::numeric_limits<double>::quiet_NaN();
  double median_angle_deg = std::numeric_limits<double>::quiet_NaN();  // of its points, see below
  double coverage_percent = 0.0;                                       // see below
  size_t num_on_distractors = 0;                                       // observations
};

// How well a model ties its cameras down, without a reference.
//   angle: of a point, the largest between two of the rays that observe it; degrees
//   coverage: share of the 10 x 10 equal cells of an image that hold an observation
// A low reprojection error alone says little: it falls with every observation that is dropped.
struct ModelQuality {
  ReprojectionStats reprojection;
  double median_angle_deg = std::numeric_limits<double>::quiet_NaN();  // over points
  double coverage_percent = 0.0;                                       // mean over images
  std::optional<size_t> num_points_on_distractors;                     // known with masks
  std::map<ImageId, ViewQuality> views;
  std::vector<double> errors_px;      // of all observations in front of their cameras
  std::vector<double> track_lengths;  // of all points
};

// `mask` gives the true mask of an image by name, see evaluation/distractor_points.h; empty = none.
ModelQuality MeasureQuality(const Reconstruction& model,
                            const std::function<StaticMask(const std::string&)>& mask = {});

}  // namespace vgtw
