// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/sift.h"
#include "plugin/expected_errors.h"
#include "plugin/flags.h"
#include "plugin/match_stage.h"

namespace vgtw {

// Flags of guided matching that `run` and `match` share.
class MatchFlags {
 public:
  void Declare(Flags& flags);
  void ApplyTo(SiftOptions& sift, MatchStageOptions& match) const;
  const ExpectedErrors& errors() const { return errors_; }

 private:
  SiftOptions sift_;
  MatchStageOptions match_;
  ExpectedErrors errors_;
};

}  // namespace vgtw
