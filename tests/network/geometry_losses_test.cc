// SPDX-License-Identifier: BSD-3-Clause
#include "network/geometry_losses.h"

#include "network/camera_geometry.h"
#include "tests/network/gradients.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

at::Tensor RandomRotations(int64_t count) {
  return RotationsFromQuaternions(at::randn({count, 4}, at::kDouble));
}

at::Tensor Intrinsics(int64_t num_views, double focal_length, double cx, double cy) {
  return at::tensor({focal_length, 0.0, cx, 0.0, focal_length, cy, 0.0, 0.0, 1.0}, at::kDouble)
      .view({1, 3, 3})
      .repeat({num_views, 1, 1});
}

// Some depths are unknown, in each of the ways.
GeometryTruth RandomTruth(int64_t num_views) {
  GeometryTruth truth;
  truth.depth = 1.0 + at::rand({num_views, 6, 8}, at::kDouble);
  truth.depth[0][0][0] = 0.0;
  truth.depth[0][1][1] = -3.0;
  truth.depth[num_views - 1][2][2] = kNotANumber;
  truth.depth[num_views - 1][3][3] = std::numeric_limits<double>::infinity();
  truth.cam_from_world =
      at::cat({RandomRotations(num_views), at::randn({num_views, 3, 1}, at::kDouble)}, 2);
  truth.intrinsics = Intrinsics(num_views, 7.0, 4.0, 3.0);
  return truth;
}

// Encodings of cameras that look in all directions.
at::Tensor RandomEncodings(int64_t num_views) {
  const GeometryTruth truth = RandomTruth(num_views);
  return EncodePoses({truth.cam_from_world, truth.intrinsics}, 6, 8);
}

// The mean distance of known points from the origin.
double MeanDistance(const GeometryTruth& truth) {
  const at::Tensor points = Unproject(truth.depth, {truth.cam_from_world, truth.intrinsics});
  return points.norm(2, {3}).masked_select(IsKnownDepth(truth.depth)).mean().item<double>();
}

TEST(NormalisedTruth, HasTheMeanDistanceOfItsPointsAsUnit) {
  // Two pixels of one view, depth 3 and 5, 4/3 and 0 focal lengths beside the axis: distances of 5
  // and 5. The other view is 10 units to the right.
  GeometryTruth truth;
  truth.depth = at::tensor({3.0, 5.0}, at::kDouble).view({1, 1, 2}).repeat({2, 1, 1});
  truth.depth[1].fill_(0.0);
  truth.intrinsics = Intrinsics(2, 0.75, 1.0, 0.0);
  truth.cam_from_world = at::eye(3, 4, at::kDouble).unsqueeze(0).repeat({2, 1, 1});
  truth.cam_from_world[0][0][3] = 1.0;
  truth.cam_from_world[1][0][3] = -9.0;
  const auto normalised = NormaliseTruth(truth);
  ASSERT_TRUE(normalised.has_value());
  EXPECT_NEAR(normalised->scale, 5.0, 1e-12);
  EXPECT_TRUE(at::allclose(normalised->truth.depth[0][0], at::tensor({0.6, 1.0}, at::kDouble)));
  EXPECT_TRUE(at::allclose(normalised->truth.cam_from_world[0], at::eye(3, 4, at::kDouble)));
  EXPECT_NEAR(normalised->truth.cam_from_world[1][0][3].item<double>(), -2.0, 1e-12);
}

