// SPDX-License-Identifier: BSD-3-Clause
// `vgtw refine`.
#include "bridge/colmap_model.h"
#include "scene/files.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/bytes.h"
#include "tests/support/model_database.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kPixelSigma = 0.3;

// A database whose keypoints are the model's points2D, and whose verified matches are its tracks.
void WriteDatabase(const Reconstruction& model, const fs::path& path) {
  ColmapDatabase database = CreateDatabaseOf(model, path);
  WriteMatchesOfTracks(model, database);
}

Reconstruction WithoutPoints(Reconstruction model) {
  model.points3D.clear();
  for (auto& [id, image] : model.images) image.points2D.clear();
  return model;
}

// Largest rotation between the same pair of images in both models, degrees.
double WorstRelativeRotation(const Reconstruction& a, const Reconstruction& b) {
  double worst_deg = 0.0;
  const auto relative = [](const Reconstruction& model, ImageId id1, ImageId id2) {
    return model.images.at(id2).cam_from_world.rotation *
           model.images.at(id1).cam_from_world.rotation.conjugate();
  };
  for (const auto& [id1, image1] : a.images) {
    for (const auto& [id2, image2] : a.images) {
      worst_deg =
          std::max(worst_deg, AngleBetweenDeg(relative(a, id1, id2), relative(b, id1, id2)));
    }
  }
  return worst_deg;
}

class RefineCommand : public testing::Test {
 protected:
  RefineCommand() : truth_(MakeSyntheticModel({.num_images = 6, .num_points = 400})) {
    ProjectAgain(truth_, kPixelSigma, 1);
    seed_ = truth_;
    PerturbPoses(seed_, 1.0, 0.1, 2);
    WriteDatabase(truth_, folder_ / "a.db");
    WriteModel(WithoutPoints(seed_), folder_ / "seed");
  }

  ColmapRun Refine(const std::vector<std::string>& more) const {
    std::vector<std::string> args = {"refine", "--json", folder_ / "refine.json"};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  }

  ColmapRun RefineSeedBy(const std::string& database) const {
    return Refine({"--input_path",
                   folder_ / "seed",
                   "--database_path",
                   folder_ / database,
                   "--output_path",
                   folder_ / "refined"});
  }

  const TemporaryFolder folder_;
  Reconstruction truth_;
  Reconstruction seed_;
};

TEST_F(RefineCommand, BringsPosesBackByTheMatchesOfADatabase) {
  const ColmapRun run = RefineSeedBy("a.db");
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Reconstruction refined = ReadModel(folder_ / "refined");
  EXPECT_EQ(FindFault(refined), "");
  EXPECT_GT(WorstRelativeRotation(seed_, truth_), 1.0);
  // 400 points of 0.3 px at 500 px focal length: some hundredths of a degree for the worst pair.
  EXPECT_LT(WorstRelativeRotation(refined, truth_), 0.1);
  const nlohmann::json json = ReadJson(folder_ / "refine.json");
  EXPECT_LT(json["held_out_after_px"].get<double>(),
            0.2 * json["held_out_before_px"].get<double>());
  ASSERT_EQ(json["views"].size(), 6u);
  for (const nlohmann::json& view : json["views"]) {
    EXPECT_EQ(view["outcome"], "refined");
    // That of the relative rotations, twice: once for the image that the gauge holds.
    EXPECT_LT(view["sigma_rotation_deg"].get<double>(), 0.2);
  }
  EXPECT_THAT(run.output, HasSubstr("tracks held out"));
}

TEST_F(RefineCommand, TakesTheTracksOfTheModelWithoutADatabase) {
  WriteModel(seed_, folder_ / "with_points");
  const ColmapRun run = Refine({"--input_path",
                                folder_ / "with_points",
                                "--output_path",
                                folder_ / "refined",
                                "--output_type",
                                "TXT"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_TRUE(fs::exists(folder_ / "refined" / "points3D.txt"));
  EXPECT_LT(WorstRelativeRotation(ReadModel(folder_ / "refined"), truth_), 0.1);
}

TEST_F(RefineCommand, KeepsPosesThatTheTracksCannotMend) {
  // Every keypoint somewhere else: whatever fits these matches is chance.
  Reconstruction wrong = truth_;
  ProjectAgain(wrong, 100.0, 3);
  WriteDatabase(wrong, folder_ / "wrong.db");
  const ColmapRun run = RefineSeedBy("wrong.db");
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Reconstruction seed = ReadModel(folder_ / "seed");
  const Reconstruction refined = ReadModel(folder_ / "refined");
  const nlohmann::json json = ReadJson(folder_ / "refine.json");
  for (const auto& [id, image] : refined.images) {
    if (json["views"][image.name]["outcome"] == "refined") continue;
    EXPECT_EQ(image.cam_from_world.translation, seed.images.at(id).cam_from_world.translation);
    EXPECT_NE(json["views"][image.name]["reason"], "");
  }
  EXPECT_LE(json["held_out_after_px"].get<double>(), json["held_out_before_px"].get<double>());
}

TEST_F(RefineCommand, ColmapReadsWhatItWrites) {
  VGTW_NEED_COLMAP();
  ASSERT_EQ(RefineSeedBy("a.db").exit_code, 0);
  const ColmapRun read = RunColmap({"model_analyzer", "--path", folder_ / "refined"});
  EXPECT_THAT(read.output, HasSubstr("Registered images: 6"));
}

TEST_F(RefineCommand, RefusesWrongInputInOneLine) {
  const std::string output = folder_ / "refined";
  const auto expect_refused = [&](std::vector<std::string> args, const std::string& reason) {
    args.insert(args.end(), {"--output_path", output});
    const ColmapRun run = Refine(args);
    EXPECT_EQ(run.exit_code, 1) << run.output;
    EXPECT_THAT(run.output, HasSubstr(reason));
    EXPECT_FALSE(fs::exists(output));
  };
  expect_refused({"--input_path", folder_ / "seed"}, "the model has no points to refine with");
  expect_refused({"--input_path", folder_ / "nowhere"}, "nowhere");
  { ColmapDatabase::Create(folder_ / "empty.db"); }
  expect_refused({"--input_path", folder_ / "seed", "--database_path", folder_ / "empty.db"},
                 "no verified matches between images of the model");
  expect_refused({"--input_path",
                  folder_ / "seed",
                  "--database_path",
                  folder_ / "a.db",
                  "--held_out_percent",
                  "0"},
                 "held_out_percent");
}

}  // namespace
}  // namespace vgtw
