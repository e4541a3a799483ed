// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_chunks.h"

#include "scene/synthetic.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(PlanChunks, AreHandCountedOnes) {
  EXPECT_EQ(PlanChunks(5, 5, 2), (std::vector<ViewChunk>{{0, 5, 0}}));
  EXPECT_EQ(PlanChunks(10, 4, 2),
            (std::vector<ViewChunk>{{0, 4, 0}, {2, 6, 2}, {4, 8, 2}, {6, 10, 2}}));
  EXPECT_EQ(PlanChunks(7, 4, 1), (std::vector<ViewChunk>{{0, 4, 0}, {3, 7, 1}}));
  // Of three views at most one is shared.
  EXPECT_EQ(PlanChunks(5, 3, 4), (std::vector<ViewChunk>{{0, 3, 0}, {2, 5, 1}}));
}

TEST(PlanChunks, CoverAllViewsInEqualParts) {
  for (int num_views = 1; num_views <= 40; ++num_views) {
    for (int max_views = 2; max_views <= 12; ++max_views) {
      for (int overlap = 1; overlap <= 6; ++overlap) {
        const std::vector<ViewChunk> chunks = PlanChunks(num_views, max_views, overlap);
        int smallest = max_views;
        int largest = 0;
        int next = 0;
        for (const ViewChunk& chunk : chunks) {
          ASSERT_EQ(chunk.begin + chunk.num_shared_views, next);
          next = chunk.end;
          smallest = std::min(smallest, chunk.end - chunk.begin);
          largest = std::max(largest, chunk.end - chunk.begin);
        }
        ASSERT_EQ(next, num_views);
        ASSERT_LE(largest, max_views);
        ASSERT_LE(largest - smallest, 1);
        const int num_shared = std::min(overlap, max_views / 2);
        // One chunk less would not reach.
        const auto num_fewer = static_cast<int>(chunks.size()) - 1;
        const int reach = num_fewer * (max_views - num_shared) + num_shared;
        ASSERT_TRUE(num_fewer == 0 || reach < num_views);
      }
    }
  }
  EXPECT_THROW(PlanChunks(2, 1, 1), std::invalid_argument);
  EXPECT_THROW(PlanChunks(0, 1, 1), std::invalid_argument);
}

const Sim3d& WorldFromChunk() {
  static const Sim3d world_from_chunk = {
      0.37, RotationAboutAxis(Eigen::Vector3d(1, 2, 3).normalized(), 77.0), {4.0, -5.0, 6.0}};
  return world_from_chunk;
}

// The same views of an exact scene in the world and in the frame of a chunk.
struct SharedViews {
  std::vector<ViewPrediction> in_chunk;
  std::vector<ViewPrediction> in_world;

  explicit SharedViews(int num_views) {
    SyntheticOptions options;
    options.num_views = num_views;
    options.width = 84;
    options.height = 56;
    in_world = MakeTruePrediction(SyntheticScene(options), 84).views;
    in_chunk = in_world;
    for (ViewPrediction& view : in_chunk) TransformPrediction(Inverse(WorldFromChunk()), view);
  }

  void ExpectAligned(double tolerance) const {
    const auto aligned = AlignChunk(in_chunk, in_world);
    ASSERT_TRUE(aligned);
    const Sim3d& found = aligned->world_from_chunk;
    EXPECT_NEAR(found.scale / WorldFromChunk().scale, 1.0, tolerance);
    EXPECT_LT(AngleBetweenDeg(found.rotation, WorldFromChunk().rotation), 60.0 * tolerance);
    EXPECT_LT((found.translation - WorldFromChunk().translation).norm(), 10.0 * tolerance);
  }
};

TEST(AlignChunk, RecoversTheSimilarity) {
  SharedViews(4).ExpectAligned(1e-6);
  SharedViews(2).ExpectAligned(1e-6);
}

TEST(AlignChunk, OneSharedViewSuffices) { SharedViews(1).ExpectAligned(1e-6); }

TEST(AlignChunk, ResidualsOfExactViewsAreZero) {
  const SharedViews shared(3);
  const ChunkAlignment residuals = AlignChunk(shared.in_chunk, shared.in_world)->residuals;
  EXPECT_EQ(residuals.num_shared_views, 3);
  EXPECT_NEAR(residuals.scale, 0.37, 1e-6);
  // Depths are float32: 6e-8 of them, and of cameras some 10 units apart.
  EXPECT_LT(residuals.centre_rmse, 1e-5);
  EXPECT_LT(residuals.rotation_median_deg, 1e-5);
  EXPECT_LT(residuals.depth_median_percent, 1e-4);
}

TEST(AlignChunk, BearsAFifthOfCorruptDepths) {
  SharedViews shared(4);
  std::mt19937 random(1);
  for (ViewPrediction& view : shared.in_chunk) {
    for (float& depth : view.depth.data()) {
      if (random() % 5 == 0) depth *= 3.0f;
    }
  }
  shared.ExpectAligned(0.01);
}

TEST(AlignChunk, BearsOneWrongCamera) {
  SharedViews shared(4);
  Rigid3d& pose = shared.in_chunk[1].view.cam_from_world;
  pose.rotation = RotationAboutAxis(Eigen::Vector3d::UnitY(), 40.0) * pose.rotation;
  pose.translation += Eigen::Vector3d(3.0, 1.0, -2.0);
  shared.ExpectAligned(1e-6);
}

// Movers have moved between two passes only in the sense that the network sees them elsewhere.
TEST(AlignChunk, TakesTheScaleFromStaticPixels) {
  SharedViews shared(2);
  for (ViewPrediction& view : shared.in_chunk) {
    view.distractor = DistractorMask(84, 56, 0.0f);
    for (int y = 0; y < 56; ++y) {
      for (int x = 0; x < 84; ++x) {
        view.depth_conf(x, y) = 5.0f;
        if (x % 4 == 0) continue;
        view.distractor(x, y) = 1.0f;
        view.depth(x, y) *= 2.0f;
      }
    }
  }
  shared.ExpectAligned(1e-6);
}

TEST(AlignChunk, NothingSharedGivesNothing) {
  EXPECT_FALSE(AlignChunk({}, {}));
  SharedViews shared(1);
  for (float& depth : shared.in_chunk[0].depth.data()) {
    depth = std::numeric_limits<float>::quiet_NaN();
  }
  EXPECT_FALSE(AlignChunk(shared.in_chunk, shared.in_world));
}

TEST(TransformPrediction, MovesPointsWithTheirCamera) {
  SharedViews shared(1);
  ViewPrediction view = shared.in_world.front();
  view.points = Grid<Eigen::Vector3f>(84, 56);
  for (int y = 0; y < 56; ++y) {
    for (int x = 0; x < 84; ++x) {
      const auto point = UnprojectPixel(view.view, view.depth, x, y);
      if (point) view.points(x, y) = point->cast<float>();
    }
  }
  TransformPrediction(WorldFromChunk(), view);
  const auto point = UnprojectPixel(view.view, view.depth, 40, 30);
  ASSERT_TRUE(point);
  EXPECT_LT((*point - view.points(40, 30).cast<double>()).norm(), 1e-5);
}

}  // namespace
}  // namespace vgtw
