// SPDX-License-Identifier: BSD-3-Clause
// Masks in databases that the real COLMAP filled from real photos with walking people and moved
// figures: what COLMAP then reads, triangulates and maps.
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/mask_apply.h"
#include "bridge/mask_restore.h"
#include "tests/bridge/sample_masks.h"
#include "tests/support/colmap.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <map>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using Mode = ColmapDatabase::Mode;

constexpr MaskRule kRules[] = {MaskRule::kMatches, MaskRule::kKeypoints, MaskRule::kTracks};

// Keypoints and descriptors of each image by its name.
using Features = std::map<std::string, std::pair<std::vector<float>, std::vector<uint8_t>>>;
Features FeaturesOf(const ColmapDatabase& database) {
  Features features;
  for (const DatabaseImage& image : database.ReadImages()) {
    features[image.name] = {database.ReadKeypoints(image.image_id)->data,
                            database.ReadDescriptors(image.image_id)->data};
  }
  return features;
}

class MasksOnRealPhotos : public testing::TestWithParam<const char*> {
 protected:
  // Extracts and matches without masks, with few enough features to be quick. Masks are tested at
  // the original size, whatever the extractor's.
  void Extract(const fs::path& database_path, const std::vector<std::string>& more) const {
    std::vector<std::string> args = {"feature_extractor",
                                     "--database_path",
                                     database_path,
                                     "--image_path",
                                     wild_ / "images",
                                     "--ImageReader.single_camera",
                                     "1",
                                     "--SiftExtraction.first_octave",
                                     "0",
                                     "--SiftExtraction.max_num_features",
                                     "1500"};
    const std::string use_gpu = UseGpuFlag("feature_extractor", executable_);
    const std::string prefix = use_gpu.substr(0, use_gpu.find('.'));
    for (const auto& [name, value] : std::map<std::string, std::string>{
             {"use_gpu", "0"}, {"num_threads", "1"}, {"max_image_size", "1000"}}) {
      args.insert(args.end(), {prefix + "." + name, value});
    }
    args.insert(args.end(), more.begin(), more.end());
    Execute(args);
  }

  void Execute(const std::vector<std::string>& args) const {
    const ColmapRun run = RunColmap(args, executable_);
    ASSERT_EQ(run.exit_code, 0) << args[0] << ":\n" << run.output;
  }

  void Match(const fs::path& database_path) const {
    Execute({"exhaustive_matcher",
             "--database_path",
             database_path,
             UseGpuFlag("exhaustive_matcher", executable_),
             "0"});
  }

  ApplyMasksSummary ApplyRule(MaskRule rule) const {
    return ApplyMasks(plain_, wild_ / "masks", masked_, {.rule = rule, .overwrite = true});
  }

  // Rows of matches and inlier matches with an endpoint in an excluded pixel.
  size_t CountRowsOnDistractors(const fs::path& database_path) const {
    const ColmapDatabase database(database_path, Mode::kReadOnly);
    std::map<ImageId, StaticMask> masks;
    std::map<ImageId, Keypoints> keypoints;
    for (const DatabaseImage& image : database.ReadImages()) {
      masks[image.image_id] = ReadStaticMask(MaskPath(wild_ / "masks", image.name));
      keypoints[image.image_id] = database.ReadKeypoints(image.image_id).value();
    }
    const auto is_excluded = [&](ImageId image_id, uint32_t idx) {
      const Keypoints& of_image = keypoints.at(image_id);
      EXPECT_LT(idx, of_image.rows);
      return IsExcluded(masks.at(image_id), of_image.x(idx), of_image.y(idx));
    };
    size_t num_rows = 0;
    for (const auto& [id1, id2] : database.ReadMatchPairs()) {
      for (const FeatureMatches& rows : {database.ReadMatches(id1, id2),
                                         database.ReadTwoViewGeometry(id1, id2)->inlier_matches}) {
        for (const auto& [idx1, idx2] : rows) {
          num_rows += is_excluded(id1, idx1) || is_excluded(id2, idx2);
        }
      }
    }
    return num_rows;
  }

  size_t CountObservationsOnDistractors(const Reconstruction& model) const {
    size_t num_observations = 0;
    for (const auto& [image_id, image] : model.images) {
      const StaticMask static_mask = ReadStaticMask(MaskPath(wild_ / "masks", image.name));
      for (const Point2D& point2D : image.points2D) {
        num_observations +=
            point2D.HasPoint3D() && IsExcluded(static_mask, point2D.xy.x(), point2D.xy.y());
      }
    }
    return num_observations;
  }