TEST(NormalisedTruth, IsSeenFromTheFirstCamera) {
  at::manual_seed(1);
  const GeometryTruth truth = RandomTruth(4);
  const auto by_all = NormaliseTruth(truth);
  const auto by_first = NormaliseTruth(truth, ScaleViews::kFirst);
  ASSERT_TRUE(by_all && by_first);
  for (const auto& normalised : {by_all, by_first}) {
    EXPECT_TRUE(
        at::allclose(normalised->truth.cam_from_world[0], at::eye(3, 4, at::kDouble), 0.0, 1e-12));
  }
  EXPECT_NEAR(MeanDistance(by_all->truth), 1.0, 1e-12);
  const auto first_of = [](const GeometryTruth& all) {
    return GeometryTruth{
        all.depth.slice(0, 0, 1), all.cam_from_world.slice(0, 0, 1), all.intrinsics.slice(0, 0, 1)};
  };
  EXPECT_NEAR(MeanDistance(first_of(by_first->truth)), 1.0, 1e-12);
  EXPECT_GT(std::abs(MeanDistance(by_first->truth) - 1.0), 1e-3);
}

TEST(NormalisedTruth, IsTheSameForSimilarWorlds) {
  at::manual_seed(2);
  const GeometryTruth truth = RandomTruth(3);
  // x' = s R x + t; cameras keep their orientation in it: cam_from_world' = [R_c R^T | s t_c -
  // ...].
  const double s = 37.0;
  const at::Tensor rotation = RandomRotations(1)[0];
  const at::Tensor translation = at::tensor({5e5, -4e6, 300.0}, at::kDouble).unsqueeze(1);
  GeometryTruth other = truth;
  other.depth = s * truth.depth;
  const at::Tensor rotations = at::matmul(truth.cam_from_world.slice(2, 0, 3), rotation.t());
  other.cam_from_world = at::cat(
      {rotations, s * truth.cam_from_world.slice(2, 3) - at::matmul(rotations, translation)}, 2);
  const auto a = NormaliseTruth(truth);
  const auto b = NormaliseTruth(other);
  ASSERT_TRUE(a && b);
  EXPECT_NEAR(b->scale / a->scale, s, 1e-7);
  // Its origin is some 1e5 normalised units away, to 16 digits.
  EXPECT_TRUE(at::allclose(a->truth.depth, b->truth.depth, 1e-9));
  EXPECT_TRUE(at::allclose(a->truth.cam_from_world, b->truth.cam_from_world, 0.0, 1e-9));
}

TEST(NormalisedTruth, NeedsAKnownDepth) {
  GeometryTruth truth = RandomTruth(2);
  truth.depth[0].fill_(kNotANumber);
  EXPECT_FALSE(NormaliseTruth(truth, ScaleViews::kFirst).has_value());
  EXPECT_TRUE(NormaliseTruth(truth).has_value());
  truth.depth.fill_(0.0);
  EXPECT_FALSE(NormaliseTruth(truth).has_value());
}

TEST(CameraLoss, IsZeroAtTheTruth) {
  at::manual_seed(3);
  const at::Tensor truth = RandomEncodings(5);
  at::Tensor other = truth.clone();
  other.slice(1, 3, 7).neg_();  // the same rotations
  for (const double huber_scale : {0.0, 0.1}) {
    for (const at::Tensor& found : {truth, other}) {
      const LossFunction loss = [&](const at::Tensor& x) {
        return CameraLoss({x, x}, truth, {.huber_scale = huber_scale});
      };
      EXPECT_EQ(loss(found).item<double>(), 0.0);
      EXPECT_EQ(GradientOf(loss, found).abs().max().item<double>(), 0.0);
    }
  }
}

