// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/view_features.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <limits>
#include <map>
#include <vector>

namespace vgtw {

struct DepthScaleOptions {
  // Views with fewer common keypoints of known depth say nothing about each other; in [1, 10^6].
  int min_links = 5;
  // Differences between two views below this (relative) are taken for noise, those above count
  // linearly instead of squared; in (0, 1].
  double noise_floor = 0.002;
  int max_iterations = 50;  // in [1, 10^4]

  void Check() const;
};

struct DepthScale {
  double scale = 1.0;  // scale * predicted depth is the view's depth
  // What is left between this view and the others, as a relative sigma of the depth of one view;
  // NaN without links.
  double spread = std::numeric_limits<double>::quiet_NaN();
  size_t num_links = 0;  // common keypoints of known depth, over all other views
};
using DepthScales = std::map<ImageId, DepthScale>;  // one per view

// Per-view scales of depth under which the views agree: a point that view i lifts lies in view j at
// the depth z_ij(s_i) = a + s_i b, to be s_j D_j. Minimised is the (Huber) sum of
// log z_ij - log(s_j D_j), taken as the median over the tracks that i and j share, so that neither
// wrong tracks nor a bad view move the others. Depths along z hardly depend on errors of rotation.
// In each set of views that links connect the median of log scale is 0 (the lower one of an even
// number), for a factor common to all views is hardly seen in depths: it would have to come from
// the baselines, which pose errors spoil. Views without links keep 1. Elements of tracks whose
// image is not in `views` take no part. Throws std::invalid_argument if a track names a keypoint
// that its view lacks.
DepthScales EstimateDepthScales(const std::map<ImageId, ViewFeatures>& views,
                                const std::vector<std::vector<TrackElement>>& tracks,
                                const DepthScaleOptions& options = {});

}  // namespace vgtw
