// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/view_features.h"
#include "scene/features.h"

namespace vgtw {

// Defaults are COLMAP's.
struct TwoViewOptions {
  double max_error_px = 4.0;           // of an inlier, Sampson's distance or transfer error; > 0
  int min_num_inliers = 15;            // of an estimate; >= 5
  double min_E_F_inlier_ratio = 0.95;  // with fewer, intrinsics are taken for wrong; in [0, 1]
  double max_H_inlier_ratio = 0.8;     // with more, the scene for planar or the camera for turning
  int max_num_iterations = 10000;      // of the random sampling; >= 1

  void Check() const;
};

// What matched features say about two views, by COLMAP's rules: essential matrix (calibrated),
// fundamental matrix (uncalibrated) and homography are each found by random sampling with local
// optimisation, and config tells which one explains the matches:
//   2 calibrated if E holds at least min_E_F_inlier_ratio of F's inliers, else 3 uncalibrated;
//   4 planar or 5 panoramic where H holds more than max_H_inlier_ratio of these; panoramic if a
//   rotation alone holds as many.
// cam2_from_cam1 is measured, with a translation of length 1 (0 if panoramic), and not set for 3.
// config is 1 and inlier_matches empty where nothing has min_num_inliers. The same input gives the
// same output. Matches of features without a ray never are inliers.
TwoViewGeometry EstimateTwoViewGeometry(const ViewFeatures& view1,
                                        const ViewFeatures& view2,
                                        const FeatureMatches& matches,
                                        const TwoViewOptions& options);

}  // namespace vgtw
