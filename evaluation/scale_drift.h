// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <map>
#include <optional>
#include <string>

namespace vgtw {

// How much the scale of an estimate changes over the scene: of the ratios (estimate / reference) of
// the distances between each common view and its 5 nearest in the reference, half the distance of
// the 84th from the 16th percentile, as percent of the median; 1 sigma of normal ratios. Law: a
// similarity applied to either changes nothing. nullopt with fewer than 3 common views, or if fewer
// than 3 of these distances are positive.
std::optional<double> ScaleDriftPercent(const std::map<std::string, Rigid3d>& estimate,
                                        const std::map<std::string, Rigid3d>& reference);

}  // namespace vgtw
