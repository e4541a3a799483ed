// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>

#include <nlohmann/json.hpp>

namespace vgtw {

// The output folder of `run` (docs/design.md, "Files") and its run.json. A stage whose inputs and
// options hash to what run.json holds, and whose outputs exist, is skipped.
class Workspace {
 public:
  // Throws Error if the folder exists, is not empty and is not a workspace. `force` repeats every
  // stage; `overwrite` allows replacing a stage that was made from other inputs or options.
  Workspace(std::filesystem::path folder, bool overwrite, bool force);

  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path masks() const { return folder_ / "masks"; }
  std::filesystem::path database() const { return folder_ / "database.db"; }
  std::filesystem::path feedforward() const { return folder_ / "sparse" / "feedforward"; }
  std::filesystem::path refined() const { return folder_ / "sparse" / "refined"; }
  std::filesystem::path points() const { return folder_ / "points.ply"; }
  std::filesystem::path report() const { return folder_ / "report.html"; }
  std::filesystem::path log(const std::string& stage) const;
  // An empty scratch folder of one stage, removed by the destructor.
  std::filesystem::path Scratch(const std::string& stage) const;
  ~Workspace();

  // Runs `work` unless the stage is up to date; records its hash, time and result (what `work`
  // returns) in run.json. The hash covers `inputs` and the stages before. Returns the result.
  nlohmann::json RunStage(const std::string& stage,
                          const nlohmann::json& inputs,
                          const std::filesystem::path& output,
                          const std::function<nlohmann::json()>& work);

  // Sets a top-level entry of run.json and writes the file.
  void Record(const std::string& key, const nlohmann::json& value);
  const nlohmann::json& record() const { return record_; }

 private:
  void Save() const;

  std::filesystem::path folder_;
  bool overwrite_ = false;
  bool force_ = false;
  std::string chain_;  // hash of the stages so far
  nlohmann::json record_;
};

// run.json of the workspace that has this model as <workspace>/sparse/<name>; null where there is
// none that can be read.
nlohmann::json RunRecordOf(const std::filesystem::path& model_path);

}  // namespace vgtw
