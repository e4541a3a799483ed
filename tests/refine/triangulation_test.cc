// SPDX-License-Identifier: BSD-3-Clause
#include "refine/triangulation.h"

#include "scene/reprojection.h"
#include "tests/support/synthetic_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// What Unproject's 1e-10 px of 500 leave at a distance of 4.
constexpr double kExact = 1e-9;

Reconstruction WithoutPoints(Reconstruction model) {
  model.points3D.clear();
  for (auto& [image_id, image] : model.images) {
    for (Point2D& point2D : image.points2D) point2D.point3D_id = kInvalidPoint3DId;
  }
  return model;
}

std::set<TrackElement> Observations(const Point3D& point) {
  return {point.track.begin(), point.track.end()};
}

void ExpectSamePoints(const Reconstruction& a, const Reconstruction& b, double tolerance) {
  ASSERT_EQ(a.points3D.size(), b.points3D.size());
  for (const auto& [id, point] : a.points3D) {
    const Point3D& other = b.points3D.at(id);
    EXPECT_LE((point.xyz - other.xyz).norm(), tolerance) << id;
    EXPECT_EQ(Observations(point), Observations(other)) << id;
  }
}

double LargestAngleDeg(const Reconstruction& model, const Point3D& point) {
  double angle_rad = 0.0;
  for (const TrackElement& a : point.track) {
    for (const TrackElement& b : point.track) {
      const Eigen::Vector3d from_a =
          point.xyz - OriginInSource(model.images.at(a.image_id).cam_from_world);
      const Eigen::Vector3d from_b =
          point.xyz - OriginInSource(model.images.at(b.image_id).cam_from_world);
      angle_rad = std::max(angle_rad, std::atan2(from_a.cross(from_b).norm(), from_a.dot(from_b)));
    }
  }
  return angle_rad * 180.0 / std::numbers::pi;
}

double ErrorOfPx(const Reconstruction& model, const TrackElement& element) {
  const Image& image = model.images.at(element.image_id);
  return ReprojectionError(model, image, image.points2D[element.point2D_idx]).value();
}

Point3DId PointOf(const Reconstruction& model, const TrackElement& element) {
  return model.images.at(element.image_id).points2D[element.point2D_idx].point3D_id;
}

TEST(TriangulateTracks, ExactTracksGiveTheirPoints) {
  for (int i = 0; i < kNumCameraModels; ++i) {
    SyntheticModelOptions options;
    options.camera_model = static_cast<CameraModel>(i);
    options.num_points = 40;
    const Reconstruction truth = MakeSyntheticModel(options);
    Reconstruction model = WithoutPoints(truth);
    const TriangulationSummary summary = TriangulateTracks({}, TracksOf(truth), model);
    SCOPED_TRACE(GetCameraModelInfo(options.camera_model).name);
    EXPECT_EQ(summary.num_tracks, 40u);
    EXPECT_EQ(summary.num_points3D, 40u);
    EXPECT_EQ(summary.num_observations, 240u);
    EXPECT_EQ(FindFault(model), "");
    ExpectSamePoints(model, truth, kExact);
    for (const auto& [id, point] : model.points3D) EXPECT_LT(point.error, 1e-6);
  }
}

TEST(TriangulateTracks, PointsOfTheModelAreStartsOnly) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction model = truth;
  PerturbPoints(model, 1.0, 1);
  const std::vector<Track> tracks = TracksOf(truth);
  TriangulateTracks({}, tracks, model);
  ExpectSamePoints(model, truth, kExact);
  // Points that no track names go.
  TriangulateTracks({}, {tracks.begin(), tracks.begin() + 10}, model);
  EXPECT_EQ(FindFault(model), "");
  EXPECT_EQ(model.points3D.size(), 10u);
}

TEST(TriangulateTracks, ColoursAreKept) {
  Reconstruction truth = MakeSyntheticModel({});
  for (auto& [id, point] : truth.points3D) point.rgb = {static_cast<uint8_t>(id), 7, 9};
  std::vector<Track> tracks = TracksOf(truth);
  // Other elements of a track than the first may be those that the old point had.
  for (Point3DId id = 1; id <= 20; ++id) {
    RemoveObservation(truth, truth.points3D.at(id).track.front());
  }
  std::reverse(tracks.begin(), tracks.end());
  Reconstruction model = truth;
  TriangulateTracks({}, tracks, model);
  ASSERT_EQ(model.points3D.size(), 120u);
  for (const auto& [id, point] : model.points3D) {
    EXPECT_EQ(point.rgb, (std::array<uint8_t, 3>{static_cast<uint8_t>(121 - id), 7, 9}));
  }
}

