// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/training_log.h"

#include <string>

namespace vgtw {

// A picture (SVG) of a training run: a panel for the weighted loss, for each loss that was
// computed, for the learning rate, and for each figure of the validations that ever was above 0.
// Losses as means of neighbouring steps, at most 300 along the axis; vertical axes that span more
// than a factor of 20 are logarithmic. Empty text if nothing was logged.
std::string DrawTrainingCurves(const TrainingLog& log);

}  // namespace vgtw
