// SPDX-License-Identifier: BSD-3-Clause
// The real COLMAP reads, extends and matches our databases, and we read its own.
#include "tests/support/colmap.h"

#include "bridge/colmap_database.h"
#include "bridge/mask_apply.h"
#include "tests/bridge/sample_masks.h"
#include "tests/support/temporary_folder.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using Mode = ColmapDatabase::Mode;
using testing::HasSubstr;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr int kNumImages = 3;

// Overlapping cuts of one wall of random grey squares: SIFT finds corners, views match by a shift.
void WritePhotos(const fs::path& folder) {
  constexpr int kSquare = 12;
  constexpr int kNumColumns = 60;
  std::mt19937 random(7);
  std::vector<uint8_t> wall(kNumColumns * kNumColumns);
  for (uint8_t& grey : wall) grey = static_cast<uint8_t>(random() % 256);
  for (int i = 0; i < kNumImages; ++i) {
    GrayImage photo(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        photo(x, y) = wall[static_cast<size_t>(y / kSquare * kNumColumns + (x + 40 * i) / kSquare)];
      }
    }
    WriteImage(folder / ("sub dir/" + std::to_string(i) + ".png"), photo);
  }
}

// Awkward on purpose: ids are not 1..n and not in the order of names, cameras are not the images'.
ImageId ImageIdOf(int i) { return static_cast<ImageId>(10 - 3 * i); }
CameraId CameraIdOf(int i) { return static_cast<CameraId>(40 + i); }

void RegisterPhotos(ColmapDatabase& database) {
  ColmapDatabase::Transaction transaction(database);
  for (int i = 0; i < kNumImages; ++i) {
    Camera camera = MakePinhole(kWidth, kHeight, 300.0 + i, 310.0);
    camera.camera_id = CameraIdOf(i);
    camera.has_prior_focal_length = true;
    database.WriteCamera(camera);
    database.WriteImage({ImageIdOf(i), "sub dir/" + std::to_string(i) + ".png", CameraIdOf(i)});
  }
  database.WriteTrivialRigsAndFrames();
  transaction.Commit();
}

// Runs a command that must succeed.
void Execute(std::vector<std::string> args, const fs::path& executable) {
  const ColmapRun run = RunColmap(args, executable);
  ASSERT_EQ(run.exit_code, 0) << args[0] << ":\n" << run.output;
}

void ExtractAndMatch(const fs::path& database_path, const fs::path& photos, const fs::path& exe) {
  const std::string database = database_path.string();
  Execute({"feature_extractor",
           "--database_path",
           database,
           "--image_path",
           photos.string(),
           UseGpuFlag("feature_extractor", exe),
           "0"},
          exe);
  Execute({"exhaustive_matcher",
           "--database_path",
           database,
           UseGpuFlag("exhaustive_matcher", exe),
           "0"},
          exe);
}

size_t CountMatches(const ColmapDatabase& database) {
  size_t num_matches = 0;
  for (const auto& [id1, id2] : database.ReadMatchPairs()) {
    num_matches += database.ReadMatches(id1, id2).size();
  }
  return num_matches;
}

size_t CountInliers(const ColmapDatabase& database) {
  size_t num_inliers = 0;
  for (const auto& [id1, id2] : database.ReadTwoViewPairs()) {
    num_inliers += database.ReadTwoViewGeometry(id1, id2)->inlier_matches.size();
  }
  return num_inliers;
}

