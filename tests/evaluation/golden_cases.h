// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/named_pose.h"

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// golden/<name>.json, which golden/<name>.py made by independent implementations.
inline nlohmann::json ReadGolden(const std::string& name) {
  std::ifstream file(std::string(VGTW_SOURCE_DIR) + "/tests/evaluation/golden/" + name + ".json");
  return nlohmann::json::parse(file);
}

// Rows "tx ty tz qx qy qz qw" of world_from_cam.
inline std::vector<NamedPose> PosesOf(const nlohmann::json& rows) {
  std::vector<NamedPose> poses;
  for (const nlohmann::json& row : rows) {
    const auto v = row.get<std::vector<double>>();
    const Rigid3d world_from_cam = {Eigen::Quaterniond(v[6], v[3], v[4], v[5]),
                                    Eigen::Vector3d(v[0], v[1], v[2])};
    char name[16];
    std::snprintf(name, sizeof(name), "view%03zu", poses.size());
    poses.push_back({name, Inverse(world_from_cam)});
  }
  return poses;
}

// "agreement to 1e-9 for poses": relative for figures above 1.
inline double GoldenTolerance(double expected) { return 1e-9 * std::max(1.0, std::abs(expected)); }

}  // namespace vgtw
