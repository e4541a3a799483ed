// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/depth_error.h"
#include "plugin/cloud_source.h"
#include "scene/progress.h"

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

struct DepthEvaluationOptions {
  // Either the aligned cloud is projected into the views of the reference (as the paper of VGTW
  // does), or the predicted depth maps are compared as they are, after an alignment of their
  // values.
  bool reproject = true;
  // Reprojection: the cloud of all views, or into each view its own points only.
  bool cloud_of_all_views = true;
  std::string cloud_alignment = "auto";          // see AlignClouds
  std::optional<CloudAlignment> alignment = {};  // is used in place of that where it is given
  // Maps: how, and whether with one fit for all views in place of one for each.
  DepthAlignment depth_alignment = DepthAlignment::kMedian;
  bool one_fit = false;
  // Pixels that should be deeper do not count; scene units of the reference.
  double max_depth = std::numeric_limits<double>::infinity();
  int num_threads = 0;
};

struct ViewDepthError {
  std::string name;
  DepthError error;
  DepthFit fit;
};

struct DepthEvaluation {
  std::optional<CloudAlignment> alignment;  // of reprojection
  std::vector<ViewDepthError> views;        // by name; those without a common pixel have none
  DepthError pooled;                        // over pixels
  double mean_abs_rel = 0.0;                // over views that have pixels
  double mean_within_percent = 0.0;
};

// Of the views that both predictions have, at the pixels of the reference's maps where both have
// depth. Throws Error if they have no view or no pixel in common.
DepthEvaluation EvaluateDepths(CloudSource& prediction,
                               const CloudSource& reference,
                               const DepthEvaluationOptions& options,
                               const ProgressCallback& progress = {});

}  // namespace vgtw