// Shift between matched keypoints in x, known from how the photos were cut.
void ExpectTrueShifts(const ColmapDatabase& database) {
  for (int i = 0; i + 1 < kNumImages; ++i) {
    const auto geometry = database.ReadTwoViewGeometry(ImageIdOf(i), ImageIdOf(i + 1));
    ASSERT_TRUE(geometry);
    ASSERT_GE(geometry->inlier_matches.size(), 50u);
    const Keypoints keypoints1 = database.ReadKeypoints(ImageIdOf(i)).value();
    const Keypoints keypoints2 = database.ReadKeypoints(ImageIdOf(i + 1)).value();
    size_t num_true = 0;
    for (const auto& [idx1, idx2] : geometry->inlier_matches) {
      ASSERT_LT(idx1, keypoints1.rows);
      ASSERT_LT(idx2, keypoints2.rows);
      num_true += std::abs(keypoints1.x(idx1) - keypoints2.x(idx2) - 40.0f) < 1.0f;
    }
    // With the columns exchanged about none would agree.
    EXPECT_GT(num_true, geometry->inlier_matches.size() * 9 / 10);
  }
}

class RealColmap : public testing::Test {
 protected:
  RealColmap() { WritePhotos(photos_); }

  // What every COLMAP must make of a database of ours.
  void ExtendOurs(const fs::path& executable) {
    {
      ColmapDatabase database = ColmapDatabase::Create(database_path_);
      RegisterPhotos(database);
    }
    ExtractAndMatch(database_path_, photos_, executable);
    const ColmapDatabase database(database_path_, Mode::kReadOnly);
    const auto images = database.ReadImages();
    ASSERT_EQ(images.size(), size_t{kNumImages});
    for (int i = 0; i < kNumImages; ++i) {
      const auto& image = images[static_cast<size_t>(kNumImages - 1 - i)];
      EXPECT_EQ(image.image_id, ImageIdOf(i));
      EXPECT_EQ(image.camera_id, CameraIdOf(i));
      EXPECT_GT(database.ReadKeypoints(image.image_id)->rows, 100u);
      EXPECT_EQ(database.ReadDescriptors(image.image_id)->cols, 128u);
      EXPECT_EQ(database.ReadDescriptors(image.image_id)->type, 0);
    }
    const auto cameras = database.ReadCameras();
    ASSERT_EQ(cameras.size(), size_t{kNumImages});
    EXPECT_EQ(cameras[1].params[0], 301.0);
    EXPECT_TRUE(cameras[1].has_prior_focal_length);
    ExpectTrueShifts(database);
  }

  // A database that COLMAP made from nothing, masked by us, then read by it again.
  void MaskTheirs(const fs::path& executable) {
    ExtractAndMatch(database_path_, photos_, executable);
    StaticMask left(kWidth, kHeight, 255);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth / 2; ++x) left(x, y) = 0;
    }
    for (int i = 0; i < kNumImages; ++i) {
      WriteImage(MaskPath(folder_ / "masks", "sub dir/" + std::to_string(i) + ".png"), left);
    }
    const auto output_path = folder_ / "masked.db";
    const auto summary = ApplyMasks(database_path_, folder_ / "masks", output_path, {});
    EXPECT_GT(summary.num_inlier_matches_after, 0u);
    EXPECT_LT(summary.num_inlier_matches_after, summary.num_inlier_matches_before * 3 / 4);
    Execute({"exhaustive_matcher",
             "--database_path",
             output_path.string(),
             UseGpuFlag("exhaustive_matcher", executable),
             "0"},
            executable);
    // It took our rows for complete and did not match again.
    const ColmapDatabase output(output_path, Mode::kReadOnly);
    EXPECT_EQ(CountMatches(output), summary.num_matches_after);
    EXPECT_EQ(CountInliers(output), summary.num_inlier_matches_after);
    EXPECT_EQ(output.schema().Describe(),
              ColmapDatabase(database_path_, Mode::kReadOnly).schema().Describe());
  }

  const TemporaryFolder folder_;
  const fs::path photos_ = folder_ / "photos";
  const fs::path database_path_ = folder_ / "a.db";
};

TEST_F(RealColmap, ExtendsOurDatabase) {
  VGTW_NEED_COLMAP();
  ExtendOurs(ColmapExecutable());
}

TEST_F(RealColmap, ItsDatabaseIsReadAndMasked) {
  VGTW_NEED_COLMAP();
  MaskTheirs(ColmapExecutable());
}

