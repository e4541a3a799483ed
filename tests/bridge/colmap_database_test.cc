// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_database.h"

#include "tests/bridge/sample_databases.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;
using Mode = ColmapDatabase::Mode;
using Transaction = ColmapDatabase::Transaction;

Camera MakeCamera(CameraId camera_id) {
  Camera camera = MakePinhole(640, 480, 500.0, 501.0);
  camera.camera_id = camera_id;
  camera.has_prior_focal_length = camera_id % 2 == 0;
  return camera;
}

void WriteImages(ColmapDatabase& database) {
  for (const CameraId camera_id : {49, 50}) database.WriteCamera(MakeCamera(camera_id));
  database.WriteImage({4, "sub folder/b.jpg", 49});
  database.WriteImage({2, "a.jpg", 50});
}

TEST(PairId, IsThatOfColmap) {
  EXPECT_EQ(PairIdFromImageIds(7, 3), 6442450948u);  // 2147483647 * 3 + 7
  EXPECT_EQ(PairIdFromImageIds(3, 7), 6442450948u);
  EXPECT_THAT(ImageIdsFromPairId(6442450948u), Pair(3, 7));
  EXPECT_THROW(PairIdFromImageIds(3, 3), std::invalid_argument);
  EXPECT_THROW(PairIdFromImageIds(3, 2147483647), std::invalid_argument);
}

TEST(ColmapDatabase, WhatIsWrittenIsRead) {
  const TemporaryFolder folder;
  const Keypoints keypoints{2, 4, {1.5f, 2.5f, 3, 4, 5, 6, 7, 8}};
  const Descriptors descriptors{2, 3, 1, {1, 2, 3, 4, 5, 255}};
  {
    ColmapDatabase database = ColmapDatabase::Create(folder / "a.db");
    Transaction transaction(database);
    WriteImages(database);
    database.WriteKeypoints(4, keypoints);
    database.WriteDescriptors(4, descriptors);
    transaction.Commit();
  }
  const ColmapDatabase database(folder / "a.db", Mode::kReadOnly);
  EXPECT_EQ(database.ReadCameras(), (std::vector<Camera>{MakeCamera(49), MakeCamera(50)}));
  const auto images = database.ReadImages();
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[0].name, "a.jpg");
  EXPECT_EQ(images[1].image_id, 4u);
  EXPECT_EQ(images[1].name, "sub folder/b.jpg");
  EXPECT_EQ(images[1].camera_id, 49u);
  EXPECT_EQ(database.ReadKeypoints(4)->data, keypoints.data);
  EXPECT_EQ(database.ReadKeypoints(4)->y(1), 6.0f);
  EXPECT_FALSE(database.ReadKeypoints(2));
  EXPECT_EQ(database.ReadDescriptors(4)->data, descriptors.data);
  EXPECT_EQ(database.ReadDescriptors(4)->type, 1);
  EXPECT_FALSE(database.ReadDescriptors(2));
}

TEST(ColmapDatabase, WritingAgainReplacesByIdAndKeepsOtherColumns) {
  const TemporaryFolder folder;
  ColmapDatabase::Create(folder / "a.db");
  RunSql(folder / "a.db", "INSERT INTO images VALUES (2, 'old.jpg', 1, 0.5, 0, 0, 0, 1, 2, 3);");
  {
    ColmapDatabase database(folder / "a.db", Mode::kReadWrite);
    Transaction transaction(database);
    WriteImages(database);
    transaction.Commit();
  }
  SqliteConnection connection(folder / "a.db", SqliteConnection::Mode::kReadOnly);
  SqliteQuery query(connection, "SELECT name, prior_tz FROM images WHERE image_id = 2");
  ASSERT_TRUE(query.Next());
  EXPECT_EQ(query.Text(0), "a.jpg");
  EXPECT_EQ(query.Int(1), 3);
}

