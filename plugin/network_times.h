// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

struct NetworkTimesOptions {
  std::filesystem::path program;  // vgtw-network
  std::filesystem::path image_path;
  std::vector<int64_t> num_views = {5, 10, 20};  // each at least 2
  int num_repeats = 1;                           // >= 1, each a process of its own
  std::vector<std::string> flags;                // of predict: weights, device, ...
  std::filesystem::path scratch;                 // an empty folder

  void Check() const;
};

struct NetworkTime {
  int64_t num_views = 0;
  std::vector<double> seconds;  // of trunk, cameras and heads, without reading photos and weights
  double median_sec = 0.0;
  nlohmann::json summary;  // the last run's --json of predict, without its views
};

// Runs `vgtw-network predict` on photos evenly spaced among the sorted names. Counts with more
// views than there are photos are left out. Throws Error if a run fails.
std::vector<NetworkTime> MeasureNetwork(const NetworkTimesOptions& options,
                                        const ProgressCallback& progress = {});

}  // namespace vgtw
