// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/flags.h"
#include "plugin/mask_flags.h"
#include "plugin/match_flags.h"
#include "plugin/pipeline.h"
#include "plugin/refine_flags.h"

#include <string>

namespace vgtw {

// The flags of PipelineOptions that concern the method, shared by `run` and `demo`.
class RunFlags {
 public:
  void Declare(Flags& flags);
  // Sets what the flags say; paths and usability stay as they are.
  void ApplyTo(PipelineOptions& options) const;

 private:
  MaskFlags mask_;
  MatchFlags match_;
  RefineFlags refine_;
  PipelineOptions options_;
  std::string matcher_ = "guided";
  std::string camera_model_ = "SIMPLE_RADIAL";
};

}  // namespace vgtw
