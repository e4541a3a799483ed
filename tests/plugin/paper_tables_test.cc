// SPDX-License-Identifier: BSD-3-Clause
// The paper's tables repeat each other: in more digits, as means, as halves of sums. A number that
// was copied wrongly breaks one of these laws.
#include "plugin/paper_tables.h"

#include <cmath>
#include <map>
#include <utility>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Column = std::pair<std::vector<std::string>, std::string>;  // scenes, metric
using Values = std::map<Column, double>;

const ResultTable& Table(const std::string& name) {
  for (const ResultTable& table : PaperTables()) {
    if (table.name == name) return table;
  }
  throw std::invalid_argument(name);
}

Values ValuesOf(const ResultTable& table, const TableRow& row) {
  Values values;
  size_t column = 0;
  for (const TableGroup& group : table.groups) {
    for (const TableMetric& metric : table.metrics) {
      values[{group.scenes, metric.key}] = row.values[column++];
    }
  }
  return values;
}

Values ValuesOf(const std::string& name, const std::string& system) {
  for (const TableRow& row : Table(name).rows) {
    if (row.system == system) return ValuesOf(Table(name), row);
  }
  throw std::invalid_argument(system);
}

// Two roundings of the last digit apart.
double Tolerance(const std::string& metric) { return metric == "delta" ? 0.11 : 0.0011; }

// Compares means over scenes with the scenes' values, of which there are `num_expected`.
void ExpectMeans(const std::string& means, const std::string& scenes, int num_expected) {
  int num_compared = 0;
  for (const TableRow& row : Table(scenes).rows) {
    const Values values = ValuesOf(scenes, row.system);
    for (const auto& [column, mean] : ValuesOf(means, row.system)) {
      double sum = 0.0;
      size_t num_found = 0;
      for (const std::string& scene : column.first) {
        const auto value = values.find({{scene}, column.second});
        if (value == values.end()) break;
        sum += value->second;
        ++num_found;
      }
      if (num_found < column.first.size()) continue;
      EXPECT_NEAR(sum / static_cast<double>(num_found), mean, Tolerance(column.second))
          << means << ", " << row.system << ", " << column.first.front() << " " << column.second;
      ++num_compared;
    }
  }
  EXPECT_EQ(num_compared, num_expected) << means;
}

TEST(PaperTables, MeansAreThoseOfTheScenes) {
  ExpectMeans("points_on_the_go", "points_on_the_go", 7 * 21);
  ExpectMeans("points_robustnerf", "points_robustnerf", 7 * 15);
  ExpectMeans("depth_robustnerf", "depth_robustnerf", 7 * 10);
  ExpectMeans("points_on_the_go", "points_on_the_go_scenes", 7 * 21);
  ExpectMeans("points_robustnerf", "points_robustnerf_scenes", 7 * 15);
  ExpectMeans("depth_robustnerf", "depth_robustnerf_scenes", 7 * 10);
  ExpectMeans("depth_on_the_go", "depth_on_the_go_scenes", 7 * 6);
  ExpectMeans("ablation", "ablation_on_the_go_scenes", 4 * 9);
  ExpectMeans("ablation", "ablation_robustnerf_scenes", 4 * 3);
  ExpectMeans("ablation_robustnerf_scenes", "ablation_robustnerf_scenes", 4 * 15);
}

TEST(PaperTables, OverallIsHalfTheSum) {
  int num_compared = 0;
  for (const TableRow& row : Table("ablation").rows) {
    Values values = ValuesOf(Table("ablation"), row);
    for (const TableGroup& group : Table("ablation").groups) {
      EXPECT_NEAR(0.5 * (values[{group.scenes, "acc"}] + values[{group.scenes, "comp"}]),
                  (values[{group.scenes, "overall"}]),
                  0.0011);
      ++num_compared;
    }
  }
  EXPECT_EQ(num_compared, 16);
}

TEST(PaperTables, AblationEndsOfPointsTables) {
  const Values without = ValuesOf("ablation_on_the_go_scenes", "no terms");
  EXPECT_EQ(without, ValuesOf("points_on_the_go_scenes", "VGGT"));
}

// Read off the paper by eye, those that no law above binds.
TEST(PaperTables, PosesMasksAndTimes) {
  EXPECT_EQ((ValuesOf("pose_on_the_go", "VGTW")[{{"fountain"}, "rpe_rot"}]), 122.0872);
  EXPECT_EQ((ValuesOf("pose_on_the_go", "VGGT")[{{"patio_high"}, "ate"}]), 0.5885);
  EXPECT_EQ((ValuesOf("masks", "VGTW")[{{"corner"}, "mask_f1"}]), 0.5896);
  EXPECT_EQ((ValuesOf("masks", "VGTW (poor labels)")[{{"corner"}, "mask_accuracy"}]), 0.9505);
  ASSERT_EQ(PaperTimes().rows.size(), 2u);
  EXPECT_EQ(PaperTimes().groups[2].scenes.front(), "20");
  EXPECT_EQ(PaperTimes().rows[1].values, (std::vector<double>{0.38, 0.70, 1.45}));
}

}  // namespace
}  // namespace vgtw
