// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/protocol_tables.h"

#include "plugin/paper_tables.h"
#include "plugin/protocol_flags.h"

#include <algorithm>
#include <array>
#include <set>
#include <string_view>
#include <utility>

namespace vgtw {
namespace {

// What one table is about, for scenes that the paper has no table of.
struct Family {
  const char* name;
  const char* title;
  std::array<const char*, 7> metrics;  // keys, then nullptr
};

constexpr std::string_view kMaskFamily = "masks";
constexpr Family kFamilies[] = {
    {"points", "Points", {"acc", "comp", "overall", "nc"}},
    {"depth", "Depth", {"abs_rel", "delta"}},
    {"poses", "Camera poses", {"rpe_trans", "rpe_rot", "ate"}},
    {"masks",
     "Distractor masks",
     {"mask_accuracy", "mask_precision", "mask_recall", "mask_f1", "mask_iou", "mask_dice"}},
};

// Scenes of other data sets may have the names of the paper's.
bool IsOfPaper(const Protocol& protocol) {
  return protocol.dataset == "robustnerf" || protocol.dataset == "on_the_go" ||
         protocol.dataset == "paper";
}

bool IsOfMasks(const ResultTable& table) { return table.metrics.front().key.starts_with("mask_"); }

TablePart PartOf(const ResultTable& table) {
  const std::string& metric = table.metrics.front().key;
  if (IsOfMasks(table)) return TablePart::kMasks;
  if (metric == "abs_rel") return TablePart::kDepth;
  return metric == "rpe_trans" ? TablePart::kPoses : TablePart::kPoints;
}

double ValueOf(const SystemScores& system,
               const std::vector<std::string>& scenes,
               const std::string& metric) {
  double sum = 0.0;
  for (const std::string& scene : scenes) {
    const auto scores = system.scenes.find(scene);
    if (scores == system.scenes.end()) return SceneScores::kNone;
    sum += scores->second.*(FindMetric(metric)->value);
  }
  return sum / static_cast<double>(scenes.size());
}

// In front of the rows that are there.
void AddSystems(const std::vector<SystemScores>& systems, ResultTable& table) {
  std::vector<TableRow> rows;
  for (const SystemScores& system : systems) {
    TableRow row{.system = system.name, .latex = "", .is_published = false, .values = {}};
    for (const TableGroup& group : table.groups) {
      for (const TableMetric& metric : table.metrics) {
        row.values.push_back(ValueOf(system, group.scenes, metric.key));
      }
    }
    rows.push_back(std::move(row));
  }
  table.rows.insert(table.rows.begin(), rows.begin(), rows.end());
}

// The columns of a paper's table whose scenes the protocol has any of.
ResultTable Restricted(const ResultTable& table, const std::set<std::string>& scenes) {
  ResultTable restricted = table;
  restricted.groups.clear();
  for (TableRow& row : restricted.rows) row.values.clear();
  const auto num_metrics = static_cast<std::ptrdiff_t>(table.metrics.size());
  for (size_t i = 0; i < table.groups.size(); ++i) {
    const std::vector<std::string>& wanted = table.groups[i].scenes;
    if (std::none_of(wanted.begin(), wanted.end(), [&](const std::string& scene) {
          return scenes.contains(scene);
        })) {
      continue;
    }
    restricted.groups.push_back(table.groups[i]);
    for (size_t row = 0; row < table.rows.size(); ++row) {
      const auto first =
          table.rows[row].values.begin() + static_cast<std::ptrdiff_t>(i) * num_metrics;
      std::vector<double>& values = restricted.rows[row].values;
      values.insert(values.end(), first, first + num_metrics);
    }
  }
  return restricted;
}

ResultTable GenericTable(const Family& family, const std::vector<const ProtocolScene*>& scenes) {
  ResultTable table{.name = family.name,
                    .title = family.title,
                    .conditions = "",
                    .groups = {},
                    .metrics = {},
                    .rows = {}};
  std::vector<std::string> names;
  for (const ProtocolScene* scene : scenes) {
    table.groups.push_back({{scene->title}, {scene->name}});
    names.push_back(scene->name);
  }
  if (names.size() > 1) table.groups.push_back({{"Average"}, names});
  for (const char* key : family.metrics) {
    if (key != nullptr) table.metrics.push_back(ColumnOf(*FindMetric(key)));
  }
  return table;
}

// Whether some table has a column of this metric for the scene alone.
bool Covers(const std::vector<ResultTable>& tables,
            const std::string& scene,
            const std::string& metric) {
  return std::any_of(tables.begin(), tables.end(), [&](const ResultTable& table) {
    return table.metrics.front().key == metric &&
           std::any_of(table.groups.begin(), table.groups.end(), [&](const TableGroup& group) {
             return group.scenes == std::vector<std::string>{scene};
           });
  });
}

}  // namespace

std::vector<ResultTable> MakeTables(const Protocol& protocol,
                                    const std::vector<SystemScores>& systems) {
  std::set<std::string> all;
  std::set<std::string> with_masks;
  for (const ProtocolScene& scene : protocol.scenes) {
    all.insert(scene.name);
    if (!scene.mask_path.empty()) with_masks.insert(scene.name);
  }
  std::vector<ResultTable> tables;
  for (const ResultTable& paper :
       IsOfPaper(protocol) ? PaperTables() : std::vector<ResultTable>()) {
    ResultTable table = Restricted(paper, IsOfMasks(paper) ? with_masks : all);
    if (!table.groups.empty()) tables.push_back(std::move(table));
  }
  std::vector<ResultTable> others;
  for (const Family& family : kFamilies) {
    std::vector<const ProtocolScene*> scenes;
    for (const ProtocolScene& scene : protocol.scenes) {
      if (family.name == kMaskFamily && !with_masks.contains(scene.name)) continue;
      if (!Covers(tables, scene.name, family.metrics.front())) scenes.push_back(&scene);
    }
    if (scenes.empty()) continue;
    ResultTable table = GenericTable(family, scenes);
    if (std::any_of(tables.begin(), tables.end(), [&](const ResultTable& paper) {
          return paper.metrics.front().key == family.metrics.front();
        })) {
      table.name += "_other_scenes";
    }
    others.push_back(std::move(table));
  }
  tables.insert(tables.end(), others.begin(), others.end());
  for (ResultTable& table : tables) {
    table.conditions = "Measured on " + SamplingText(protocol.sampling) + "; " +
                       ConditionsText(protocol.conditions, PartOf(table));
    AddSystems(systems, table);
  }
  return tables;
}

}  // namespace vgtw
