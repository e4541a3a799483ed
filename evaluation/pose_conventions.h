// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/named_pose.h"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

// Detectors of mistakes that make good poses look bad: the estimate is compared with its reference
// once more under the assumption of each mistake. They speak only where the error (median over
// pairs of views of the larger of rotation and direction error, alignment-free) is at least 5 deg
// and falls to a quarter or less.

struct BetterReading {
  size_t idx = 0;  // into `readings`
  double error_deg = 0.0;
  double error_as_read_deg = 0.0;
};

// The reading of the estimate's poses that agrees best with the reference, the first of those that
// are as good within 20 %; nullopt if none is far better. Looks at up to 64 of the common views.
std::optional<BetterReading> FindBetterReading(const std::vector<NamedPose>& estimate,
                                               const std::vector<std::vector<NamedPose>>& readings,
                                               const std::vector<NamedPose>& reference);

struct ShuffledNames {
  struct Exchange {
    std::string name;          // of the estimate's pose
    std::string name_of_pose;  // the view of the reference that has this pose
  };
  std::vector<Exchange> exchanges;  // only where the names differ, in the reference's order
  double error_deg = 0.0;
  double error_as_read_deg = 0.0;
};

// Whether the common views' poses fit far better under a permutation of their names. Looks for it
// by the best of many similarities that each identify two views; between 4 and 1000 common views.
std::optional<ShuffledNames> FindShuffledNames(const std::vector<NamedPose>& estimate,
                                               const std::vector<NamedPose>& reference);

}  // namespace vgtw
