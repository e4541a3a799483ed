// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/protocol_tables.h"

#include "plugin/paper_tables.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;

Protocol ProtocolOf(const std::string& dataset, const std::vector<std::string>& names) {
  Protocol protocol;
  protocol.dataset = dataset;
  for (const std::string& name : names) {
    ProtocolScene scene;
    scene.name = scene.title = name;
    protocol.scenes.push_back(scene);
  }
  return protocol;
}

SceneScores Scores(double acc) {
  SceneScores scores;
  scores.acc = acc;
  return scores;
}

std::vector<std::string> NamesOf(const std::vector<ResultTable>& tables) {
  std::vector<std::string> names;
  for (const ResultTable& table : tables) names.push_back(table.name);
  return names;
}

const std::vector<std::string> kOnTheGo = {
    "mountain", "fountain", "corner", "patio", "spot", "patio_high"};

TEST(MakeTables, HaveThePapersColumnsAndNumbers) {
  const std::vector<ResultTable> tables =
      MakeTables(ProtocolOf("on_the_go", kOnTheGo), {{"A", {}}});
  EXPECT_THAT(NamesOf(tables),
              ElementsAre("points_on_the_go",
                          "depth_on_the_go",
                          "ablation",
                          "points_on_the_go_scenes",
                          "depth_on_the_go_scenes",
                          "pose_on_the_go",
                          "ablation_on_the_go_scenes"));
  const ResultTable& points = tables[0];
  EXPECT_EQ(points.groups.size(), 7u);
  EXPECT_THAT(points.groups[5].heads, ElementsAre("High occlusion", "Patio-High"));
  EXPECT_EQ(points.rows.size(), 8u);
  EXPECT_EQ(points.rows[1].values, PaperTables()[0].rows[0].values);
  // Of the ablation the levels, not the column of the other data set.
  EXPECT_EQ(tables[2].groups.size(), 3u);
  EXPECT_EQ(tables[2].rows[1].values.size(), 12u);
}

TEST(MakeTables, BothDataSetsMakeTheWholeAblation) {
  std::vector<std::string> names = kOnTheGo;
  names.insert(names.end(), {"android", "crab1", "crab2", "yoda"});
  for (const ResultTable& table : MakeTables(ProtocolOf("paper", names), {})) {
    if (table.name == "ablation") {
      EXPECT_EQ(table.groups.size(), 4u);
    }
  }
}

TEST(MakeTables, MeansNeedEveryScene) {
  std::map<std::string, SceneScores> scenes;
  for (size_t i = 0; i < kOnTheGo.size(); ++i) {
    scenes[kOnTheGo[i]] = Scores(static_cast<double>(i + 1));
  }
  std::map<std::string, SceneScores> without_spot = scenes;
  without_spot.erase("spot");
  const ResultTable points =
      MakeTables(ProtocolOf("on_the_go", kOnTheGo), {{"all", scenes}, {"some", without_spot}})[0];
  EXPECT_EQ(points.rows[0].values[0], 1.0);
  EXPECT_EQ(points.rows[0].values[18], 3.5);  // (1 + ... + 6) / 6
  EXPECT_EQ(points.rows[1].values[0], 1.0);
  EXPECT_TRUE(std::isnan(points.rows[1].values[12]));
  EXPECT_TRUE(std::isnan(points.rows[1].values[18]));
}

// Strecha's fountain is another one.
TEST(MakeTables, OtherDataSetsTakeNothingFromThePaper) {
  const std::vector<ResultTable> tables = MakeTables(ProtocolOf("folder", {"fountain", "corner"}),
                                                     {{"A", {{"fountain", Scores(2.0)}}}});
  EXPECT_THAT(NamesOf(tables), ElementsAre("points", "depth", "poses"));
  EXPECT_EQ(tables[0].rows.size(), 1u);
  EXPECT_THAT(tables[0].groups[2].scenes, ElementsAre("fountain", "corner"));
  EXPECT_EQ(tables[0].rows[0].values[0], 2.0);
}

TEST(MakeTables, MasksWhereScenesHaveTrueOnes) {
  Protocol protocol = ProtocolOf("on_the_go", kOnTheGo);
  protocol.scenes[2].mask_path = "masks/corner";
  EXPECT_THAT(NamesOf(MakeTables(protocol, {})), testing::Contains("masks"));
  protocol.scenes[4].mask_path = "masks/spot";
  const std::vector<ResultTable> tables = MakeTables(protocol, {});
  EXPECT_EQ(tables.back().name, "masks_other_scenes");
  EXPECT_THAT(tables.back().groups[0].scenes, ElementsAre("spot"));
}

TEST(MakeTables, RobustNerfHasPosesThatThePaperLacks) {
  const std::vector<ResultTable> tables =
      MakeTables(ProtocolOf("robustnerf", {"android", "yoda"}), {{"A", {}}});
  EXPECT_THAT(NamesOf(tables),
              ElementsAre("points_robustnerf",
                          "depth_robustnerf",
                          "ablation",
                          "points_robustnerf_scenes",
                          "depth_robustnerf_scenes",
                          "ablation_robustnerf_scenes",
                          "poses"));
  EXPECT_EQ(tables[0].groups.size(), 3u);  // two scenes and the mean
}

}  // namespace
}  // namespace vgtw