TEST(ColmapDatabase, MatchesFollowTheOrderOfTheArguments) {
  const TemporaryFolder folder;
  ColmapDatabase database = ColmapDatabase::Create(folder / "a.db");
  Transaction transaction(database);
  database.WriteMatches(7, 3, {{70, 30}, {71, 31}});
  database.WriteMatches(1, 3, {});
  EXPECT_EQ(database.ReadMatches(7, 3), (FeatureMatches{{70, 30}, {71, 31}}));
  EXPECT_EQ(database.ReadMatches(3, 7), (FeatureMatches{{30, 70}, {31, 71}}));
  EXPECT_TRUE(database.ReadMatches(1, 3).empty());
  EXPECT_TRUE(database.ReadMatches(1, 2).empty());
  EXPECT_THAT(database.ReadMatchPairs(), ElementsAre(Pair(1, 3), Pair(3, 7)));
  database.WriteTwoViewGeometry(3, 7, {});
  database.ClearMatches();
  EXPECT_TRUE(database.ReadMatchPairs().empty());
  EXPECT_TRUE(database.ReadTwoViewPairs().empty());
}

// x2^T F x1 = 0 and x2 ~ H x1 hold for one made-up pair of points in both orders of the images.
TEST(ColmapDatabase, TwoViewGeometryIsInvertedWithTheOrder) {
  const TemporaryFolder folder;
  const Eigen::Vector3d x1(0.3, -0.2, 1.0);
  TwoViewGeometry geometry;
  geometry.config = 2;
  geometry.inlier_matches = {{5, 6}};
  geometry.cam2_from_cam1 = Rigid3d{RotationAboutAxis({0, 1, 0}, 30.0), {1.0, 2.0, 3.0}};
  geometry.H = Eigen::Matrix3d{{1, 2, 3}, {0, 1, 4}, {0.5, 0, 1}};
  const Eigen::Vector3d x2 = *geometry.H * x1;
  const Eigen::Vector3d t(1, 2, 3);
  geometry.F = Eigen::Matrix3d{{0, -t.z(), t.y()}, {t.z(), 0, -t.x()}, {-t.y(), t.x(), 0}};
  geometry.E = *geometry.F * 2.0;

  ColmapDatabase database = ColmapDatabase::Create(folder / "a.db");
  Transaction transaction(database);
  database.WriteTwoViewGeometry(9, 4, geometry);  // image 1 of the law is image 9
  const TwoViewGeometry same = database.ReadTwoViewGeometry(9, 4).value();
  const TwoViewGeometry swapped = database.ReadTwoViewGeometry(4, 9).value();
  EXPECT_THAT(database.ReadTwoViewPairs(), ElementsAre(Pair(4, 9)));
  EXPECT_EQ(same.config, 2);
  EXPECT_EQ(same.inlier_matches, (FeatureMatches{{5, 6}}));
  EXPECT_EQ(swapped.inlier_matches, (FeatureMatches{{6, 5}}));
  EXPECT_EQ(same.F, geometry.F);
  EXPECT_EQ(swapped.F, geometry.F->transpose());
  EXPECT_EQ(swapped.E, geometry.E->transpose());
  // Inverting twice rounds: relative error of a few ulp.
  EXPECT_LT((*swapped.H * x2 - x1).norm(), 1e-14);
  EXPECT_LT((*same.H - *geometry.H).norm(), 1e-14);
  const Eigen::Vector3d point_in_cam1(0.1, 0.2, 5.0);
  const Eigen::Vector3d point_in_cam2 = *geometry.cam2_from_cam1 * point_in_cam1;
  EXPECT_LT((*same.cam2_from_cam1 * point_in_cam1 - point_in_cam2).norm(), 1e-14);
  EXPECT_LT((*swapped.cam2_from_cam1 * point_in_cam2 - point_in_cam1).norm(), 1e-14);
}

// Blobs of a geometry that is not set, by SQL.
std::string RawGeometry(const std::filesystem::path& path) {
  SqliteConnection connection(path, SqliteConnection::Mode::kReadOnly);
  SqliteQuery query(connection,
                    "SELECT quote(F) || quote(H) || quote(qvec) || quote(tvec), "
                    "F = zeroblob(72) AND E = zeroblob(72) AND H = zeroblob(72) AND "
                    "tvec = zeroblob(24) AND "
                    "qvec = x'000000000000F03F000000000000000000000000000000000000000000000000' "
                    "FROM two_view_geometries");
  EXPECT_TRUE(query.Next());
  return query.Int(1) == 1 ? "zero" : query.Text(0);
}

