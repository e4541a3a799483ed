// SPDX-License-Identifier: BSD-3-Clause
#include "refine/refine_round.h"

#include "refine/align.h"
#include "scene/reprojection.h"
#include "tests/support/synthetic_model.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

RoundLimits SameLimits(double max_error_px, const Reconstruction& model) {
  RoundLimits limits;
  limits.final_px = 4.0;
  for (const auto& [id, image] : model.images) limits.max_error_px[id] = max_error_px;
  return limits;
}

bool AreBitEqual(const Rigid3d& a, const Rigid3d& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

// A point that the given images see.
void AddPoint(const std::vector<ImageId>& image_ids, Reconstruction& model) {
  Point3D& point3D = model.points3D[model.points3D.size() + 1];
  for (const ImageId id : image_ids) {
    Image& image = model.images[id];
    point3D.track.push_back({id, static_cast<uint32_t>(image.points2D.size())});
    image.points2D.push_back({{1.0, 1.0}, model.points3D.size()});
  }
}

TEST(NumSupportingObservations, CountsPointsThatThreeImagesSee) {
  Reconstruction model;
  AddPoint({1, 2}, model);
  AddPoint({1, 2, 3}, model);
  AddPoint({2, 3, 4, 5}, model);
  model.images[6];
  EXPECT_EQ(NumSupportingObservations(model),
            (std::map<ImageId, size_t>{{1, 1}, {2, 2}, {3, 2}, {4, 1}, {5, 1}, {6, 0}}));
}

TEST(NumSupportingObservations, OfTwoImagesEveryPointCounts) {
  Reconstruction model;
  AddPoint({1, 2}, model);
  AddPoint({1, 2}, model);
  EXPECT_EQ(NumSupportingObservations(model), (std::map<ImageId, size_t>{{1, 2}, {2, 2}}));
}

TEST(RoundLimits, BecomeTighter) {
  RoundLimits limits;
  limits.final_px = 4.0;
  limits.max_error_px = {{1, 60.0}, {2, 30.0}, {3, 5.0}};
  EXPECT_EQ(limits.MedianPx(), 30.0);
  EXPECT_FALSE(limits.IsFinal());
  limits.Tighten({{1, 2.0}, {2, 100.0}, {3, 0.1}});
  // Six medians, at most what it was, at least the final limit.
  EXPECT_EQ(limits.max_error_px, (std::map<ImageId, double>{{1, 12.0}, {2, 30.0}, {3, 4.0}}));
  limits.Tighten({{2, 0.0}, {1, 0.0}});
  EXPECT_EQ(limits.MedianPx(), 4.0);
  EXPECT_TRUE(limits.IsFinal());
  EXPECT_TRUE(RoundLimits{}.IsFinal());
}

TEST(RoundLimits, AreTighterOnlyByAShareThatMatters) {
  RoundLimits before;
  before.max_error_px = {{1, 60.0}, {2, 30.0}};
  RoundLimits limits = before;
  EXPECT_FALSE(limits.IsTighterThan(before));
  limits.max_error_px = {{1, 80.0}, {2, 28.0}};
  EXPECT_FALSE(limits.IsTighterThan(before));
  limits.max_error_px = {{1, 80.0}, {2, 26.0}};
  EXPECT_TRUE(limits.IsTighterThan(before));
}

TEST(RoundLimits, AreWidenedUpToTheWorst) {
  RoundLimits limits;
  limits.worst_px = 50.0;
  limits.max_error_px = {{1, 60.0}, {2, 30.0}, {3, 5.0}};
  EXPECT_TRUE(limits.Widen());
  EXPECT_EQ(limits.max_error_px, (std::map<ImageId, double>{{1, 60.0}, {2, 50.0}, {3, 10.0}}));
  limits.max_error_px.erase(3);
  EXPECT_FALSE(limits.Widen());
}

TEST(RunRefineRound, AdjustsFromTracksAlone) {
  const Reconstruction truth = MakeSyntheticModel({});
  const std::vector<Track> tracks = TracksOf(truth);
  Reconstruction model = truth;
  PerturbPoses(model, 0.5, 0.05, 1);
  PerturbPoints(model, 2.0, 1);
  BundlePriors priors;
  const RoundOutcome outcome =
      RunRefineRound({}, tracks, {}, SameLimits(80.0, model), priors, model);
  EXPECT_EQ(outcome.adjusted, (std::set<ImageId>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(FindFault(model), "");
  EXPECT_EQ(model.points3D.size(), 120u);
  // Exact data: one round ends where the coarse tolerance lets it, far below a pixel.
  for (const auto& [id, median_px] : outcome.median_px) EXPECT_LT(median_px, 0.05);
  Transform(AlignPoses(model, truth), model);
  for (const auto& [id, image] : model.images) {
    EXPECT_LT(
        AngleBetweenDeg(image.cam_from_world.rotation, truth.images.at(id).cam_from_world.rotation),
        0.05);
  }
}

TEST(RunRefineRound, HeldImagesTakeNoPart) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction model = truth;
  PerturbPoses(model, 0.5, 0.05, 2);
  const Reconstruction before = model;
  BundlePriors priors;
  const RoundOutcome outcome =
      RunRefineRound({}, TracksOf(truth), {2, 5}, SameLimits(80.0, model), priors, model);
  EXPECT_EQ(outcome.adjusted, (std::set<ImageId>{1, 3, 4, 6}));
  for (const ImageId id : {2, 5}) {
    const Image& image = model.images.at(id);
    EXPECT_TRUE(AreBitEqual(image.cam_from_world, before.images.at(id).cam_from_world));
    EXPECT_EQ(model.cameras.at(image.camera_id), before.cameras.at(image.camera_id));
    for (const Point2D& point2D : image.points2D) EXPECT_FALSE(point2D.HasPoint3D());
  }
}

TEST(RunRefineRound, WeakImagesTakeNoPart) {
  const Reconstruction truth = MakeSyntheticModel({});
  std::vector<Track> tracks = TracksOf(truth);
  // Image 4 sees 20 points.
  for (size_t i = 20; i < tracks.size(); ++i) {
    std::erase_if(tracks[i], [](const TrackElement& element) { return element.image_id == 4; });
  }
  Reconstruction model = truth;
  PerturbPoses(model, 0.5, 0.05, 3);
  const Reconstruction before = model;
  BundlePriors priors;
  const RoundOutcome outcome =
      RunRefineRound({}, tracks, {}, SameLimits(80.0, model), priors, model);
  EXPECT_EQ(outcome.adjusted, (std::set<ImageId>{1, 2, 3, 5, 6}));
  EXPECT_TRUE(AreBitEqual(model.images.at(4).cam_from_world, before.images.at(4).cam_from_world));
  EXPECT_EQ(model.cameras.at(4), before.cameras.at(4));
}

TEST(RunRefineRound, NothingToAdjustChangesNothing) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction model = truth;
  PerturbPoses(model, 0.5, 0.05, 4);
  const Reconstruction before = model;
  const std::vector<Track> tracks = TracksOf(truth);
  for (const std::vector<Track>& few :
       {std::vector<Track>{}, std::vector<Track>(tracks.begin(), tracks.begin() + 10)}) {
    BundlePriors priors;
    const RoundOutcome outcome =
        RunRefineRound({}, few, {}, SameLimits(80.0, model), priors, model);
    EXPECT_TRUE(outcome.adjusted.empty());
    EXPECT_EQ(model.cameras, before.cameras);
    for (const auto& [id, image] : model.images) {
      EXPECT_TRUE(AreBitEqual(image.cam_from_world, before.images.at(id).cam_from_world));
    }
  }
}

}  // namespace
}  // namespace vgtw
