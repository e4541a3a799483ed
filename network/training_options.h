// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/adamw.h"
#include "network/train.h"

#include <cstdint>
#include <string>

namespace vgtw {

LearningRateSchedule ScheduleOf(const TrainOptions& options);
AdamWOptions OptimiserOf(const TrainOptions& options);

// What must be the same for a run to go on: everything that a step's result depends on, but not
// how many steps there are to be. `start` is the Fingerprint of the weights that it started from.
std::string IdentityOf(const TrainOptions& options, uint64_t start);

}  // namespace vgtw
