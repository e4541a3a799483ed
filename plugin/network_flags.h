// SPDX-License-Identifier: BSD-3-Clause
// Flags that the commands of `vgtw-network` share.
#pragma once

#include "network/predict.h"
#include "plugin/commands.h"
#include "plugin/flags.h"

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// Which weights.
struct WeightsFlags {
  std::filesystem::path weights_path;
  std::filesystem::path lora_path;

  void Declare(Flags& flags);
  std::vector<std::filesystem::path> Files() const;
  std::string Hash() const;  // SHA-256, of all files
};

// Photos, weights and how the network is run.
class NetworkFlags {
 public:
  std::filesystem::path image_path;
  WeightsFlags weights;

  void DeclareInput(Flags& flags);
  void DeclareImageSize(Flags& flags);
  void DeclareMachine(Flags& flags);

  // Throws Error if none of the photos has a mask below --mask_path: then its names are wrong.
  PredictOptions Options(const std::vector<std::string>& image_names,
                         const Usability& usability) const;
  // For the fields that are one command's own.
  PredictOptions& options() { return options_; }

 private:
  std::filesystem::path mask_path_;
  std::string model_ = "auto";
  std::string precision_ = "fp32";
  PredictOptions options_;
};

}  // namespace vgtw
