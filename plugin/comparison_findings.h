// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>

namespace vgtw {

// What the figures of a comparison (plugin/comparison.h) say in words.

// The views to look at first, worst first: [{name, why}]. Of the last model against the first.
nlohmann::json FindGuiltyViews(const nlohmann::json& comparison);

// Sentences; the first is the answer to "did it help?", judged by the reference where there is one,
// else by tracks held out. Where there is neither, nothing is claimed: errors of adjusted points
// cannot tell.
nlohmann::json Summarise(const nlohmann::json& comparison);

}  // namespace vgtw