TEST(ColmapDatabase, WhatIsNotSetIsStoredAsTheVersionDoes) {
  const TemporaryFolder folder;
  for (const VersionTables& tables : kVersions) {
    const auto path = folder / (std::string(tables.version) + ".db");
    RunSql(path, SchemaSql(tables));
    {
      ColmapDatabase database(path, Mode::kReadWrite);
      Transaction transaction(database);
      database.WriteTwoViewGeometry(1, 2, {.config = 3, .inlier_matches = {{0, 0}}});
      transaction.Commit();
      const TwoViewGeometry geometry = database.ReadTwoViewGeometry(2, 1).value();
      EXPECT_EQ(geometry.config, 3);
      EXPECT_FALSE(geometry.F || geometry.E || geometry.H || geometry.cam2_from_cam1);
    }
    const bool is_version4 = std::string(tables.version).starts_with("COLMAP 4");
    EXPECT_EQ(RawGeometry(path), is_version4 ? "NULLNULLNULLNULL" : "zero") << tables.version;
  }
}

TEST(ColmapDatabase, PosePriorsOfEveryLayout) {
  const TemporaryFolder folder;
  DatabasePosePrior prior{.image_id = 2, .position = {1.0, -2.0, 3.5}, .coordinate_system = 0};
  prior.position_covariance = Eigen::Matrix3d(Eigen::Vector3d(1, 4, 9).asDiagonal());
  for (const VersionTables& tables : kVersions) {
    const auto path = folder / (std::string(tables.version) + ".db");
    RunSql(path, SchemaSql(tables));
    ColmapDatabase database(path, Mode::kReadWrite);
    Transaction transaction(database);
    WriteImages(database);
    if (!database.schema().has_pose_priors) {
      EXPECT_THAT(ErrorOf([&] { database.WritePosePrior(prior); }), HasSubstr("COLMAP 3.8-3.9"));
      EXPECT_TRUE(database.ReadPosePriors().empty());
      continue;
    }
    database.WritePosePrior(prior);
    database.WritePosePrior(prior);  // replaces
    database.WritePosePrior({.image_id = 4, .position = {7, 8, 9}});
    const auto priors = database.ReadPosePriors();
    ASSERT_EQ(priors.size(), 2u) << tables.version;
    EXPECT_EQ(priors[0].image_id, 2u);
    EXPECT_EQ(priors[0].position, prior.position);
    EXPECT_EQ(priors[0].coordinate_system, 0);
    EXPECT_EQ(priors[0].position_covariance.has_value(),
              database.schema().has_pose_prior_covariance);
    if (priors[0].position_covariance) {
      EXPECT_EQ(priors[0].position_covariance, prior.position_covariance);
    }
    EXPECT_FALSE(priors[1].position_covariance) << tables.version;
    transaction.Commit();
  }
}

TEST(ColmapDatabase, AGravityPriorOfVersion4Stays) {
  const TemporaryFolder folder;
  RunSql(folder / "a.db",
         SchemaSql(kVersions[4]) +
             "INSERT INTO pose_priors (corr_data_id, corr_sensor_id, corr_sensor_type, gravity, "
             "coordinate_system) VALUES (2, 50, 0, zeroblob(24), -1);");
  ColmapDatabase database(folder / "a.db", Mode::kReadWrite);
  Transaction transaction(database);
  WriteImages(database);
  EXPECT_TRUE(database.ReadPosePriors().empty());  // it has no position
  database.WritePosePrior({.image_id = 2, .position = {1, 2, 3}});
  transaction.Commit();
  EXPECT_EQ(database.ReadPosePriors().size(), 1u);
  SqliteConnection connection(folder / "a.db", SqliteConnection::Mode::kReadOnly);
  SqliteQuery query(connection, "SELECT hex(gravity), count(*) FROM pose_priors");
  ASSERT_TRUE(query.Next());
  EXPECT_EQ(query.Text(0), std::string(48, '0'));
  EXPECT_EQ(query.Int(1), 1);
}

