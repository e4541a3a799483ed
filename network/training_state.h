// SPDX-License-Identifier: BSD-3-Clause
// What a training run leaves on disk. Internal to network/: needs LibTorch.
#pragma once

#include "network/adamw.h"
#include "network/identify.h"
#include "network/trained_parameters.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace vgtw {

// Writes values and moments, float32, bit by bit; `options` tells runs apart.
void WriteTrainingState(const std::filesystem::path& path,
                        const TrainedParameters& parameters,
                        const AdamW::Moments& moments,
                        int64_t num_steps_done,
                        const std::string& options);

// Reads them back and returns how many steps were done; nullopt if there is no such file. Throws
// Error if it is damaged, or of other options or parameters.
std::optional<int64_t> ReadTrainingState(const std::filesystem::path& path,
                                         const std::string& options,
                                         TrainedParameters& parameters,
                                         AdamW::Moments& moments);

// Writes what was trained under its official names, with the metadata that tells the sizes which
// shapes do not (network/identify.h). `moments.mean`, where there is one, takes the place of the
// values.
void WriteTrainedWeights(const std::filesystem::path& path,
                         const NetworkDescription& network,
                         const TrainedParameters& parameters,
                         const AdamW::Moments& moments);

}  // namespace vgtw
