// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions.h"
#include "plugin/commands.h"
#include "plugin/hashing.h"
#include "plugin/progress.h"
#include "plugin/protocol_flags.h"
#include "plugin/protocol_report.h"
#include "plugin/protocol_tables.h"
#include "plugin/version.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <set>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct NamedSystem {
  std::string name;
  fs::path path;
};

// "VGGT=folder/"
NamedSystem ParseSystem(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
    throw Error("--system " + Printable(text) + ", expected NAME=FOLDER, as VGGT=predictions/vggt");
  }
  NamedSystem system{text.substr(0, equals), text.substr(equals + 1)};
  if (!fs::is_directory(system.path)) {
    Fail(system.path, "is no folder", "a predictions folder per scene of " + system.name);
  }
  return system;
}

// Whose predictions they are; the hash covers every byte of a reference.
json IdentityOf(const fs::path& path, bool with_files, int num_threads) {
  json identity = {{"path", path.string()}};
  if (fs::exists(path / "predictions.json")) {
    const PredictionReader reader(path);
    identity["producer"] = reader.producer();
    identity["weights_hash"] = reader.weights_hash();
    identity["num_views"] = reader.views().size();
  }
  if (!with_files) return identity;
  identity["files_hash"] =
      fs::is_directory(path) ? HashFiles(path, ListFiles(path), num_threads) : HashFile(path);
  return identity;
}

struct ProtocolTablesCommand {
  fs::path protocol_path;
  fs::path reference_path;
  fs::path output_path;
  std::vector<std::string> system_texts;
  bool overwrite = false;
  Usability usability;

  Protocol protocol = {};
  std::vector<NamedSystem> systems = {};
  std::vector<SystemScores> scores = {};
  std::vector<std::string> warnings = {};
  json references = json::object();
  json predictions = json::array();

  void Run() {
    Apply(usability);
    protocol = ReadProtocol(protocol_path);
    ReadSystems();
    AtomicFolder folder(output_path, overwrite);
    Score();
    const std::vector<ResultTable> tables = MakeTables(protocol, scores);
    WriteTableFiles(folder.path(), tables);
    const json result = Json(tables);
    WriteFileAtomically(folder.path() / "tables.json", result.dump(1) + "\n");
    folder.Commit();
    Finish(usability, Text(tables), result);
  }

  void ReadSystems() {
    if (system_texts.empty()) throw Error("no --system, expected one or more NAME=FOLDER");
    std::set<std::string> names;
    for (const std::string& text : system_texts) {
      systems.push_back(ParseSystem(text));
      if (!names.insert(systems.back().name).second) {
        throw Error("--system " + Printable(systems.back().name) +
                    " twice, expected each name once");
      }
      scores.push_back({systems.back().name, {}});
    }
  }

  void Warn(const std::string& line) {
    warnings.push_back(line);
    Announce("warning: " + line);
  }

  // Where a scene's reference is; nullopt if nowhere.
  std::optional<fs::path> ReferenceOf(const ProtocolScene& scene) const {
    if (!scene.reference_path.empty()) return scene.reference_path;
    for (const char* extension : {"", ".ply"}) {
      fs::path path = reference_path / (scene.name + extension);
      if (!reference_path.empty() && fs::exists(path)) return path;
    }
    return std::nullopt;
  }

  void Score() {
    ProgressDisplay display("scenes");
    const ProgressCallback progress = display.Callback();
    const auto num_all = static_cast<int64_t>(protocol.scenes.size() * systems.size());
    int64_t num_done = 0;
    for (const ProtocolScene& scene : protocol.scenes) {
      const fs::path reference = UsableReference(scene);
      for (size_t i = 0; i < systems.size(); ++i) {
        ScoreOne(scene, reference, i);
        if (progress) progress(++num_done, num_all);
      }
    }
  }

