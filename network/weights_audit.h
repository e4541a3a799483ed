// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/checkpoint.h"
#include "network/identify.h"
#include "scene/progress.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// Opens weights; what a later file holds replaces the same names of earlier ones.
// Throws Error as Checkpoint does, std::invalid_argument if `files` is empty.
Checkpoint OpenWeights(const std::vector<std::filesystem::path>& files);

// All files in one, for messages: "base.pt + lora.pt".
std::filesystem::path NameOf(const std::vector<std::filesystem::path>& files);

std::string FormatShape(const std::vector<uint64_t>& shape);  // "3x4"; "scalar" for []

// The tensors of a checkpoint against what its network needs.
struct WeightsAudit {
  NetworkDescription description;
  int64_t num_parameters = 0;           // elements of what the network needs
  std::vector<std::string> missing;     // "a.bias"
  std::vector<std::string> misshapen;   // "a.weight is 3x4, not 4x3"
  std::vector<std::string> mistyped;    // "a.weight is I64"
  std::vector<std::string> not_finite;  // "a.weight", with NaN or infinity
  std::vector<std::string> unknown;     // "b.weight"
  std::vector<std::string> ignored;     // "track_head.*", which no network here needs

  // What is wrong in one line, with counts and the first three of each; "" if nothing is.
  std::string Problems() const;
};

enum class ValueCheck { kNone, kFinite };

// Looks for NaN and infinity with `num_threads` threads (0 = all cores), and keeps few of the pages
// that it reads; calls `progress` with tensors. Throws Error as IdentifyNetwork does; `path` is for
// messages.
WeightsAudit AuditWeights(const Checkpoint& weights,
                          const std::filesystem::path& path,
                          ValueCheck value_check,
                          int num_threads = 0,
                          const ProgressCallback& progress = {});

// Throws the Error for an audit with problems.
void RequireComplete(const WeightsAudit& audit, const std::filesystem::path& path);

// Loads `files` as a prediction on the CPU does, and forgets them. Throws Error as LoadNetwork
// does.
NetworkDescription TryWeights(const std::vector<std::filesystem::path>& files,
                              int num_threads,
                              const ProgressCallback& progress = {});

}  // namespace vgtw
