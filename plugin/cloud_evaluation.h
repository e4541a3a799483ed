// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/cloud_error.h"
#include "evaluation/icp.h"
#include "plugin/cloud_source.h"

#include <optional>

namespace vgtw {

struct CloudEvaluationOptions {
  bool use_icp = false;
  IcpOptions icp;
  double voxel_size = 0.0;  // means in cubes instead of all points; 0 = none
  CloudErrorOptions error;
};

struct CloudEvaluation {
  CloudAlignment alignment;
  std::optional<IcpResult> icp;
  CloudError error;
};

// The prediction moved by `alignment`, then by ICP, against the reference. Throws Error if either
// has no point, or ICP finds no motion.
CloudEvaluation EvaluateClouds(CloudSource& prediction,
                               CloudSource& reference,
                               const CloudAlignment& alignment,
                               const CloudEvaluationOptions& options);

}  // namespace vgtw
