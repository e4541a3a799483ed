// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/database_tracks.h"

#include "scene/error.h"
#include "tests/support/model_database.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <string>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A database with the keypoints of a model of 4 images and 30 points. Neighbouring images match.
class DatabaseTracks : public testing::Test {
 protected:
  DatabaseTracks()
      : model_(MakeModel()), database_(CreateDatabaseOf(model_, folder_.path() / "a.db")) {}

  static Reconstruction MakeModel() {
    SyntheticModelOptions options;
    options.num_images = 4;
    options.num_points = 30;
    return MakeSyntheticModel(options);
  }

  // Keypoint i of one image is keypoint i of every other.
  static FeatureMatches FirstMatches(uint32_t num) {
    FeatureMatches matches;
    for (uint32_t i = 0; i < num; ++i) matches.push_back({i, i});
    return matches;
  }

  void WriteNeighbours() {
    for (ImageId id = 1; id < 4; ++id)
      WriteVerifiedMatches(id, id + 1, FirstMatches(30), database_);
  }

  TemporaryFolder folder_;
  Reconstruction model_;
  ColmapDatabase database_;
};

TEST_F(DatabaseTracks, AreThoseOfTheModelThatWasMatched) {
  WriteNeighbours();
  Reconstruction model = model_;
  EXPECT_EQ(ReadTracks(database_, model), [&] {
    std::vector<std::vector<TrackElement>> tracks;
    for (const auto& [id, point] : model_.points3D) tracks.push_back(point.track);
    return tracks;
  }());
}

TEST_F(DatabaseTracks, PointsOnTheDatabasesKeypointsStay) {
  WriteNeighbours();
  Reconstruction model = model_;
  ReadTracks(database_, model);
  EXPECT_EQ(model.points3D.size(), 30u);
  // Not rounded to the database's single precision.
  for (const auto& [id, image] : model.images) {
    EXPECT_EQ(image.points2D, model_.images.at(id).points2D);
  }
}

TEST_F(DatabaseTracks, OtherPointsGo) {
  WriteNeighbours();
  Reconstruction moved = model_;
  moved.images.at(2).points2D[7].xy.x() += 0.5;
  Reconstruction fewer = model_;
  for (auto& [id, image] : fewer.images) image.points2D.clear();
  fewer.points3D.clear();
  for (Reconstruction* model : {&moved, &fewer}) {
    const auto tracks = ReadTracks(database_, *model);
    EXPECT_EQ(tracks.size(), 30u);
    EXPECT_EQ(FindFault(*model), "");
    EXPECT_TRUE(model->points3D.empty());
    for (const auto& [id, image] : model->images) {
      ASSERT_EQ(image.points2D.size(), 30u);
      for (size_t i = 0; i < 30; ++i) {
        EXPECT_EQ(image.points2D[i].xy,
                  model_.images.at(id).points2D[i].xy.cast<float>().cast<double>());
        EXPECT_FALSE(image.points2D[i].HasPoint3D());
      }
    }
  }
}

TEST_F(DatabaseTracks, OnlyVerifiedMatchesBetweenImagesOfTheModelCount) {
  {
    ColmapDatabase::Transaction transaction(database_);
    database_.WriteMatches(1, 4, FirstMatches(30));  // not verified
    transaction.Commit();
  }
  WriteVerifiedMatches(2, 1, FirstMatches(5), database_);
  WriteVerifiedMatches(2, 3, {}, database_);
  WriteVerifiedMatches(3, 4, FirstMatches(20), database_);
  Reconstruction model = model_;
  for (Point3DId id = 1; id <= 30; ++id) {
    RemoveObservation(model, {4, static_cast<uint32_t>(id - 1)});
  }
  model.images.erase(4);
  const std::vector<PairMatches> pairs = ReadVerifiedMatches(database_, model);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0].image_id1, 1u);
  EXPECT_EQ(pairs[0].image_id2, 2u);
  EXPECT_EQ(pairs[0].matches, FirstMatches(5));
  EXPECT_EQ(ReadTracks(database_, model).size(), 5u);
}

TEST_F(DatabaseTracks, ADatabaseWithoutVerifiedMatchesIsRefused) {
  Reconstruction model = model_;
  for (const bool has_empty_pair : {false, true}) {
    if (has_empty_pair) WriteVerifiedMatches(1, 2, {}, database_);
    try {
      ReadTracks(database_, model);
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      const std::string message = error.what();
      EXPECT_NE(message.find("a.db"), std::string::npos) << message;
      EXPECT_NE(message.find("no verified matches"), std::string::npos) << message;
      EXPECT_NE(message.find("vgtw match"), std::string::npos) << message;
    }
  }
}

TEST_F(DatabaseTracks, ImagesWithoutKeypointsHaveNoTracks) {
  WriteVerifiedMatches(1, 2, FirstMatches(30), database_);
  Reconstruction model = model_;
  Image& image = model.images[9];
  image.image_id = 9;
  image.camera_id = 1;
  image.name = "image9.jpg";
  EXPECT_EQ(ReadTracks(database_, model).size(), 30u);
  EXPECT_TRUE(model.images.at(9).points2D.empty());
  EXPECT_EQ(model.points3D.size(), 30u);
}

}  // namespace
}  // namespace vgtw