  // Recorded; "" with a warning if there is none, or it is damaged.
  fs::path UsableReference(const ProtocolScene& scene) {
    const std::optional<fs::path> reference = ReferenceOf(scene);
    try {
      if (reference) {
        references[scene.name] = IdentityOf(*reference, /*with_files=*/true, usability.num_threads);
        return *reference;
      }
      Warn(scene.name + ": no reference, neither in the protocol nor as " +
           (reference_path / scene.name).string());
    } catch (const Error& error) {
      Warn(scene.name + ", reference: " + error.what());
    }
    return {};
  }

  void ScoreOne(const ProtocolScene& scene, const fs::path& reference, size_t system_idx) {
    const NamedSystem& system = systems[system_idx];
    const fs::path prediction = system.path / scene.name;
    if (!fs::exists(prediction)) {
      Warn(scene.name + ", " + system.name + ": " + prediction.string() + " does not exist");
      return;
    }
    SceneScores measured =
        ScoreScene(scene, protocol.conditions, {prediction, reference}, usability.num_threads);
    for (const std::string& warning : measured.warnings) {
      Warn(scene.name + ", " + system.name + ": " + warning);
    }
    scores[system_idx].scenes[scene.name] = std::move(measured);
    try {
      json identity = IdentityOf(prediction, /*with_files=*/false, usability.num_threads);
      identity["system"] = system.name;
      identity["scene"] = scene.name;
      predictions.push_back(std::move(identity));
    } catch (const Error&) {  // said by the warnings above
    }
  }

  json Json(const std::vector<ResultTable>& tables) const {
    json tables_json = json::array();
    for (const ResultTable& table : tables) tables_json.push_back(AsJson(table));
    return {{"format", "vgtw-tables"},
            {"version", 1},
            {"vgtw_version", kVersion},
            {"protocol_path", protocol_path.string()},
            {"protocol_hash", HashFile(protocol_path)},
            {"protocol", json::parse(ReadFile(protocol_path))},
            {"references", references},
            {"predictions", predictions},
            {"scores", ScoresAsJson(scores)},
            {"tables", std::move(tables_json)},
            {"warnings", warnings}};
  }

  std::string Text(const std::vector<ResultTable>& tables) const {
    const ProtocolConditions& conditions = protocol.conditions;
    std::string text = ScoresText(protocol, scores) + SamplingText(protocol.sampling) +
                       "\npoints: " + ConditionsText(conditions, TablePart::kPoints) +
                       "\ndepth: " + ConditionsText(conditions, TablePart::kDepth) +
                       "\nposes: " + ConditionsText(conditions, TablePart::kPoses) + "\n";
    for (const auto& [scene, identity] : references.items()) {
      text += "reference of " + scene + ": " + identity.value("producer", "not predicted") +
              ", weights " + identity.value("weights_hash", "").substr(0, 12) + ", files " +
              identity["files_hash"].get<std::string>().substr(0, 12) + "\n";
    }
    if (!warnings.empty()) text += std::to_string(warnings.size()) + " warnings, see stderr\n";
    text +=
        "written: " + output_path.string() + "/tables.json, all_tables.tex and, as .csv and .tex,";
    for (const ResultTable& table : tables) text += " " + table.name;
    return text + "\n";
  }
};

}  // namespace

std::function<void()> DeclareProtocolTables(Flags& flags) {
  const auto command = std::make_shared<ProtocolTablesCommand>();
  flags.Group("Input")
      .Require("protocol_path", &command->protocol_path, "What vgtw protocol make wrote")
      .Add("reference_path",
           &command->reference_path,
           "Folder with the pseudo ground truth of each scene, <scene>/ (predictions or a COLMAP "
           "model) or <scene>.ply; scenes may name another in the protocol")
      .Add("system",
           &command->system_texts,
           "NAME=FOLDER with a predictions folder per scene; once per row of the tables");
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Folder to write: JSON, CSV and LaTeX")
      .Add("overwrite", &command->overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
