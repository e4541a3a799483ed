// SPDX-License-Identifier: BSD-3-Clause
// The sparse model that ApplyMasks cleans along with its database.
#include "bridge/colmap_model.h"
#include "bridge/mask_apply.h"
#include "tests/bridge/sample_masks.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// A model of MakeSampleDatabase. Points and their observations (image_id, point2D_idx); the masks
// exclude 0 and 3 of image 1, 4 of image 2 and 1, 2, 3 of image 3:
//   10: (1, 0)x (2, 0)         11: (1, 1) (2, 1) (3, 1)x     12: (1, 2) (2, 2) (3, 0)
//   13: (2, 4)x (3, 2)x (1, 3)x
Reconstruction SampleModelOfDatabase(const ColmapDatabase& database) {
  Reconstruction model;
  for (const Camera& camera : database.ReadCameras()) model.cameras[camera.camera_id] = camera;
  for (const DatabaseImage& row : database.ReadImages()) {
    Image& image = model.images[row.image_id];
    image = {row.image_id, row.camera_id, row.name, {}, {}};
    image.cam_from_world.translation.x() = 0.5 * row.image_id;
    const Keypoints keypoints = database.ReadKeypoints(row.image_id).value();
    for (size_t i = 0; i < keypoints.rows; ++i) {
      image.points2D.push_back({{keypoints.x(i), keypoints.y(i)}});
    }
  }
  const std::map<Point3DId, std::vector<TrackElement>> tracks = {{10, {{1, 0}, {2, 0}}},
                                                                 {11, {{1, 1}, {2, 1}, {3, 1}}},
                                                                 {12, {{1, 2}, {2, 2}, {3, 0}}},
                                                                 {13, {{2, 4}, {3, 2}, {1, 3}}}};
  for (const auto& [point3D_id, track] : tracks) {
    model.points3D[point3D_id] = {{0.0, 0.0, 5.0}, {1, 2, 3}, 1.25, track};
    for (const auto& [image_id, idx] : track) {
      model.images.at(image_id).points2D[idx].point3D_id = point3D_id;
    }
  }
  return model;
}

class MaskModelTest : public testing::Test {
 protected:
  MaskModelTest() {
    MakeSampleDatabase(folder_ / "a.db");
    {
      ColmapDatabase database(folder_ / "a.db", ColmapDatabase::Mode::kReadWrite);
      ColmapDatabase::Transaction transaction(database);
      // Links keypoint 0 of image 3 to kept ones alone.
      database.WriteTwoViewGeometry(1, 3, {.config = 2, .inlier_matches = {{1, 0}}});
      database.WriteTwoViewGeometry(2, 3, {.config = 2, .inlier_matches = {{0, 1}, {4, 1}}});
      transaction.Commit();
    }
    WriteSampleMasks(folder_ / "masks");
    model_ =
        SampleModelOfDatabase(ColmapDatabase(folder_ / "a.db", ColmapDatabase::Mode::kReadOnly));
  }

  // Writes model_, applies masks to it and the database, and returns what was written.
  Reconstruction ApplyTo(MaskRule rule,
                         ModelFormat format = ModelFormat::kBinary,
                         int min_num_inliers = 0) {
    WriteModel(model_, folder_ / "sparse", {.format = format, .overwrite = true});
    summary_ = ApplyMasks(folder_ / "a.db",
                          folder_ / "masks",
                          folder_ / "b.db",
                          {.rule = rule,
                           .min_num_inliers = min_num_inliers,
                           .model_path = folder_ / "sparse",
                           .model_output_path = folder_ / "static",
                           .overwrite = true})
                   .model.value();
    return ReadModel(folder_ / "static");
  }

  static std::vector<Point3DId> PointsOf(const Reconstruction& model) {
    std::vector<Point3DId> points;
    for (const auto& [point3D_id, point] : model.points3D) points.push_back(point3D_id);
    return points;
  }

  const TemporaryFolder folder_;
  Reconstruction model_;
  ApplyMasksModelSummary summary_;
};

TEST_F(MaskModelTest, TheMatchesRuleRemovesObservationsAndPointsWithOneLeft) {
  const Reconstruction masked = ApplyTo(MaskRule::kMatches);
  EXPECT_EQ(PointsOf(masked), (std::vector<Point3DId>{11, 12}));
  EXPECT_EQ(masked.points3D.at(11).track, (std::vector<TrackElement>{{1, 1}, {2, 1}}));
  EXPECT_EQ(masked.points3D.at(12).track, model_.points3D.at(12).track);
  EXPECT_EQ(masked.images.at(1).points2D.size(), 4u);
  EXPECT_FALSE(masked.images.at(1).points2D[0].HasPoint3D());
  EXPECT_EQ(summary_.num_observations_before, 11u);
  EXPECT_EQ(summary_.num_observations_after, 5u);
  EXPECT_EQ(summary_.num_points3D_before, 4u);
  EXPECT_EQ(summary_.num_points3D_after, 2u);
}

