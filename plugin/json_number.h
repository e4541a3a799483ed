// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include <nlohmann/json.hpp>

namespace vgtw {

// JSON has no NaN.
inline nlohmann::json NumberOrNull(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

}  // namespace vgtw
