// SPDX-License-Identifier: BSD-3-Clause
// `vgtw match`.
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "bridge/seed.h"
#include "scene/perturb.h"
#include "scene/reprojection.h"
#include "scene/synthetic.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr size_t kNumViews = 6;

// Photos of the synthetic scene with their exact masks and predictions with errors of the size of
// VGGT's.
class MatchCommand : public testing::Test {
 protected:
  MatchCommand() {
    const SyntheticScene scene({.num_views = kNumViews, .path_extent_deg = 50.0});
    for (size_t i = 0; i < kNumViews; ++i) {
      const SyntheticView view = scene.Render(i);
      const std::string& name = scene.views()[i].name;
      WriteImage(folder_ / "photos" / name, view.image);
      StaticMask mask(view.distractor.width(), view.distractor.height(), 255);
      for (size_t k = 0; k < mask.size(); ++k) {
        if (view.distractor.data()[k] > 0.5f) mask.data()[k] = 0;
      }
      WriteImage(MaskPath(folder_ / "masks", name), mask);
    }
    WritePrediction(Perturb(MakeTruePrediction(scene), {}), folder_ / "predictions", false);
  }

  ColmapRun Match(const std::vector<std::string>& more) const {
    std::vector<std::string> args = {"match", "--predictions_path", folder_ / "predictions"};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  }
  ColmapRun MatchPhotos(const fs::path& database) const {
    return Match({"--image_path",
                  folder_ / "photos",
                  "--mask_path",
                  folder_ / "masks",
                  "--output_path",
                  database,
                  "--json",
                  folder_ / "match.json"});
  }

  const TemporaryFolder folder_;
};

// What a database holds of matches, to compare two.
std::map<std::pair<ImageId, ImageId>, FeatureMatches> InlierMatches(const fs::path& path) {
  const ColmapDatabase database(path, ColmapDatabase::Mode::kReadOnly);
  std::map<std::pair<ImageId, ImageId>, FeatureMatches> matches;
  for (const auto& [id1, id2] : database.ReadTwoViewPairs()) {
    matches[{id1, id2}] = database.ReadTwoViewGeometry(id1, id2)->inlier_matches;
  }
  return matches;
}

TEST_F(MatchCommand, MakesADatabaseOfMaskedFeatures) {
  const fs::path path = folder_ / "a.db";
  const ColmapRun run = MatchPhotos(path);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const nlohmann::json json = ReadJson(folder_ / "match.json");
  EXPECT_EQ(json["num_guided"], json["num_pairs"]);
  EXPECT_EQ(InlierMatches(path).size(), json["num_verified_pairs"]);
  const ColmapDatabase database(path, ColmapDatabase::Mode::kReadOnly);
  ASSERT_EQ(database.ReadImages().size(), kNumViews);
  for (const DatabaseImage& image : database.ReadImages()) {
    // Neighbours at least are matched, with the hundreds of features that the scene has.
    EXPECT_GT(json["images"][image.name]["num_inlier_matches"], 200);
    const StaticMask mask = ReadStaticMask(MaskPath(folder_ / "masks", image.name));
    const Keypoints keypoints = database.ReadKeypoints(image.image_id).value();
    for (size_t row = 0; row < keypoints.rows; ++row) {
      EXPECT_FALSE(IsExcluded(mask, keypoints.x(row), keypoints.y(row)));
    }
  }
}

