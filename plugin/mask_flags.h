// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/flags.h"
#include "scene/distractor_mask.h"

#include <string>

namespace vgtw {

// The flags of StaticMaskOptions, shared by `mask make`, `run` and `demo`.
class MaskFlags {
 public:
  void Declare(Flags& flags);
  StaticMaskOptions Options() const;  // throws std::invalid_argument if out of bounds

 private:
  StaticMaskOptions options_;
  std::string unknown_ = "keep";
};

}  // namespace vgtw