TEST(ColmapDatabase, TrivialRigsAndFramesTakeTheIdsOfCamerasAndImages) {
  const TemporaryFolder folder;
  ColmapDatabase database = ColmapDatabase::Create(folder / "a.db");
  Transaction transaction(database);
  WriteImages(database);
  database.WriteRig({.rig_id = 7, .reference = {0, 49}, .sensor_from_rig = {}});
  database.WriteTrivialRigsAndFrames();
  const auto rigs = database.ReadRigs();
  const auto frames = database.ReadFrames();
  ASSERT_EQ(rigs.size(), 2u);
  EXPECT_EQ(rigs[0].rig_id, 49u);
  EXPECT_EQ(rigs[0].reference, (SensorId{0, 49}));
  EXPECT_TRUE(rigs[0].sensor_from_rig.empty());
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[1].frame_id, 4u);
  EXPECT_EQ(frames[1].rig_id, 49u);
  ASSERT_EQ(frames[1].data.size(), 1u);
  EXPECT_EQ(frames[1].data[0].data_id, 4u);
  EXPECT_EQ(frames[1].data[0].sensor, (SensorId{0, 49}));
}

TEST(ColmapDatabase, RigsOfSeveralSensorsComeBack) {
  const TemporaryFolder folder;
  ColmapDatabase database = ColmapDatabase::Create(folder / "a.db");
  Transaction transaction(database);
  const Rigid3d sensor_from_rig{RotationAboutAxis({1, 0, 0}, 90.0), {0.1, 0.2, 0.3}};
  Rig rig{.rig_id = 3, .reference = {0, 49}, .sensor_from_rig = {}};
  rig.sensor_from_rig[{0, 50}] = sensor_from_rig;
  rig.sensor_from_rig[{1, 9}] = std::nullopt;
  Frame frame{.frame_id = 8, .rig_id = 3, .rig_from_world = {}, .data = {}};
  frame.data = {{{0, 49}, 4}, {{0, 50}, 2}};
  for (int i = 0; i < 2; ++i) {  // the second time replaces
    database.WriteRig(rig);
    database.WriteFrame(frame);
  }
  const auto rigs = database.ReadRigs();
  ASSERT_EQ(rigs.size(), 1u);
  ASSERT_EQ(rigs[0].sensor_from_rig.size(), 2u);
  EXPECT_FALSE(rigs[0].sensor_from_rig.at({1, 9}));
  const Rigid3d& pose = rigs[0].sensor_from_rig.at({0, 50}).value();
  EXPECT_EQ(pose.translation, sensor_from_rig.translation);
  EXPECT_LT(AngleBetweenDeg(pose.rotation, sensor_from_rig.rotation), 1e-6);
  const auto frames = database.ReadFrames();
  ASSERT_EQ(frames.size(), 1u);
  ASSERT_EQ(frames[0].data.size(), 2u);
  EXPECT_EQ(frames[0].data[1].data_id, 2u);
}

TEST(ColmapDatabase, WritesNeedATransactionAndRollBackWithoutCommit) {
  const TemporaryFolder folder;
  ColmapDatabase database = ColmapDatabase::Create(folder / "a.db");
  EXPECT_THROW(database.WriteCamera(MakeCamera(1)), std::invalid_argument);
  {
    const Transaction transaction(database);
    database.WriteCamera(MakeCamera(1));
    EXPECT_THROW(Transaction nested(database), std::invalid_argument);
  }
  EXPECT_TRUE(database.ReadCameras().empty());
  ColmapDatabase reader(folder / "a.db", Mode::kReadOnly);
  EXPECT_THROW(Transaction transaction(reader), std::invalid_argument);
}

TEST(ColmapDatabase, CreateRefusesAnExistingFile) {
  const TemporaryFolder folder;
  ColmapDatabase::Create(folder / "a.db");
  const auto before = Snapshot(folder.path());
  EXPECT_THAT(ErrorOf([&] { ColmapDatabase::Create(folder / "a.db"); }), HasSubstr("exists"));
  EXPECT_EQ(Snapshot(folder.path()), before);
}

TEST(ColmapDatabase, BrokenContractsAreNotWritten) {
  const TemporaryFolder folder;
  ColmapDatabase database = ColmapDatabase::Create(folder / "a.db");
  Transaction transaction(database);
  EXPECT_THROW(database.WriteKeypoints(1, {1, 3, {1, 2, 3}}), std::invalid_argument);
  EXPECT_THROW(database.WriteKeypoints(1, {2, 2, {1, 2, 3}}), std::invalid_argument);
  EXPECT_THROW(database.WriteDescriptors(1, {2, 2, 0, {1}}), std::invalid_argument);
  Camera camera = MakeCamera(1);
  camera.params[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(database.WriteCamera(camera), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