TEST(TriangulateTracks, ATrackOfTwoPointsBecomesBoth) {
  const Reconstruction truth = MakeSyntheticModel({});
  std::vector<Track> joined;
  for (Point3DId id = 1; id <= 120; id += 2) {
    Track& track = joined.emplace_back(truth.points3D.at(id).track);
    const Track& other = truth.points3D.at(id + 1).track;
    track.insert(track.end(), other.begin(), other.end());
  }
  Reconstruction model = WithoutPoints(truth);
  TriangulateTracks({}, joined, model);
  EXPECT_EQ(FindFault(model), "");
  ASSERT_EQ(model.points3D.size(), 120u);
  for (const auto& [id, point] : model.points3D) {
    const Point3D& true_point = truth.points3D.at(PointOf(truth, point.track.front()));
    EXPECT_EQ(Observations(point), Observations(true_point));
    // The rays of the other one, at d px, pull by scale^2 / d: at most half a scale of 2 px.
    for (const TrackElement& element : point.track) EXPECT_LT(ErrorOfPx(model, element), 1.0);
  }
}

TEST(TriangulateTracks, LeavesWrongElementsOut) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction model = WithoutPoints(truth);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> offset_px(30.0, 100.0);
  std::set<TrackElement> wrong;
  for (const auto& [id, point] : truth.points3D) {
    for (size_t i = 0; i < 2; ++i) {
      const TrackElement& element = point.track[(id + 3 * i) % 6];
      wrong.insert(element);
      Eigen::Vector2d& xy = model.images.at(element.image_id).points2D[element.point2D_idx].xy;
      xy.x() += (random() % 2 ? 1.0 : -1.0) * offset_px(random);
      xy.y() += (random() % 2 ? 1.0 : -1.0) * offset_px(random);
    }
  }
  TriangulateTracks({}, TracksOf(truth), model);
  for (const auto& [id, point] : truth.points3D) {
    std::set<TrackElement> right = Observations(point);
    std::erase_if(right, [&](const TrackElement& element) { return wrong.contains(element); });
    const Point3DId found = PointOf(model, *right.begin());
    ASSERT_NE(found, kInvalidPoint3DId);
    EXPECT_EQ(Observations(model.points3D.at(found)), right) << id;
  }
}

TEST(TriangulateTracks, ObservesOneKeypointPerImageTheBest) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction model = WithoutPoints(truth);
  std::vector<Track> tracks = TracksOf(truth);
  for (Track& track : tracks) {
    Image& image = model.images.at(3);
    const auto twin_idx = static_cast<uint32_t>(image.points2D.size());
    image.points2D.push_back(image.points2D[track.front().point2D_idx]);
    image.points2D.back().xy.x() += 2.0;
    track.insert(track.begin(), {3, twin_idx});
  }
  TriangulateTracks({}, tracks, model);
  EXPECT_EQ(FindFault(model), "");
  ASSERT_EQ(model.points3D.size(), 120u);
  for (const auto& [id, point] : model.points3D) {
    EXPECT_EQ(Observations(point), Observations(truth.points3D.at(id)));
  }
}

TEST(TriangulateTracks, ObservesWhatIsWithinTheLimit) {
  Reconstruction noisy = MakeSyntheticModel({});
  ProjectAgain(noisy, 2.0, 3);
  TriangulationOptions options;
  options.max_error_px = 3.0;
  options.min_angle_deg = 0.0;
  Reconstruction model = WithoutPoints(noisy);
  const TriangulationSummary summary = TriangulateTracks(options, TracksOf(noisy), model);
  EXPECT_EQ(FindFault(model), "");
  // Noise of 2 px per coordinate is beyond 3 px in a third of all cases.
  EXPECT_LT(summary.num_observations, 650u);
  EXPECT_GT(summary.num_observations, 400u);
  // Reprojection by rays is of first order: 3 px of 500 make 1 % of difference at most.
  for (const auto& [id, point] : model.points3D) {
    for (const TrackElement& element : point.track) {
      EXPECT_LT(ErrorOfPx(model, element), 1.01 * options.max_error_px);
    }
    const Point3DId true_id = PointOf(noisy, point.track.front());
    for (const TrackElement& element : noisy.points3D.at(true_id).track) {
      // Another point of the same track may have been nearer.
      if (PointOf(model, element) != kInvalidPoint3DId) continue;
      Point2D left_out = model.images.at(element.image_id).points2D[element.point2D_idx];
      left_out.point3D_id = id;
      EXPECT_GT(ReprojectionError(model, model.images.at(element.image_id), left_out),
                0.99 * options.max_error_px);
    }
  }
}