  // It opens the database, finds every pair matched already, and maps what there is to map. 3.8
  // says so, with exit code 1, if that is nothing.
  void ExpectColmapMaps(const fs::path& database_path) const {
    Match(database_path);
    EXPECT_EQ(CountRowsOnDistractors(database_path), 0u);
    fs::create_directories(folder_ / "mapped");
    std::vector<std::string> args = {"mapper",
                                     "--database_path",
                                     database_path,
                                     "--image_path",
                                     wild_ / "images",
                                     "--output_path",
                                     folder_ / "mapped"};
    const std::string fallback = "--Mapper.structure_less_registration_fallback";
    if (RunColmap({"mapper", "-h"}, executable_).output.find(fallback) != std::string::npos) {
      args.insert(args.end(), {fallback, "0"});  // it may abort (double free) in 4.2.1
    }
    const ColmapRun run = RunColmap(args, executable_);
    EXPECT_TRUE(run.exit_code == 0 ||
                run.output.find("failed to create sparse model") != std::string::npos)
        << run.output;
  }

  void ExpectLawsOfDatabase() {
    Extract(plain_, {});
    Match(plain_);
    const std::string original = DumpRows(plain_);
    ASSERT_GT(CountRowsOnDistractors(plain_), 0u);
    for (const MaskRule rule : kRules) {
      const ApplyMasksSummary summary = ApplyRule(rule);
      EXPECT_GT(summary.num_inlier_matches_after, 0u);
      EXPECT_EQ(CountRowsOnDistractors(masked_), 0u);
      RestoreMasks(masked_, folder_ / "restored.db", {.overwrite = true});
      EXPECT_TRUE(DumpRows(folder_ / "restored.db") == original);
      ExpectColmapMaps(masked_);
      RestoreMasks(masked_, "", {.in_place = true});
      EXPECT_TRUE(DumpRows(masked_) == original) << "after COLMAP";
    }
  }

  void ExpectFeaturesOfMaskedExtraction() {
    Extract(plain_, {});
    Extract(folder_ / "extracted.db", {"--ImageReader.mask_path", wild_ / "masks"});
    ApplyRule(MaskRule::kKeypoints);
    const Features expected = FeaturesOf(ColmapDatabase(folder_ / "extracted.db", Mode::kReadOnly));
    EXPECT_TRUE(FeaturesOf(ColmapDatabase(masked_, Mode::kReadOnly)) == expected);
    EXPECT_FALSE(FeaturesOf(ColmapDatabase(plain_, Mode::kReadOnly)) == expected);
  }

  // The poses of `reference`, and its camera in the photos' size, in the space of the database.
  void WriteSeed() const {
    const Reconstruction reference = ReadModel(wild_ / "reference");
    Reconstruction seed;
    ColmapDatabase database(plain_, Mode::kReadWrite);
    ColmapDatabase::Transaction transaction(database);
    Camera camera = database.ReadCameras().front();
    const Camera& of_reference = reference.cameras.begin()->second;
    EXPECT_EQ(camera.model, of_reference.model);
    const double scale = static_cast<double>(camera.width) / of_reference.width;
    for (size_t i = 0; i < 3; ++i) camera.params[i] = scale * of_reference.params[i];
    camera.params[3] = of_reference.params[3];
    database.WriteCamera(camera);
    seed.cameras[camera.camera_id] = camera;
    const auto cam_from_world_by_name = CamFromWorldByName(reference);
    for (const DatabaseImage& image : database.ReadImages()) {
      seed.images[image.image_id] = {
          image.image_id, image.camera_id, image.name, cam_from_world_by_name.at(image.name), {}};
    }
    transaction.Commit();
    WriteModel(seed, folder_ / "seed");
  }

  Reconstruction Triangulate(const fs::path& database_path,
                             const fs::path& input_path,
                             const std::string& name,
                             const std::string& clear_points) const {
    fs::create_directories(folder_ / name);
    Execute({"point_triangulator",
             "--database_path",
             database_path,
             "--image_path",
             wild_ / "images",
             "--input_path",
             input_path,
             "--output_path",
             folder_ / name,
             "--clear_points",
             clear_points,
             "--Mapper.tri_ignore_two_view_tracks",
             "0"});
    return ReadModel(folder_ / name);
  }