TEST_F(MatchCommand, MatchesTheFeaturesOfADatabaseAnew) {
  const fs::path path = folder_ / "a.db";
  ASSERT_EQ(MatchPhotos(path).exit_code, 0);
  const auto expected = InlierMatches(path);
  const auto before = Snapshot(folder_.path());
  const ColmapRun run = Match({"--database_path", path, "--output_path", folder_ / "b.db"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_EQ(InlierMatches(folder_ / "b.db"), expected);
  EXPECT_EQ(Snapshot(folder_.path()).at("a.db"), before.at("a.db"));
  ASSERT_EQ(Match({"--database_path", path, "--in_place"}).exit_code, 0);
  EXPECT_EQ(InlierMatches(path), expected);
}

TEST_F(MatchCommand, RefusesWrongRequestsInOneLine) {
  const auto expect = [](const ColmapRun& run, const char* text) {
    EXPECT_EQ(run.exit_code, 1) << run.output;
    EXPECT_THAT(run.output, HasSubstr(text));
  };
  const auto before = Snapshot(folder_.path());
  const std::string photos = folder_ / "photos";
  const std::string target = folder_ / "a.db";
  expect(Match({"--output_path", target}), "either --image_path");
  expect(Match({"--image_path", photos}), "one target");
  expect(Match({"--image_path", photos, "--in_place"}), "--in_place changes --database_path");
  expect(Match({"--database_path", folder_ / "none.db", "--output_path", target}), "none.db");
  expect(Match({"--image_path", photos, "--mask_path", folder_ / "none", "--output_path", target}),
         "none");
  expect(Match({"--image_path", photos, "--output_path", target, "--min_covisibility", "2"}),
         "min_covisibility");
  ColmapDatabase::Create(folder_ / "empty.db");
  expect(Match({"--database_path", folder_ / "empty.db", "--in_place"}), "empty.db");
  fs::remove(folder_ / "empty.db");
  EXPECT_EQ(Snapshot(folder_.path()), before);
}

TEST_F(MatchCommand, SeedPlacesItsMatchesByDepth) {
  const fs::path path = folder_ / "a.db";
  ASSERT_EQ(MatchPhotos(path).exit_code, 0);
  const auto seed = [&](const std::vector<std::string>& more) {
    std::vector<std::string> args = {"seed", "--predictions_path", folder_ / "predictions"};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  };
  const fs::path model_path = folder_ / "seed";
  const ColmapRun run =
      seed({"--database_path", path, "--tracks", "--output_path", model_path.string()});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Reconstruction model = ReadModel(model_path);
  EXPECT_EQ(FindFault(model), "");
  const ReprojectionStats stats = ComputeReprojectionStats(model);
  EXPECT_GT(stats.num_points3D, 300u);
  EXPECT_EQ(stats.num_behind_camera, 0u);
  // Poses and focal lengths are off by about 0.2 degrees and 2 %, which is 2 and up to 8 pixels.
  EXPECT_LT(stats.median_px, 5.0);
  const ColmapDatabase database(path, ColmapDatabase::Mode::kReadOnly);
  for (const auto& [image_id, image] : model.images) {
    EXPECT_EQ(image.points2D.size(), database.ReadKeypoints(image_id)->rows);
  }
  EXPECT_THAT(seed({"--tracks", "--output_path", folder_ / "other"}).output,
              HasSubstr("--tracks takes the matches of a database"));
}

// Both versions triangulate what was matched, with the predicted poses, and the incremental mapper
// reconstructs it.
class MatchedByColmap : public MatchCommand {
 protected:
  void Triangulate(const fs::path& colmap) const {
    const fs::path path = folder_ / "a.db";
    ASSERT_EQ(MatchPhotos(path).exit_code, 0);
    ASSERT_EQ(RunVgtw({"seed",
                       "--predictions_path",
                       folder_ / "predictions",
                       "--database_path",
                       path,
                       "--points",
                       "0",
                       "--output_path",
                       folder_ / "seed"})
                  .exit_code,
              0);
    for (const char* folder : {"triangulated", "mapped"}) fs::create_directory(folder_ / folder);
    const ColmapRun triangulator = RunColmap({"point_triangulator",
                                              "--database_path",
                                              path,
                                              "--image_path",
                                              folder_ / "photos",
                                              "--input_path",
                                              folder_ / "seed",
                                              "--output_path",
                                              folder_ / "triangulated",
                                              "--clear_points",
                                              "1"},
                                             colmap);
    ASSERT_EQ(triangulator.exit_code, 0) << triangulator.output;
    const Reconstruction triangulated = ReadModel(folder_ / "triangulated");
    EXPECT_EQ(triangulated.images.size(), kNumViews);
    EXPECT_GT(triangulated.points3D.size(), 100u);
    const ColmapRun mapper = RunColmap({"mapper",
                                        "--database_path",
                                        path,
                                        "--image_path",
                                        folder_ / "photos",
                                        "--output_path",
                                        folder_ / "mapped"},
                                       colmap);
    ASSERT_EQ(mapper.exit_code, 0) << mapper.output;
    EXPECT_EQ(ReadModel(folder_ / "mapped" / "0").images.size(), kNumViews);
  }
};

// The ways that leave features and matches to COLMAP end at a refined model, too.
TEST_F(MatchedByColmap, RunKeepsColmapsOwnWays) {
  VGTW_NEED_COLMAP();
  for (const std::string matcher : {"colmap", "sequential"}) {
    const fs::path out = folder_ / matcher;
    const ColmapRun run = RunVgtw({"run",
                                   "--image_path",
                                   folder_ / "photos",
                                   "--mask_path",
                                   folder_ / "masks",
                                   "--predictions_path",
                                   folder_ / "predictions",
                                   "--matcher",
                                   matcher,
                                   "--output_path",
                                   out});
    ASSERT_EQ(run.exit_code, 0) << run.output;
    EXPECT_THAT(run.output, HasSubstr("colmap feature_extractor"));
    EXPECT_EQ(ReadJson(out / "run.json")["options"]["matches"]["matcher"], matcher);
    EXPECT_EQ(ReadModel(out / "sparse" / "refined").images.size(), kNumViews);
  }
}

TEST_F(MatchedByColmap, IsTriangulatedAndMapped) {
  VGTW_NEED_COLMAP();
  Triangulate(ColmapExecutable());
}

TEST_F(MatchedByColmap, IsTriangulatedAndMappedByAnotherVersion) {
  VGTW_NEED_OTHER_COLMAP();
  Triangulate(OtherColmapExecutable());
}

}  // namespace
}  // namespace vgtw