TEST(TriangulateTracks, AngleDecidesWhetherAPointIsOne) {
  SyntheticModelOptions narrow;
  narrow.num_images = 3;
  narrow.arc_deg = 2.0;
  const Reconstruction truth = MakeSyntheticModel(narrow);
  for (const double min_angle_deg : {0.0, 2.0, 40.0}) {
    Reconstruction model = WithoutPoints(truth);
    TriangulateTracks({4.0, min_angle_deg, 1}, TracksOf(truth), model);
    const auto num_wide =
        std::count_if(truth.points3D.begin(), truth.points3D.end(), [&](const auto& entry) {
          return LargestAngleDeg(truth, entry.second) >= min_angle_deg;
        });
    EXPECT_EQ(static_cast<ptrdiff_t>(model.points3D.size()), num_wide) << min_angle_deg;
    for (const auto& [id, point] : model.points3D) {
      EXPECT_GE(LargestAngleDeg(model, point), min_angle_deg);
    }
  }
}

TEST(TriangulateTracks, CamerasThatLookAwayObserveNothing) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction model = truth;
  Rigid3d& pose = model.images.at(2).cam_from_world;
  const Eigen::Vector3d centre = OriginInSource(pose);
  pose.rotation = RotationAboutAxis({0.0, 1.0, 0.0}, 180.0) * pose.rotation;
  pose.translation = -(pose.rotation * centre);
  TriangulateTracks({}, TracksOf(truth), model);
  EXPECT_EQ(model.points3D.size(), 120u);
  for (const Point2D& point2D : model.images.at(2).points2D) EXPECT_FALSE(point2D.HasPoint3D());
}

TEST(TriangulateTracks, DoesNotDependOnThreadsNorOnTheOrderInTracks) {
  SyntheticModelOptions options;
  options.num_points = 1000;
  Reconstruction noisy = MakeSyntheticModel(options);
  ProjectAgain(noisy, 1.0, 4);
  PerturbPoses(noisy, 0.2, 0.02, 4);
  std::vector<Track> tracks = TracksOf(noisy);
  TriangulationOptions triangulation;
  triangulation.max_error_px = 20.0;
  triangulation.num_threads = 1;
  Reconstruction one = WithoutPoints(noisy);
  TriangulateTracks(triangulation, tracks, one);
  ASSERT_GT(one.points3D.size(), 900u);

  triangulation.num_threads = 3;
  Reconstruction three = WithoutPoints(noisy);
  TriangulateTracks(triangulation, tracks, three);
  ExpectSamePoints(three, one, 0.0);

  for (Track& track : tracks) std::reverse(track.begin(), track.end());
  Reconstruction reversed = WithoutPoints(noisy);
  TriangulateTracks(triangulation, tracks, reversed);
  // Iterations end when the cost changes by less than 1e-9 of it: points by its root.
  ExpectSamePoints(reversed, one, 1e-4);
}

TEST(TriangulateTracks, TracksThatSayNothingAreNoPoints) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction model = truth;
  // Empty, single, and two keypoints of one image.
  TriangulateTracks({}, {{}, {{1, 0}}, {{2, 0}, {2, 1}}}, model);
  EXPECT_EQ(FindFault(model), "");
  EXPECT_TRUE(model.points3D.empty());
}

TEST(TriangulateTracks, RefusesTracksThatTheModelLacks) {
  Reconstruction model = MakeSyntheticModel({});
  EXPECT_THROW(TriangulateTracks({}, {{{1, 0}, {7, 0}}}, model), std::invalid_argument);
  EXPECT_THROW(TriangulateTracks({}, {{{1, 0}, {2, 120}}}, model), std::invalid_argument);
  // Two points cannot both observe a keypoint.
  const Track whole = model.points3D.at(1).track;
  const Track part(whole.begin(), whole.begin() + 3);
  EXPECT_THROW(TriangulateTracks({}, {whole, part}, model), std::invalid_argument);
  for (const TriangulationOptions& options :
       {TriangulationOptions{0.0}, TriangulationOptions{4.0, 90.0}}) {
    EXPECT_THROW(TriangulateTracks(options, {}, model), std::invalid_argument);
  }
}

}  // namespace
}  // namespace vgtw
