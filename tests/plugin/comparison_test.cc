// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison.h"

#include "bridge/mask_files.h"
#include "scene/error.h"
#include "scene/image_io.h"
#include "tests/support/model_database.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using nlohmann::json;

Reconstruction MakeTruth() {
  Reconstruction model = MakeSyntheticModel({});
  ProjectAgain(model, 0.5, 1);
  return model;
}

class CompareModelsTest : public testing::Test {
 protected:
  CompareModelsTest() {
    const Reconstruction truth = MakeTruth();
    Reconstruction off = truth;
    PerturbPoses(off, 1.0, 0.05, 3);
    inputs_.models = {{"off", "off/", off}, {"true", "true/", truth}};
    inputs_.reference = CamFromWorldByName(truth);
  }

  const json& ViewOf(const json& comparison, const std::string& name) const {
    for (const json& view : comparison.at("views")) {
      if (view.at("name") == name) return view;
    }
    throw std::out_of_range(name);
  }

  TemporaryFolder folder_;
  ComparisonInputs inputs_;
};

TEST_F(CompareModelsTest, ErrorsAndChangesAreThoseOfThePoses) {
  const json comparison = CompareModels(inputs_);
  const json& off = comparison.at("models").at(0);
  const json& good = comparison.at("models").at(1);
  EXPECT_EQ(off.at("role"), "before");
  EXPECT_EQ(off.at("error_histogram").at("step"), good.at("error_histogram").at("step"));
  EXPECT_EQ(good.at("track_histogram").at("counts").at(4), 120);  // six photos see each point
  EXPECT_EQ(good.at("role"), "after");
  // An arc cosine of nearly 1.
  EXPECT_NEAR(good.at("pose_error").at("rotation_median_deg"), 0.0, 1e-6);
  EXPECT_NEAR(good.at("pose_error").at("centre_rmse_percent"), 0.0, 1e-9);
  EXPECT_NEAR(good.at("scale_drift_percent"), 0.0, 1e-9);
  EXPECT_GT(off.at("pose_error").at("rotation_median_deg"), 0.3);
  for (const json& view : comparison.at("views")) {
    const json& first = view.at("by_model").at(0);
    const json& last = view.at("by_model").at(1);
    EXPECT_NEAR(first.at("rotation_change_deg"), 0.0, 1e-6);
    EXPECT_NEAR(last.at("rotation_error_deg"), 0.0, 1e-6);
    // The reference is the last model: what it changed is what was wrong.
    EXPECT_NEAR(last.at("rotation_change_deg"), first.at("rotation_error_deg"), 1e-6);
    EXPECT_TRUE(last.at("held_out_px").is_null());
    EXPECT_TRUE(last.at("observations_on_distractors").is_null());
    EXPECT_TRUE(last.at("status").is_null());
  }
  EXPECT_TRUE(comparison.at("summary").at(0).get<std::string>().starts_with(
      "'true' is closer to the reference than 'off'"));
}

TEST_F(CompareModelsTest, TracksHeldOutJudge) {
  inputs_.reference.clear();
  inputs_.database_path = folder_ / "a.db";
  {
    ColmapDatabase database = CreateDatabaseOf(MakeTruth(), inputs_.database_path);
    WriteMatchesOfTracks(MakeTruth(), database);
  }
  const json comparison = CompareModels(inputs_);
  // Noise of 0.5 px in both coordinates, of which the point takes its part.
  EXPECT_LT(comparison.at("models").at(1).at("held_out_px"), 0.7);
  EXPECT_GT(comparison.at("models").at(0).at("held_out_px"), 2.0);
  EXPECT_TRUE(comparison.at("models").at(0).at("pose_error").is_null());
  for (const json& view : comparison.at("views")) {
    EXPECT_LT(view.at("by_model").at(1).at("held_out_px"), 0.9) << view.at("name");
  }
  EXPECT_TRUE(comparison.at("summary").at(0).get<std::string>().starts_with(
      "'true' explains tracks held out better than 'off'"));
}

