// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/predict_run.h"

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// See Predictor::Probe.
ProbeSummary ProbeViews(const ReadyNetwork& network,
                        const PredictOptions& options,
                        const std::filesystem::path& image_folder,
                        const std::vector<std::string>& image_names,
                        const ProbeRequest& request,
                        const ProgressCallback& progress);

}  // namespace vgtw
