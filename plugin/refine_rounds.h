// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/colmap.h"
#include "refine/bundle_adjustment.h"
#include "scene/reconstruction.h"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

struct TriangulationInput {
  std::filesystem::path database_path;
  std::filesystem::path image_path;
  std::filesystem::path scratch;  // an existing folder for the models that go in and come out
  std::filesystem::path log_path;
  int num_threads = 0;
};

// Triangulates the database's verified matches by colmap's point_triangulator with the poses and
// intrinsics of `seed`, which stay as they are. Observations that reproject worse than
// `max_error_px` are left out. Returns nullopt if colmap triangulated nothing.
std::optional<Reconstruction> Triangulate(const Colmap& colmap,
                                          const TriangulationInput& input,
                                          const Reconstruction& seed,
                                          double max_error_px);

// Observations of each image that tie its pose and scale down: those of points that three images
// see. A chain of points seen by two leaves the scale of each link free. (Of two images: all.)
std::map<ImageId, size_t> NumSupportingObservations(const Reconstruction& model);

struct RefineRoundsOptions {
  int num_rounds = 3;  // at most; >= 1
  // Views with fewer supporting observations are held at their pose.
  int min_num_observations = 30;
  // So are views that adjustment turns by more than this: feed-forward networks err by a degree or
  // two, and what turns a view farther is rarely its true pose. (0, 180].
  double max_turn_deg = 5.0;
  bool refine_extra_params = true;  // distortion, where the camera's model has it
  int num_threads = 0;
};

// A view that keeps its feed-forward pose, and why.
struct HeldView {
  std::string name;
  std::string reason;
};

struct RefineRoundsResult {
  Reconstruction feedforward;  // triangulated with the poses of the seed
  Reconstruction refined;
  std::vector<BundleAdjustmentSummary> rounds;
  std::vector<HeldView> held_views;
};

// Coarse to fine: triangulate with wide limits, adjust robustly at the scale of the error that was
// measured, drop what does not fit, triangulate again with the better poses and tighter limits. If
// a view that moved proves weak or turned too far, all begins anew with that view held, so that it
// ends exactly at its feed-forward pose and draws no other view along. Returns nullopt if nothing
// could be triangulated.
std::optional<RefineRoundsResult> RefineInRounds(const Colmap& colmap,
                                                 const TriangulationInput& input,
                                                 const Reconstruction& seed,
                                                 const RefineRoundsOptions& options);

}  // namespace vgtw