// The point projects to (50, 40) + 90 * 0.5 * image_id / 5 in x: (59, 40) and (68, 40). Its
// observations left are at (99.9, 79.9).
TEST_F(MaskModelTest, OnlyTheErrorOfAChangedPointIsComputedAnew) {
  const Reconstruction masked = ApplyTo(MaskRule::kMatches);
  const double expected = (std::hypot(40.9, 39.9) + std::hypot(31.9, 39.9)) / 2.0;
  // The keypoints are floats: 99.9 is off by 2e-6.
  EXPECT_NEAR(masked.points3D.at(11).error, expected, 1e-5);
  EXPECT_EQ(masked.points3D.at(12).error, 1.25);
}

TEST_F(MaskModelTest, TheTracksRuleRemovesPointsWithAnExcludedObservation) {
  EXPECT_EQ(PointsOf(ApplyTo(MaskRule::kTracks)), (std::vector<Point3DId>{12}));
  EXPECT_EQ(summary_.num_observations_after, 3u);
}

// ReadModel checks that tracks and points2D name each other; these are also the database's indices.
TEST_F(MaskModelTest, TheKeypointsRuleGivesTheIndicesOfTheDatabase) {
  const Reconstruction masked = ApplyTo(MaskRule::kKeypoints);
  EXPECT_EQ(PointsOf(masked), (std::vector<Point3DId>{11, 12}));
  EXPECT_EQ(masked.points3D.at(11).track, (std::vector<TrackElement>{{1, 0}, {2, 1}}));
  EXPECT_EQ(masked.points3D.at(12).track, (std::vector<TrackElement>{{1, 1}, {2, 2}, {3, 0}}));
  const ColmapDatabase database(folder_ / "b.db", ColmapDatabase::Mode::kReadOnly);
  for (const auto& [image_id, image] : masked.images) {
    const Keypoints keypoints = database.ReadKeypoints(image_id).value();
    ASSERT_EQ(image.points2D.size(), keypoints.rows);
    for (size_t i = 0; i < keypoints.rows; ++i) {
      EXPECT_EQ(image.points2D[i].xy, Eigen::Vector2d(keypoints.x(i), keypoints.y(i)));
    }
  }
}

// At least 15 inlier matches empty the geometries of image 2, both of which lost rows.
TEST_F(MaskModelTest, AnImageWhoseLastGeometryWentKeepsItsPoseAlone) {
  for (const MaskRule rule : {MaskRule::kMatches, MaskRule::kKeypoints}) {
    const Reconstruction masked = ApplyTo(rule, ModelFormat::kBinary, 15);
    EXPECT_EQ(PointsOf(masked), (std::vector<Point3DId>{12}));
    const uint32_t idx = rule == MaskRule::kMatches ? 2 : 1;
    EXPECT_EQ(masked.points3D.at(12).track, (std::vector<TrackElement>{{1, idx}, {3, 0}}));
    EXPECT_TRUE(masked.images.at(2).points2D.empty());
    EXPECT_FALSE(masked.images.at(1).points2D.empty());
  }
}

TEST_F(MaskModelTest, TheFormatIsThatOfTheModelRead) {
  model_.images.at(3).name = "cd.jpg";  // text has no names with spaces
  {
    SqliteConnection connection(folder_ / "a.db", SqliteConnection::Mode::kReadWrite);
    connection.Execute("UPDATE images SET name = 'cd.jpg' WHERE image_id = 3");
    WriteImage(MaskPath(folder_ / "masks", "cd.jpg"), StaticMask(100, 80, 255));
  }
  ApplyTo(MaskRule::kMatches, ModelFormat::kText);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "static/points3D.txt"));
  ApplyTo(MaskRule::kMatches, ModelFormat::kBinary);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "static/points3D.bin"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "static/points3D.txt"));
}

TEST_F(MaskModelTest, AModelOfAnotherDatabaseIsRefusedAndNothingWritten) {
  const auto error_of = [&](const std::filesystem::path& output_path) {
    WriteModel(model_, folder_ / "sparse", {.overwrite = true});
    const auto before = Snapshot(folder_.path());
    const std::string error = ErrorOf([&] {
      ApplyMasks(
          folder_ / "a.db",
          folder_ / "masks",
          "",
          {.model_path = folder_ / "sparse", .model_output_path = output_path, .in_place = true});
    });
    EXPECT_EQ(Snapshot(folder_.path()), before);
    return error;
  };
  EXPECT_THAT(error_of(folder_ / "sparse"), HasSubstr("sparse: is the model to be read"));
  EXPECT_THAT(error_of(folder_ / "masks"), HasSubstr("masks"));  // exists
  model_.images.at(2).points2D.push_back({});
  EXPECT_THAT(error_of(folder_ / "static"),
              HasSubstr("has 6 points2D in image 2 'sub/b.png', expected the database's 5"));
  model_.images.at(2).points2D.pop_back();
  model_.images.at(2).name = "b.png";
  EXPECT_THAT(error_of(folder_ / "static"),
              HasSubstr("has image 2 'b.png', which is not the database's"));
}

}  // namespace
}  // namespace vgtw