  // A model of the plain database, and its masked twin, which COLMAP takes on with the masked
  // database: it aborts if an observation names a keypoint that is not there.
  void ExpectLawsOfModel() {
    Extract(plain_, {});
    Match(plain_);
    WriteSeed();
    const Reconstruction model = Triangulate(plain_, folder_ / "seed", "sparse", "1");
    EXPECT_GT(model.points3D.size(), 100u);
    // Few: what moved does not fit the poses.
    ASSERT_GT(CountObservationsOnDistractors(model), 0u);
    for (const MaskRule rule : kRules) {
      const auto name = "static" + std::to_string(static_cast<int>(rule));
      const ApplyMasksSummary summary = ApplyMasks(plain_,
                                                   wild_ / "masks",
                                                   masked_,
                                                   {.rule = rule,
                                                    .model_path = folder_ / "sparse",
                                                    .model_output_path = folder_ / name,
                                                    .overwrite = true});
      const Reconstruction masked = ReadModel(folder_ / name);
      EXPECT_EQ(CountObservationsOnDistractors(masked), 0u);
      EXPECT_EQ(masked.points3D.size(), summary.model->num_points3D_after);
      EXPECT_LT(masked.points3D.size(), model.points3D.size());
      ExpectPointsOfDatabase(masked);
      const Reconstruction again = Triangulate(masked_, folder_ / name, name + "_again", "0");
      EXPECT_EQ(CountObservationsOnDistractors(again), 0u);
      EXPECT_GE(again.points3D.size(), masked.points3D.size() * 9 / 10);
      ExpectPointsOfDatabase(again);
    }
  }

  // Every index is one of a keypoint, and the right one.
  void ExpectPointsOfDatabase(const Reconstruction& model) const {
    const ColmapDatabase database(masked_, Mode::kReadOnly);
    for (const auto& [image_id, image] : model.images) {
      const Keypoints keypoints = database.ReadKeypoints(image_id).value();
      ASSERT_TRUE(image.points2D.empty() || image.points2D.size() == keypoints.rows);
      for (size_t i = 0; i < image.points2D.size(); ++i) {
        ASSERT_EQ(image.points2D[i].xy, Eigen::Vector2d(keypoints.x(i), keypoints.y(i)));
      }
    }
  }

  const TemporaryFolder folder_;
  const fs::path plain_ = folder_ / "plain.db";
  const fs::path masked_ = folder_ / "masked.db";
  const fs::path wild_ = SharedData() / "wild" / GetParam();
  fs::path executable_ = ColmapExecutable();
};

TEST_P(MasksOnRealPhotos, LeaveNoRowOnDistractorsAndCanBeUndone) {
  VGTW_NEED_SHARED_DATA();
  VGTW_NEED_COLMAP();
  ExpectLawsOfDatabase();
}

TEST_P(MasksOnRealPhotos, KeepTheFeaturesOfMaskedExtraction) {
  VGTW_NEED_SHARED_DATA();
  VGTW_NEED_COLMAP();
  ExpectFeaturesOfMaskedExtraction();
}

TEST_P(MasksOnRealPhotos, OfAnotherVersionLeaveNoRowOnDistractorsAndCanBeUndone) {
  VGTW_NEED_SHARED_DATA();
  VGTW_NEED_OTHER_COLMAP();
  executable_ = OtherColmapExecutable();
  ExpectLawsOfDatabase();
}

TEST_P(MasksOnRealPhotos, OfAnotherVersionKeepTheFeaturesOfMaskedExtraction) {
  VGTW_NEED_SHARED_DATA();
  VGTW_NEED_OTHER_COLMAP();
  executable_ = OtherColmapExecutable();
  ExpectFeaturesOfMaskedExtraction();
}

INSTANTIATE_TEST_SUITE_P(Sets, MasksOnRealPhotos, testing::Values("android", "corner"));

// Only `corner` has poses.
using MasksOnPosedPhotos = MasksOnRealPhotos;

TEST_P(MasksOnPosedPhotos, LeaveAModelThatColmapGoesOnWith) {
  VGTW_NEED_SHARED_DATA();
  VGTW_NEED_COLMAP();
  ExpectLawsOfModel();
}

TEST_P(MasksOnPosedPhotos, OfAnotherVersionLeaveAModelThatColmapGoesOnWith) {
  VGTW_NEED_SHARED_DATA();
  VGTW_NEED_OTHER_COLMAP();
  executable_ = OtherColmapExecutable();
  ExpectLawsOfModel();
}

INSTANTIATE_TEST_SUITE_P(Sets, MasksOnPosedPhotos, testing::Values("corner"));

}  // namespace
}  // namespace vgtw