TEST(CameraLoss, WeighsPartsAndIterations) {
  at::manual_seed(4);
  const at::Tensor truth = RandomEncodings(2);
  const auto off_by = [&](int64_t column, double error) {
    at::Tensor found = truth.clone();
    found[1][column] += error;
    return found;
  };
  // Errors of one element out of 2 x 3, 2 x 4 and 2 x 2.
  EXPECT_NEAR(CameraLoss({off_by(1, 0.6)}, truth).item<double>(), 0.1, 1e-12);
  EXPECT_NEAR(CameraLoss({off_by(4, 0.08)}, truth).item<double>(), 0.01, 1e-12);
  EXPECT_NEAR(CameraLoss({off_by(8, 0.4)}, truth).item<double>(), 0.5 * 0.1, 1e-12);
  EXPECT_NEAR(CameraLoss({off_by(1, 0.6), truth, truth}, truth).item<double>(),
              0.6 * 0.6 * 0.1 / 3.0,
              1e-12);
  EXPECT_NEAR(CameraLoss({truth, truth, off_by(1, 0.6)}, truth).item<double>(), 0.1 / 3.0, 1e-12);
  // |0.6| - 0.2 / 2, and 0.1^2 / (2 0.2), of one element out of 6.
  const CameraLossOptions huber = {.huber_scale = 0.2};
  EXPECT_NEAR(CameraLoss({off_by(1, 0.6)}, truth, huber).item<double>(), 0.5 / 6.0, 1e-12);
  EXPECT_NEAR(CameraLoss({off_by(1, 0.1)}, truth, huber).item<double>(), 0.025 / 6.0, 1e-12);
}

TEST(CameraLoss, GradientsAreThoseOfDifferences) {
  at::manual_seed(5);
  const at::Tensor truth = RandomEncodings(4);
  const at::Tensor found = at::randn({3, 4, 9}, at::kDouble);
  for (const double huber_scale : {0.0, 0.5}) {
    const LossFunction loss = [&](const at::Tensor& x) {
      return CameraLoss(x.unbind(0), truth, {.huber_scale = huber_scale});
    };
    EXPECT_LT(GradientError(loss, found), 1e-8);
  }
}

TEST(DepthLoss, IsTheSumOfItsParts) {
  // Errors 0.5, -0.5, 0 and one unknown in a row; confidences 2.
  const at::Tensor truth = at::tensor({1.0, 2.0, 3.0, 0.0}, at::kDouble).view({1, 1, 4});
  const at::Tensor depth = at::tensor({1.5, 1.5, 3.0, 9.0}, at::kDouble).view({1, 1, 4});
  const at::Tensor confidence = at::full({1, 1, 4}, 2.0, at::kDouble);
  const double regression = (2.0 * (0.5 + 0.5) - 3.0 * 0.2 * std::log(2.0)) / 3.0;
  const auto loss = [&](double weight, int num_scales) {
    const MapLossOptions options = {.gradient_weight = weight, .num_gradient_scales = num_scales};
    return DepthLoss(depth, confidence, truth, options).item<double>();
  };
  EXPECT_NEAR(loss(1.0, 0), regression, 1e-15);
  EXPECT_NEAR(loss(0.0, 3), regression, 1e-15);
  // Differences 1 and 0.5; of every 2nd pixel 0.5; of every 4th none.
  EXPECT_NEAR(loss(3.0, 1), regression + 3.0 * 0.75, 1e-15);
  EXPECT_NEAR(loss(3.0, 2), regression + 3.0 * (0.75 + 0.5), 1e-15);
  EXPECT_NEAR(loss(3.0, 5), loss(3.0, 2), 1e-15);
}

TEST(DepthLoss, IsZeroAtTheTruthButForTheConfidence) {
  at::manual_seed(6);
  const at::Tensor truth = RandomTruth(2).depth;
  const at::Tensor depth = at::where(IsKnownDepth(truth), truth, 5.0);
  const at::Tensor certain = at::ones_like(truth);
  const LossFunction by_depth = [&](const at::Tensor& x) { return DepthLoss(x, certain, truth); };
  EXPECT_EQ(by_depth(depth).item<double>(), 0.0);
  EXPECT_EQ(GradientOf(by_depth, depth).abs().max().item<double>(), 0.0);
  const LossFunction by_confidence = [&](const at::Tensor& x) {
    return DepthLoss(depth, x, truth);
  };
  const at::Tensor is_known = IsKnownDepth(truth).to(at::kDouble);
  EXPECT_TRUE(at::allclose(GradientOf(by_confidence, certain), -0.2 * is_known / is_known.sum()));
}

