// SPDX-License-Identifier: BSD-3-Clause
// The commands of the program `vgtw-network`.
#pragma once

#include "plugin/flags.h"

#include <functional>

namespace vgtw {

// One function per command, each in its own command_<name>.cc: declares flags, returns the work.
std::function<void()> DeclarePredict(Flags& flags);
std::function<void()> DeclareProbe(Flags& flags);
std::function<void()> DeclareTrain(Flags& flags);
std::function<void()> DeclareWeightsCheck(Flags& flags);
std::function<void()> DeclareWeightsConvert(Flags& flags);
std::function<void()> DeclareWeightsInspect(Flags& flags);

}  // namespace vgtw
