// SPDX-License-Identifier: BSD-3-Clause
#include "network/correspondence_loss.h"

#include "tests/network/gradients.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr int64_t kPatch = 4;    // px
constexpr int64_t kColumns = 5;  // of patches
constexpr int64_t kRows = 3;
constexpr double kFocal = 8.0;  // px
constexpr double kDepth = 2.0;

// Two cameras in front of a wall that look along its normal; the second one stands so that the wall
// moves to the left by `shift_px` and up by as many pixels times `rise`.
GeometryTruth Wall(double shift_px, double rise = 0.0) {
  GeometryTruth truth;
  truth.depth = at::full({2, kRows * kPatch, kColumns * kPatch}, kDepth, at::kDouble);
  truth.intrinsics = at::tensor({kFocal, 0.0, 10.0, 0.0, kFocal, 6.0, 0.0, 0.0, 1.0}, at::kDouble)
                         .view({1, 3, 3})
                         .repeat({2, 1, 1});
  truth.cam_from_world = at::eye(3, 4, at::kDouble).unsqueeze(0).repeat({2, 1, 1});
  truth.cam_from_world[1][0][3] = -shift_px * kDepth / kFocal;
  truth.cam_from_world[1][1][3] = -rise * shift_px * kDepth / kFocal;
  return truth;
}

at::Tensor NoDistractor(const GeometryTruth& truth) { return at::zeros_like(truth.depth); }

PatchMatches Match(const GeometryTruth& truth) {
  return MatchPatches(truth, NoDistractor(truth), {.patch_size = kPatch});
}

// Weight that view `to` gives its patch `target` for patch `patch` of view `from`.
double WeightOf(
    const PatchMatches& matches, int64_t from, int64_t to, int64_t patch, int64_t target) {
  const at::Tensor is_target = matches.patch[from][to][patch].eq(target);
  return (matches.weight[from][to][patch] * is_target).sum().item<double>();
}

double SumOf(const PatchMatches& matches, int64_t from, int64_t to, int64_t patch) {
  return matches.weight[from][to][patch].sum().item<double>();
}

TEST(PatchMatches, ShiftByAPatchIsItsNeighbour) {
  const PatchMatches matches = Match(Wall(kPatch));
  for (int64_t row = 0; row < kRows; ++row) {
    for (int64_t column = 0; column < kColumns; ++column) {
      const int64_t patch = row * kColumns + column;
      if (column > 0) {
        EXPECT_NEAR(WeightOf(matches, 0, 1, patch, patch - 1), 1.0, 1e-6) << patch;
      } else {
        EXPECT_EQ(SumOf(matches, 0, 1, patch), 0.0) << patch;
      }
      if (column + 1 < kColumns) {
        EXPECT_NEAR(WeightOf(matches, 1, 0, patch, patch + 1), 1.0, 1e-6) << patch;
      }
      EXPECT_EQ(SumOf(matches, 0, 0, patch), 0.0);
    }
  }
}

TEST(PatchMatches, PlacesBetweenPatchesAreShared) {
  // A quarter of a patch to the left, half a patch up.
  const PatchMatches matches = Match(Wall(0.25 * kPatch, 2.0));
  const int64_t patch = 1 * kColumns + 2;
  EXPECT_NEAR(WeightOf(matches, 0, 1, patch, patch), 0.75 * 0.5, 1e-6);
  EXPECT_NEAR(WeightOf(matches, 0, 1, patch, patch - 1), 0.25 * 0.5, 1e-6);
  EXPECT_NEAR(WeightOf(matches, 0, 1, patch, patch - kColumns), 0.75 * 0.5, 1e-6);
  EXPECT_NEAR(WeightOf(matches, 0, 1, patch, patch - kColumns - 1), 0.25 * 0.5, 1e-6);
}