TEST(DepthLoss, PrefersTheConfidenceThatFitsTheError) {
  const at::Tensor truth = at::ones({1, 2, 2}, at::kDouble);
  const LossFunction loss = [&](const at::Tensor& x) {
    return DepthLoss(truth + 0.1, x, truth, {.alpha = 0.3});
  };
  EXPECT_LT(GradientOf(loss, at::full_like(truth, 3.0)).abs().max().item<double>(), 1e-15);
}

TEST(DepthLoss, GradientsAreThoseOfDifferences) {
  at::manual_seed(7);
  const at::Tensor truth = RandomTruth(2).depth;
  const at::Tensor depth = at::rand_like(truth) + 1.0;
  const at::Tensor confidence = at::rand_like(truth) + 1.0;
  EXPECT_LT(
      GradientError([&](const at::Tensor& x) { return DepthLoss(x, confidence, truth); }, depth),
      1e-7);
  EXPECT_LT(
      GradientError([&](const at::Tensor& x) { return DepthLoss(depth, x, truth); }, confidence),
      1e-7);
}

TEST(PointLoss, IsZeroAtTheTruthButForTheConfidence) {
  at::manual_seed(4);
  const GeometryTruth truth = RandomTruth(3);
  const at::Tensor is_known = IsKnownDepth(truth.depth);
  const at::Tensor points = Unproject(truth.depth.masked_fill(is_known.logical_not(), 0.0),
                                      {truth.cam_from_world, truth.intrinsics});
  const at::Tensor certain = at::ones_like(truth.depth);
  const LossFunction by_points = [&](const at::Tensor& x) { return PointLoss(x, certain, truth); };
  EXPECT_NEAR(by_points(points).item<double>(), 0.0, 1e-12);
  EXPECT_NEAR(GradientOf(by_points, points).abs().max().item<double>(), 0.0, 1e-12);
  // Two of three coordinates are right.
  at::Tensor beside = points.clone();
  beside.select(3, 1).add_(0.3);
  EXPECT_NEAR(by_points(beside).item<double>(), 0.1, 1e-9);
}

TEST(PointLoss, GradientsAreThoseOfDifferences) {
  at::manual_seed(5);
  const GeometryTruth truth = RandomTruth(2);
  const at::Tensor points = at::randn({2, 6, 8, 3}, at::kDouble);
  const at::Tensor confidence = 1.0 + at::rand({2, 6, 8}, at::kDouble);
  EXPECT_LT(
      GradientError([&](const at::Tensor& x) { return PointLoss(x, confidence, truth); }, points),
      1e-6);
  EXPECT_LT(
      GradientError([&](const at::Tensor& x) { return PointLoss(points, x, truth); }, confidence),
      1e-6);
}

TEST(DepthLoss, OfNothingKnownIsZero) {
  const at::Tensor ones = at::ones({2, 3, 4});
  const LossFunction loss = [&](const at::Tensor& x) {
    return DepthLoss(x, 2.0 * ones, at::full({2, 3, 4}, kNotANumber));
  };
  EXPECT_EQ(loss(ones).item<float>(), 0.0f);
  EXPECT_EQ(GradientOf(loss, ones).abs().max().item<float>(), 0.0f);
}

TEST(GeometryLosses, RefuseWhatDoesNotFit) {
  const at::Tensor ones = at::ones({2, 9});
  EXPECT_THROW(CameraLoss({}, ones), std::invalid_argument);
  EXPECT_THROW(CameraLoss({at::ones({3, 9})}, ones), std::invalid_argument);
  EXPECT_THROW(CameraLoss({ones}, ones, {.iteration_decay = 0.0}), std::invalid_argument);
  const at::Tensor depth = at::ones({1, 2, 3});
  EXPECT_THROW(DepthLoss(depth, depth, at::ones({1, 3, 2})), std::invalid_argument);
  EXPECT_THROW(DepthLoss(depth, depth, depth, {.alpha = 0.0}), std::invalid_argument);
  EXPECT_THROW(NormaliseTruth({depth, at::ones({2, 3, 4}), at::ones({1, 3, 3})}),
               std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