TEST_F(RealColmap, TwoViewGeometriesOfItsMatcherObeyTheirLaw) {
  VGTW_NEED_COLMAP();
  ExtendOurs(ColmapExecutable());
  const ColmapDatabase database(database_path_, Mode::kReadOnly);
  const auto geometry = database.ReadTwoViewGeometry(ImageIdOf(0), ImageIdOf(1)).value();
  const Keypoints keypoints1 = database.ReadKeypoints(ImageIdOf(0)).value();
  const Keypoints keypoints2 = database.ReadKeypoints(ImageIdOf(1)).value();
  ASSERT_TRUE(geometry.H) << "configuration " << geometry.config;
  size_t num_near = 0;
  for (const auto& [idx1, idx2] : geometry.inlier_matches) {
    const Eigen::Vector3d x1(keypoints1.x(idx1), keypoints1.y(idx1), 1.0);
    const Eigen::Vector2d x2(keypoints2.x(idx2), keypoints2.y(idx2));
    num_near += ((*geometry.H * x1).hnormalized() - x2).norm() < 4.0;  // COLMAP's max_error
  }
  EXPECT_GT(num_near, geometry.inlier_matches.size() * 9 / 10);
}

TEST_F(RealColmap, OfAnotherVersionExtendsOurDatabase) {
  VGTW_NEED_OTHER_COLMAP();
  ExtendOurs(OtherColmapExecutable());
}

TEST_F(RealColmap, OfAnotherVersionItsDatabaseIsReadAndMasked) {
  VGTW_NEED_OTHER_COLMAP();
  MaskTheirs(OtherColmapExecutable());
}

TEST_F(RealColmap, OfTwoVersionsTakeTurns) {
  VGTW_NEED_COLMAP();
  VGTW_NEED_OTHER_COLMAP();
  ExtendOurs(OtherColmapExecutable());
  for (const auto& executable : {ColmapExecutable(), OtherColmapExecutable()}) {
    Execute({"exhaustive_matcher",
             "--database_path",
             database_path_.string(),
             UseGpuFlag("exhaustive_matcher", executable),
             "0"},
            executable);
    ExpectTrueShifts(ColmapDatabase(database_path_, Mode::kReadOnly));
  }
}

// Position priors in the layout that the running version uses.
TEST_F(RealColmap, OfAnotherVersionTakesPosePriors) {
  VGTW_NEED_OTHER_COLMAP();
  const auto write_priors = [&] {
    ColmapDatabase database(database_path_, Mode::kReadWrite);
    ColmapDatabase::Transaction transaction(database);
    for (int i = 0; i < kNumImages; ++i) {
      database.WritePosePrior({.image_id = ImageIdOf(i), .position = {1.0 * i, 2.0, 3.0}});
    }
    transaction.Commit();
  };
  {
    ColmapDatabase database = ColmapDatabase::Create(database_path_);
    RegisterPhotos(database);
  }
  write_priors();  // layout of 3.11, migrated by the extractor
  ExtractAndMatch(database_path_, photos_, OtherColmapExecutable());
  const auto priors = ColmapDatabase(database_path_, Mode::kReadOnly).ReadPosePriors();
  ASSERT_EQ(priors.size(), size_t{kNumImages});
  EXPECT_EQ(priors[0].image_id, ImageIdOf(2));
  EXPECT_EQ(priors[0].position, Eigen::Vector3d(2.0, 2.0, 3.0));
  write_priors();  // its own layout
  Execute({"spatial_matcher",
           "--database_path",
           database_path_.string(),
           UseGpuFlag("spatial_matcher", OtherColmapExecutable()),
           "0",
           "--SpatialMatching.max_distance",
           "100"},
          OtherColmapExecutable());
  EXPECT_EQ(ColmapDatabase(database_path_, Mode::kReadOnly).ReadPosePriors().size(),
            size_t{kNumImages});
}

}  // namespace
}  // namespace vgtw
