// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison_findings.h"

#include <string>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using nlohmann::json;

json Model(const std::string& name, json pose_error, json held_out_px) {
  return {{"name", name},
          {"num_images", 3},
          {"num_points3D", 10},
          {"num_observations", 30},
          {"median_px", 0.5},
          {"held_out_px", std::move(held_out_px)},
          {"pose_error", std::move(pose_error)}};
}

json PoseError(double rotation_deg, double centre_percent) {
  return {{"rotation_median_deg", rotation_deg},
          {"centre_rmse_percent", centre_percent},
          {"num_views", 3}};
}

json OfModel() {
  return {{"num_observations", 100},
          {"held_out_px", 1.0},
          {"rotation_error_deg", 0.5},
          {"observations_on_distractors", nullptr},
          {"status", "refined"},
          {"reason", ""}};
}

json View(const std::string& name) {
  return {{"name", name}, {"excluded_percent", 10.0}, {"by_model", {OfModel(), OfModel()}}};
}

json Comparison(json first, json last) {
  return {{"models", {std::move(first), std::move(last)}},
          {"views", json::array({View("a.jpg")})},
          {"guilty", json::array()}};
}

std::string Answer(const json& first, const json& last) {
  return Summarise(Comparison(first, last)).at(0);
}

TEST(Summarise, TheReferenceAnswersFirst) {
  const json before = Model("before", PoseError(0.2, 2.0), 1.0);
  const auto answer = [&](double rotation_deg, double centre_percent) {
    return Answer(before, Model("after", PoseError(rotation_deg, centre_percent), 9.0));
  };
  EXPECT_TRUE(answer(0.1, 1.0).starts_with("'after' is closer to the reference than 'before'"));
  EXPECT_TRUE(answer(0.1, 2.0).starts_with("'after' is closer"));
  EXPECT_TRUE(answer(0.2, 1.0).starts_with("'after' is closer"));
  EXPECT_TRUE(answer(0.3, 3.0).starts_with("'after' is farther"));
  EXPECT_TRUE(answer(0.2, 3.0).starts_with("'after' is farther"));
  EXPECT_TRUE(answer(0.201, 1.99).starts_with("'after' is neither closer"));
  EXPECT_TRUE(answer(0.1, 3.0).starts_with("'after' has better rotations, but worse centres"));
  EXPECT_TRUE(answer(0.3, 1.0).starts_with("'after' has better centres, but worse rotations"));
  const json figures =
      Summarise(Comparison(before, Model("after", PoseError(0.1, 1.0), 9.0))).at(1);
  EXPECT_EQ(
      figures,
      "Rotation errors went from 0.200 to 0.100 deg (median over pairs), those of centres from "
      "2.000 to 1.000 % of the "
      "extent (RMSE, Sim3-aligned), 3 photos.");
}

TEST(Summarise, WithoutAReferenceTracksHeldOutAnswer) {
  const json before = Model("before", nullptr, 1.0);
  EXPECT_TRUE(Answer(before, Model("after", nullptr, 0.9))
                  .starts_with("'after' explains tracks held out better than 'before'."));
  EXPECT_TRUE(Answer(before, Model("after", nullptr, 1.1))
                  .starts_with("'after' explains tracks held out worse"));
  EXPECT_TRUE(Answer(before, Model("after", nullptr, 1.0))
                  .starts_with("'after' explains tracks held out as well as"));
}

TEST(Summarise, WithoutEitherNothingIsClaimed) {
  const json sentences =
      Summarise(Comparison(Model("before", nullptr, nullptr), Model("after", nullptr, nullptr)));
  EXPECT_EQ(sentences.at(0), "1 of 1 photos have a refined pose.");
  for (const json& sentence : sentences) {
    EXPECT_EQ(sentence.get<std::string>().find("better"), std::string::npos);
  }
}

TEST(FindGuiltyViews, NamesWhatGotWorseWorstFirst) {
  json comparison = Comparison(Model("before", nullptr, 1.0), Model("after", nullptr, 1.0));
  json worse = View("worse.jpg");
  worse["by_model"][1]["held_out_px"] = 1.2;
  json farther = View("farther.jpg");
  farther["by_model"][1]["rotation_error_deg"] = 0.7;
  json missing = View("missing.jpg");
  missing["by_model"][1] = nullptr;
  json few = View("few.jpg");
  few["by_model"][1]["num_observations"] = 12;
  json kept = View("kept.jpg");
  kept["by_model"][1]["status"] = "kept";
  kept["by_model"][1]["reason"] = "too few";
  comparison["views"] = {View("good.jpg"), few, worse, farther, missing, kept};
  const json guilty = FindGuiltyViews(comparison);
  ASSERT_EQ(guilty.size(), 5u);
  EXPECT_EQ(guilty.at(0).at("name"), "missing.jpg");
  EXPECT_EQ(guilty.at(1),
            (json{{"name", "farther.jpg"},
                  {"why", "farther from the reference, rotation error from 0.500 to 0.700 deg"}}));
  EXPECT_EQ(guilty.at(2), (json{{"name", "kept.jpg"}, {"why", "keeps its pose: too few"}}));
  EXPECT_EQ(
      guilty.at(3),
      (json{{"name", "worse.jpg"}, {"why", "tracks held out fit worse, from 1.00 to 1.20 px"}}));
  EXPECT_EQ(guilty.at(4), (json{{"name", "few.jpg"}, {"why", "only 12 observations"}}));
}

}  // namespace
}  // namespace vgtw
