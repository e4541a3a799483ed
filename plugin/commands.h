// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/flags.h"

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// One function per command, each in its own command_<name>.cc: declares flags, returns the work.
std::function<void()> DeclareCompare(Flags& flags);
std::function<void()> DeclareDatasetCheck(Flags& flags);
std::function<void()> DeclareDatasetCorrupt(Flags& flags);
std::function<void()> DeclareDatasetStats(Flags& flags);
std::function<void()> DeclareDemo(Flags& flags);
std::function<void()> DeclareDoctor(Flags& flags);
std::function<void()> DeclareEvaluateDepth(Flags& flags);
std::function<void()> DeclareEvaluatePoints(Flags& flags);
std::function<void()> DeclareEvaluatePose(Flags& flags);
std::function<void()> DeclareExport(Flags& flags);
std::function<void()> DeclareImport(Flags& flags);
std::function<void()> DeclareMaskApply(Flags& flags);
std::function<void()> DeclareMaskConvert(Flags& flags);
std::function<void()> DeclareMaskLint(Flags& flags);
std::function<void()> DeclareMaskMake(Flags& flags);
std::function<void()> DeclareMaskPreview(Flags& flags);
std::function<void()> DeclareMaskRestore(Flags& flags);
std::function<void()> DeclareMaskScore(Flags& flags);
std::function<void()> DeclareMaskUndistort(Flags& flags);
std::function<void()> DeclareMaskVote(Flags& flags);
std::function<void()> DeclareMatch(Flags& flags);
std::function<void()> DeclareProtocolMake(Flags& flags);
std::function<void()> DeclareProtocolPhotos(Flags& flags);
std::function<void()> DeclareProtocolTables(Flags& flags);
std::function<void()> DeclareProtocolTimes(Flags& flags);
std::function<void()> DeclareRefine(Flags& flags);
std::function<void()> DeclareRun(Flags& flags);
std::function<void()> DeclareSeed(Flags& flags);

// The table behind `vgtw --help`.
const std::vector<Command>& Commands();

// Flags that every command has.
struct Usability {
  int num_threads = 0;
  std::string progress = "auto";
  std::filesystem::path json_path;
};
void AddUsability(Flags& flags, Usability& usability);

// Puts --progress into force. First line of every command's work.
void Apply(const Usability& usability);

// Prints `text` on stdout and writes `result` to --json where that was given.
void Finish(const Usability& usability, const std::string& text, const nlohmann::json& result);

}  // namespace vgtw
