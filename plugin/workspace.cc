// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/workspace.h"

#include "plugin/hashing.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "plugin/version.h"
#include "scene/error.h"
#include "scene/files.h"

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kFormat = "vgtw-run";

bool IsRecord(const json& record) {
  return record.is_object() && record.contains("format") && record["format"] == kFormat;
}

json ReadRecord(const fs::path& path) {
  const json record = json::parse(ReadFile(path), nullptr, /*allow_exceptions=*/false);
  if (!IsRecord(record)) {
    Fail(path, "is not a run record of vgtw", "one", "name another --output_path or remove it");
  }
  return record;
}

}  // namespace

Workspace::Workspace(fs::path folder, bool overwrite, bool force)
    : folder_(std::move(folder)), overwrite_(overwrite), force_(force) {
  const fs::path record_path = folder_ / "run.json";
  if (fs::exists(record_path)) {
    record_ = ReadRecord(record_path);
  } else if (fs::exists(folder_) && (!fs::is_directory(folder_) || !fs::is_empty(folder_))) {
    Fail(folder_, "exists and was not made by 'vgtw run'", "a new or empty folder", "name another");
  }
  if (!record_["stages"].is_object()) record_["stages"] = json::object();
  record_["format"] = kFormat;
  record_["vgtw_version"] = kVersion;
  std::error_code code;
  fs::create_directories(folder_ / "logs", code);
  if (code) throw Error(Printable(folder_.string()) + ": cannot be written: " + code.message());
}

Workspace::~Workspace() {
  std::error_code ignored;
  fs::remove_all(folder_ / ".scratch", ignored);
}

fs::path Workspace::log(const std::string& stage) const {
  return folder_ / "logs" / (stage + ".log");
}

fs::path Workspace::Scratch(const std::string& stage) const {
  const fs::path path = folder_ / ".scratch" / stage;
  fs::remove_all(path);
  fs::create_directories(path);
  return path;
}

json Workspace::RunStage(const std::string& stage,
                         const json& inputs,
                         const fs::path& output,
                         const std::function<json()>& work) {
  chain_ = HashText(chain_ + "\n" + stage + "\n" + kVersion + "\n" + inputs.dump());
  const json previous = record_.value("stages", json::object()).value(stage, json::object());
  const bool is_made =
      previous.contains("hash") && previous.contains("result") && fs::exists(output);
  if (is_made && previous["hash"] == chain_ && !force_) {
    Announce(stage + ": up to date");
    return previous["result"];
  }
  if (is_made && previous["hash"] != chain_ && !overwrite_ && !force_) {
    Fail(output,
         "was made from other inputs or options (stage '" + stage + "')",
         "the same ones",
         "add --overwrite to replace it, or name another --output_path");
  }
  record_["stages"].erase(stage);
  Save();
  fs::remove(log(stage));
  const auto start = std::chrono::steady_clock::now();
  const json result = work();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  record_["stages"][stage] = {{"hash", chain_}, {"seconds", seconds}, {"result", result}};
  Save();
  Announce(stage + ": done in " + FormatNumber(seconds, 1) + " s");
  return result;
}

void Workspace::Record(const std::string& key, const json& value) {
  record_[key] = value;
  Save();
}

void Workspace::Save() const { WriteFileAtomically(folder_ / "run.json", record_.dump(2) + "\n"); }

json RunRecordOf(const fs::path& model_path) {
  const fs::path whole = fs::weakly_canonical(model_path);
  const fs::path folder = whole.has_filename() ? whole : whole.parent_path();
  const fs::path path = folder.parent_path().parent_path() / "run.json";
  if (!fs::is_regular_file(path)) return nullptr;
  json record = json::parse(ReadFile(path), nullptr, /*allow_exceptions=*/false);
  return IsRecord(record) ? record : nullptr;
}

}  // namespace vgtw
