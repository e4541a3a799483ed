// SPDX-License-Identifier: BSD-3-Clause
// Our features are COLMAP's own to within its noise: same places, shapes and descriptors, and its
// matcher takes both in one database.
#include "bridge/colmap_database.h"
#include "matching/sift.h"
#include "scene/statistics.h"
#include "tests/support/colmap.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr int kNumPhotos = 4;

std::string PhotoName(int i) { return std::to_string(i) + ".png"; }

// The middle of neighbouring photos, small enough that neither side's budget is reached.
void WriteCrops(const fs::path& folder) {
  constexpr int kWidth = 800;
  constexpr int kHeight = 600;
  for (int i = 0; i < kNumPhotos; ++i) {
    const GrayImage photo = ReadGrayImage(SharedData() / "strecha_fountain-p11/images" /
                                          ("000" + std::to_string(i + 4) + ".jpg"));
    GrayImage crop(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        crop(x, y) = photo(x + (photo.width() - kWidth) / 2, y + (photo.height() - kHeight) / 2);
      }
    }
    WriteImage(folder / PhotoName(i), crop);
  }
}

void Execute(const std::string& command,
             std::vector<std::string> args,
             const fs::path& executable) {
  args.insert(args.begin(), {command, UseGpuFlag(command, executable), "0"});
  const ColmapRun run = RunColmap(args, executable);
  ASSERT_EQ(run.exit_code, 0) << command << ":\n" << run.output;
}

cv::Mat ToFloat(const Descriptors& descriptors) {
  cv::Mat result;
  cv::Mat(static_cast<int>(descriptors.rows),
          static_cast<int>(descriptors.cols),
          CV_8UC1,
          const_cast<uint8_t*>(descriptors.data.data()))
      .convertTo(result, CV_32F);
  return result;
}

std::vector<cv::DMatch> MutualNearest(const Features& a, const Features& b) {
  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_L2, true).match(ToFloat(a.descriptors), ToFloat(b.descriptors), matches);
  return matches;
}

double Orientation_rad(const Keypoints& keypoints, size_t i) {
  return std::atan2(keypoints.data[i * 6 + 4], keypoints.data[i * 6 + 2]);
}

size_t CountInliers(const fs::path& database_path, ImageId id1, ImageId id2) {
  const ColmapDatabase database(database_path, ColmapDatabase::Mode::kReadOnly);
  const auto geometry = database.ReadTwoViewGeometry(id1, id2);
  return geometry ? geometry->inlier_matches.size() : 0;
}

class SiftByColmap : public testing::Test {
 protected:
  void SetUp() override {
    VGTW_NEED_SHARED_DATA();
    VGTW_NEED_COLMAP();
    WriteCrops(photos_);
  }

  void Extract(const fs::path& database_path, const fs::path& executable) {
    Execute("feature_extractor",
            {"--database_path",
             database_path.string(),
             "--image_path",
             photos_.string(),
             "--ImageReader.single_camera",
             "1"},
            executable);
  }

  Features Ours(const std::string& name) const {
    return ExtractSift(ReadGrayImage(photos_ / name), {}, {});
  }

  // Verified inliers between neighbours, where every second image has our features.
  void MatchMixed(const fs::path& executable) {
    const fs::path theirs = folder_ / "theirs.db";
    const fs::path mixed = folder_ / "mixed.db";
    Extract(theirs, executable);
    fs::copy_file(theirs, mixed);
    std::vector<DatabaseImage> images;
    {
      ColmapDatabase database(mixed, ColmapDatabase::Mode::kReadWrite);
      images = database.ReadImages();
      ASSERT_EQ(images.size(), size_t{kNumPhotos});
      ColmapDatabase::Transaction transaction(database);
      for (size_t i = 1; i < images.size(); i += 2) {
        const Features features = Ours(images[i].name);
        database.WriteKeypoints(images[i].image_id, features.keypoints);
        database.WriteDescriptors(images[i].image_id, features.descriptors);
      }
      transaction.Commit();
    }
    for (const fs::path& path : {theirs, mixed}) {
      Execute("exhaustive_matcher", {"--database_path", path.string()}, executable);
    }
    for (size_t i = 1; i < images.size(); ++i) {
      const size_t num_theirs = CountInliers(theirs, images[i - 1].image_id, images[i].image_id);
      const size_t num_mixed = CountInliers(mixed, images[i - 1].image_id, images[i].image_id);
      // A keypoint must be in both sets to be matched: three quarters are. A wrong layout, half a
      // pixel or another angle would leave next to none.
      EXPECT_GE(num_theirs, 100u);
      EXPECT_GE(num_mixed, num_theirs / 2) << "of " << num_theirs;
      RecordProperty("inliers_theirs_" + std::to_string(i), static_cast<int>(num_theirs));
      RecordProperty("inliers_mixed_" + std::to_string(i), static_cast<int>(num_mixed));
    }
  }

  const TemporaryFolder folder_;
  const fs::path photos_ = folder_ / "photos";
};

TEST_F(SiftByColmap, RowsAreThoseOfItsExtractor) {
  Extract(folder_ / "a.db", ColmapExecutable());
  const ColmapDatabase database(folder_ / "a.db", ColmapDatabase::Mode::kReadOnly);
  for (const DatabaseImage& image : database.ReadImages()) {
    const Features theirs{database.ReadKeypoints(image.image_id).value(),
                          database.ReadDescriptors(image.image_id).value()};
    const Features ours = Ours(image.name);
    ASSERT_EQ(theirs.keypoints.cols, ours.keypoints.cols);
    ASSERT_EQ(theirs.descriptors.cols, ours.descriptors.cols);
    const auto matches = MutualNearest(ours, theirs);
    std::vector<double> dx, dy, turns_deg, scale_ratios;
    for (const cv::DMatch& match : matches) {
      const auto i = static_cast<size_t>(match.queryIdx);
      const auto j = static_cast<size_t>(match.trainIdx);
      const double x = theirs.keypoints.x(j) - ours.keypoints.x(i);
      const double y = theirs.keypoints.y(j) - ours.keypoints.y(i);
      if (std::hypot(x, y) > 3.0) continue;
      dx.push_back(x);
      dy.push_back(y);
      const double turn_rad =
          Orientation_rad(theirs.keypoints, j) - Orientation_rad(ours.keypoints, i);
      turns_deg.push_back(std::remainder(turn_rad, 2.0 * std::numbers::pi) * 180.0 /
                          std::numbers::pi);
      scale_ratios.push_back(theirs.keypoints.Scale(j) / ours.keypoints.Scale(i));
    }
    EXPECT_GT(matches.size(), ours.keypoints.rows / 2);
    EXPECT_GE(static_cast<double>(dx.size()), 0.95 * static_cast<double>(matches.size()));
    EXPECT_NEAR(Median(dx), 0.0, 0.05);
    EXPECT_NEAR(Median(dy), 0.0, 0.05);
    EXPECT_NEAR(Median(turns_deg), 0.0, 0.5);
    EXPECT_NEAR(Median(scale_ratios), 1.0, 0.02);
  }
}

TEST_F(SiftByColmap, ItsMatcherMixesThemWithItsOwn) { MatchMixed(ColmapExecutable()); }

TEST_F(SiftByColmap, AnotherVersionMixesThemWithItsOwn) {
  VGTW_NEED_OTHER_COLMAP();
  MatchMixed(OtherColmapExecutable());
}

}  // namespace
}  // namespace vgtw
