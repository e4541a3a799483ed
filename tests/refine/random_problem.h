// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/triangulation.h"
#include "scene/reconstruction.h"

#include <cstdint>
#include <string>
#include <vector>

namespace vgtw {

// What refinement may be given. `seed` and `truth` have the same keypoints.
struct RandomProblem {
  std::string description;
  Reconstruction truth;  // poses and cameras, no points
  Reconstruction seed;
  std::vector<Track> tracks;
};

// A problem that is a function of its number: 2 to 12 views of any camera model, of a box, a plane
// or without any baseline; noise up to 1 px, keypoints and whole tracks that are wrong, tracks of
// two points, rigid things that moved between two views, views with few observations; seed errors
// up to 8 deg with wrong centres and focal lengths, views that are off altogether or not a number.
RandomProblem MakeRandomProblem(uint64_t number);

// How far poses are from the truth, free of any alignment: means over pairs of views.
struct PairError {
  double rotation_deg = 0.0;   // of cam2_from_cam1
  double direction_deg = 0.0;  // of camera 2 as camera 1 sees it, where there is a baseline
};

// Over the views of `model` that `truth` has.
PairError ComparePairs(const Reconstruction& model, const Reconstruction& truth);

}  // namespace vgtw
