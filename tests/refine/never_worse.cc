// SPDX-License-Identifier: BSD-3-Clause
#include "tests/refine/never_worse.h"

#include "refine/refine_model.h"
#include "tests/refine/random_problem.h"

#include <cinttypes>
#include <cstdio>
#include <set>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

bool AreBitEqual(const Rigid3d& a, const Rigid3d& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

void ExpectUsableViews(const Reconstruction& model, const Reconstruction& seed) {
  EXPECT_EQ(FindFault(model), "");
  for (const auto& [id, image] : seed.images) {
    const bool is_usable = FindFault(image.cam_from_world).empty() &&
                           FindFault(seed.cameras.at(image.camera_id)).empty();
    EXPECT_EQ(model.images.contains(id), is_usable) << image.name;
  }
}

void ExpectSeedWhereNotRefined(const RefineModelResult& result, const Reconstruction& seed) {
  EXPECT_EQ(result.views.size(), result.refined.images.size());
  std::set<CameraId> refined_cameras;
  for (const auto& [id, image] : result.refined.images) {
    const RefinedView& view = result.views.at(id);
    const Rigid3d& seed_pose = seed.images.at(id).cam_from_world;
    const bool is_refined = view.outcome == ViewOutcome::kRefined;
    if (is_refined) refined_cameras.insert(image.camera_id);
    EXPECT_TRUE(AreBitEqual(result.feedforward.images.at(id).cam_from_world, seed_pose));
    EXPECT_EQ(AreBitEqual(image.cam_from_world, seed_pose), !is_refined) << image.name;
    EXPECT_EQ(view.reason.empty(), is_refined) << image.name;
  }
  for (const auto& [id, image] : result.refined.images) {
    const Camera& seed_camera = seed.cameras.at(image.camera_id);
    EXPECT_EQ(result.feedforward.cameras.at(image.camera_id), seed_camera);
    if (refined_cameras.contains(image.camera_id)) continue;
    EXPECT_EQ(result.refined.cameras.at(image.camera_id), seed_camera);
  }
}

void ExpectNeverWorse(const RefineModelResult& result, const Reconstruction& seed) {
  if (result.num_held_out_tracks > 0) {
    EXPECT_LE(result.held_out_after_px, result.held_out_before_px);
  } else {
    EXPECT_FALSE(result.IsRefined());
  }
  ExpectUsableViews(result.feedforward, seed);
  ExpectUsableViews(result.refined, seed);
  ExpectSeedWhereNotRefined(result, seed);
}

}  // namespace

void CheckNeverWorse(uint64_t first_number, uint64_t num_problems) {
  int num_refined = 0;
  int num_nearer = 0;
  for (uint64_t number = first_number; number < first_number + num_problems; ++number) {
    const RandomProblem problem = MakeRandomProblem(number);
    SCOPED_TRACE(problem.description);
    RefineModelOptions options;
    options.num_threads = 1;
    const RefineModelResult result = RefineModel(options, problem.seed, problem.tracks);
    ExpectNeverWorse(result, problem.seed);
    num_refined += result.IsRefined();
    const double before_deg = ComparePairs(result.feedforward, problem.truth).rotation_deg;
    const double after_deg = ComparePairs(result.refined, problem.truth).rotation_deg;
    num_nearer += after_deg < before_deg;
  }
  std::printf("problems %" PRIu64 " to %" PRIu64 ": %d refined, %d nearer to the truth\n",
              first_number,
              first_number + num_problems - 1,
              num_refined,
              num_nearer);
}

}  // namespace vgtw
