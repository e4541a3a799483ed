// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "scene/static_view.h"

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// What the stages that read depths for features share.

// Index of each view of the predictions by name.
std::map<std::string, size_t> IndexByName(const PredictionReader& predictions);

// The confidence from which `keep_percent` of a view's known depths are kept.
double ConfidenceThreshold(const StaticView& view, double keep_percent);

// What errors of predicted centres are measured by: the cameras' extent or the middle of the views'
// middle depths, whichever is less.
double ErrorUnit(const std::vector<Eigen::Vector3d>& centres, std::vector<double> middle_depths);

}  // namespace vgtw
