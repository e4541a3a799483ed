// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/flags.h"
#include "plugin/refine_priors.h"
#include "refine/refine_model.h"

namespace vgtw {

// Flags of refinement that `run` and `refine` share.
class RefineFlags {
 public:
  void Declare(Flags& flags);
  void ApplyTo(RefineModelOptions& options) const;
  // Without the errors to expect, which are flags of their own.
  const PriorOptions& priors() const { return priors_; }

 private:
  RefineModelOptions options_;
  double max_seconds_ = 0.0;
  PriorOptions priors_;
};

}  // namespace vgtw
