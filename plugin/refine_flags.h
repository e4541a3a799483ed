// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/flags.h"
#include "refine/refine_model.h"

namespace vgtw {

// Flags of refinement that `run` and `refine` share.
class RefineFlags {
 public:
  void Declare(Flags& flags);
  void ApplyTo(RefineModelOptions& options) const;

 private:
  RefineModelOptions options_;
};

}  // namespace vgtw