TEST(PatchMatches, WhatMovesIsHiddenOrUnknownMatchesNothing) {
  const GeometryTruth truth = Wall(0.0);
  const auto middle_of_first_row = [](const at::Tensor& maps, int64_t view, int64_t column) {
    return maps[view][kPatch / 2][column * kPatch + kPatch / 2];
  };
  at::Tensor distractor = NoDistractor(truth);
  middle_of_first_row(distractor, 0, 0).fill_(1.0);
  middle_of_first_row(distractor, 1, 1).fill_(1.0);
  middle_of_first_row(truth.depth, 1, 2).fill_(0.8 * kDepth);  // something in front
  middle_of_first_row(truth.depth, 0, 3).fill_(std::numeric_limits<double>::quiet_NaN());
  const PatchMatches matches = MatchPatches(truth, distractor, {.patch_size = kPatch});
  for (int64_t column = 0; column < 4; ++column) {
    EXPECT_EQ(SumOf(matches, 0, 1, column), 0.0) << column;
  }
  EXPECT_NEAR(WeightOf(matches, 0, 1, 4, 4), 1.0, 1e-6);
  EXPECT_TRUE(matches.weight.isfinite().all().item<bool>());
}

TEST(PatchMatches, AreThoseOfAllSimilarWorlds) {
  const GeometryTruth truth = Wall(2.4, 0.3);
  GeometryTruth moved = truth;
  const double scale = 7.0;
  const at::Tensor world_rotation =
      at::tensor({0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6}, at::kDouble).view({3, 3});
  const at::Tensor shift = at::tensor({1.0, -20.0, 3.0}, at::kDouble).view({3, 1});
  const at::Tensor rotations = at::matmul(truth.cam_from_world.slice(2, 0, 3), world_rotation);
  moved.cam_from_world = at::cat(
      {rotations, scale * truth.cam_from_world.slice(2, 3) - at::matmul(rotations, shift)}, 2);
  moved.depth = scale * truth.depth;
  const PatchMatches matches = Match(truth), others = Match(moved);
  const at::Tensor is_matched = matches.weight > 0;
  EXPECT_GT(is_matched.sum().item<int64_t>(), 20);
  EXPECT_TRUE(at::allclose(matches.weight, others.weight, 0.0, 1e-5));
  EXPECT_TRUE(
      at::equal(matches.patch.masked_select(is_matched), others.patch.masked_select(is_matched)));
}

TEST(PatchMatches, ShapesThatDisagreeAreNamed) {
  const GeometryTruth truth = Wall(1.0);
  EXPECT_THROW(MatchPatches(truth, at::zeros({2, 3, 4}), {.patch_size = kPatch}),
               std::invalid_argument);
  EXPECT_THROW(MatchPatches(truth, NoDistractor(truth), {.patch_size = 7}), std::invalid_argument);
}

TEST(CorrespondenceLoss, IsTheLogOfTheNumberOfPatchesWhereAllAreAlike) {
  const at::Tensor features = at::ones({2, kRows * kColumns, 6}, at::kDouble);
  EXPECT_NEAR(CorrespondenceLoss(features, Match(Wall(kPatch))).item<double>(),
              std::log(static_cast<double>(kRows * kColumns)),
              1e-6);
}

TEST(CorrespondenceLoss, VanishesWhereTheRightPatchesAloneAreAlike) {
  // One channel per place of the wall: view 1 shows what is a column further right.
  const int64_t num_patches = kRows * kColumns;
  const at::Tensor places = at::eye(num_patches + 1, at::kDouble);
  const at::Tensor features = at::stack({places.slice(0, 0, num_patches), places.slice(0, 1)});
  EXPECT_LT(CorrespondenceLoss(features, Match(Wall(kPatch)), 0.02).item<double>(), 1e-12);
  EXPECT_GT(CorrespondenceLoss(features, Match(Wall(-kPatch)), 0.02).item<double>(), 10.0);
}

TEST(CorrespondenceLoss, GradientEqualsDifferences) {
  at::manual_seed(3);
  const PatchMatches matches = Match(Wall(2.4, 0.3));
  const auto loss = [&](const at::Tensor& x) { return CorrespondenceLoss(x, matches); };
  EXPECT_LT(GradientError(loss, at::randn({2, kRows * kColumns, 6}, at::kDouble)), 1e-6);
}

TEST(CorrespondenceLoss, IsZeroWhereNothingMatches) {
  const PatchMatches matches = Match(Wall(100.0));
  const at::Tensor features = at::randn({2, kRows * kColumns, 6}, at::kDouble);
  const auto loss = [&](const at::Tensor& x) { return CorrespondenceLoss(x, matches); };
  EXPECT_EQ(loss(features).item<double>(), 0.0);
  EXPECT_EQ(GradientOf(loss, features).abs().max().item<double>(), 0.0);
}

}  // namespace
}  // namespace vgtw
