// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/pose_files.h"
#include "scene/named_pose.h"

#include <string>
#include <vector>

namespace vgtw {

// Which pose of an estimate belongs to which of a reference:
//   names, names    equal ones; if none are equal, without folder, or without folder and extension
//   times, times    pairs of the least difference first, up to the tolerance
//   anything else   labels of a trajectory that all name a view; else the i-th to the i-th in the
//                   order of both, for which the counts must agree
struct MatchedPoses {
  std::vector<NamedPose> estimate;  // under the reference's names
  size_t num_surplus = 0;           // of the estimate that no view of the reference wanted
  std::vector<std::string> notes;   // where names were not simply equal
};

// Throws Error if two poses mean the same view, or counts that must agree do not.
MatchedPoses MatchPoses(const PoseSet& estimate,
                        const PoseSet& reference,
                        double max_time_difference_sec);

}  // namespace vgtw
