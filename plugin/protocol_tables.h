// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/protocol.h"
#include "plugin/result_table.h"
#include "plugin/scene_scores.h"

#include <map>
#include <string>
#include <vector>

namespace vgtw {

// A system's scores by scene; a scene that is absent was not measured.
struct SystemScores {
  std::string name;
  std::map<std::string, SceneScores> scenes;
};

// For the data sets robustnerf, on_the_go and paper (scenes of both) the paper's tables, in their
// columns as far as the protocol has any of their scenes, with a row per system before the paper's;
// then, for what these do not hold, tables of points, depths, poses and masks with columns per
// scene and for the means. Masks only where scenes have true ones. Law: a mean over scenes of which
// one was not measured is NaN.
std::vector<ResultTable> MakeTables(const Protocol& protocol,
                                    const std::vector<SystemScores>& systems);

}  // namespace vgtw
