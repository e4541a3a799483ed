// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/protocol.h"
#include "plugin/flags.h"

#include <string>

namespace vgtw {

void AddConditionFlags(Flags& flags, ProtocolConditions& conditions);

// What numbers hold under, for captions: of the drawn photos and of one part of the tables.
enum class TablePart { kPoints, kDepth, kPoses, kMasks };
std::string SamplingText(const ProtocolSampling& sampling);
std::string ConditionsText(const ProtocolConditions& conditions, TablePart part);

}  // namespace vgtw