TEST_F(CompareModelsTest, OtherIdsThanTheDatabasesAreNotJudged) {
  inputs_.database_path = folder_ / "a.db";
  {
    Reconstruction other = MakeTruth();
    std::swap(other.images.at(1).name, other.images.at(2).name);
    ColmapDatabase database = CreateDatabaseOf(other, inputs_.database_path);
    WriteMatchesOfTracks(other, database);
  }
  const json comparison = CompareModels(inputs_);
  EXPECT_TRUE(comparison.at("models").at(1).at("held_out_px").is_null());
  ASSERT_EQ(comparison.at("notes").size(), 1u);
  EXPECT_NE(comparison.at("notes").at(0).get<std::string>().find("other image ids"),
            std::string::npos);
}

TEST_F(CompareModelsTest, MasksTellWhatLiesOnDistractors) {
  inputs_.mask_path = folder_ / "masks";
  StaticMask mask(640, 480, 255);
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 320; ++x) mask(x, y) = 0;
  }
  WriteImage(MaskPath(inputs_.mask_path, "image2.jpg"), mask);
  size_t num_excluded = 0;
  for (const Point2D& point2D : inputs_.models.back().model.images.at(2).points2D) {
    num_excluded += point2D.xy.x() < 320.0;
  }
  ASSERT_GT(num_excluded, 10u);
  const json comparison = CompareModels(inputs_);
  EXPECT_EQ(comparison.at("models").at(1).at("points_on_distractors"), num_excluded);
  EXPECT_EQ(ViewOf(comparison, "image2.jpg").at("excluded_percent"), 50.0);
  EXPECT_EQ(ViewOf(comparison, "image1.jpg").at("excluded_percent"), 0.0);
  EXPECT_EQ(ViewOf(comparison, "image2.jpg").at("by_model").at(1).at("observations_on_distractors"),
            num_excluded);
  WriteImage(MaskPath(inputs_.mask_path, "image3.jpg"), StaticMask(64, 48, 255));
  EXPECT_THROW(CompareModels(inputs_), Error);
}

TEST_F(CompareModelsTest, MissingViewsAreNull) {
  Reconstruction& fewer = inputs_.models.back().model;
  for (uint32_t i = 0; i < fewer.images.at(4).points2D.size(); ++i)
    RemoveObservation(fewer, {4, i});
  fewer.images.erase(4);
  const json comparison = CompareModels(inputs_);
  const json& view = ViewOf(comparison, "image4.jpg");
  EXPECT_TRUE(view.at("by_model").at(0).is_object());
  EXPECT_TRUE(view.at("by_model").at(1).is_null());
  EXPECT_EQ(comparison.at("guilty").at(0).at("name"), "image4.jpg");
}

TEST_F(CompareModelsTest, TakesStatusFromTheRecordOfTheRun) {
  const json record = {
      {"stages",
       {{"refine",
         {{"result",
           {{"held_out_max_px", 12.5},
            {"views", {{"image3.jpg", {{"outcome", "kept"}, {"reason", "too few"}}}}}}}}}}},
      {"options", {{"refine", {{"held_out_percent", 20.0}, {"seed", 7}}}}}};
  UseRunRecord(record, inputs_);
  EXPECT_EQ(inputs_.held_out_max_px, 12.5);
  EXPECT_EQ(inputs_.held_out_percent, 20.0);
  EXPECT_EQ(inputs_.held_out_seed, 7u);
  const json comparison = CompareModels(inputs_);
  EXPECT_EQ(ViewOf(comparison, "image3.jpg").at("by_model").at(1).at("status"), "kept");
  EXPECT_TRUE(ViewOf(comparison, "image3.jpg").at("by_model").at(0).at("status").is_null());
  EXPECT_TRUE(ViewOf(comparison, "image1.jpg").at("by_model").at(1).at("status").is_null());
  const ComparisonInputs before = inputs_;
  for (const json& other : {json(nullptr), json::object(), json{{"stages", 3}}}) {
    UseRunRecord(other, inputs_);
    EXPECT_EQ(inputs_.refinement, before.refinement);
  }
}

}  // namespace
}  // namespace vgtw
