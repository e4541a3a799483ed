// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/protocol.h"
#include "plugin/flags.h"

#include <string>

namespace vgtw {

void AddConditionFlags(Flags& flags, ProtocolConditions& conditions);

// What the numbers hold under, in one line: "prediction Sim3-aligned on ...".
std::string ConditionsText(const ProtocolConditions& conditions);

}  // namespace vgtw
