// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_database.h"
#include "plugin/colmap.h"
#include "plugin/commands.h"
#include "plugin/network_program.h"
#include "plugin/subprocess.h"
#include "plugin/table.h"
#include "plugin/version.h"
#include "scene/error.h"
#include "scene/memory.h"

#include <filesystem>
#include <memory>
#include <thread>

#include <stdlib.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// One line of the check-up.
struct Finding {
  std::string subject;
  bool is_good = false;
  std::string found;
  std::string advice = {};  // what to do, if it is not good
};

// What the installed colmap makes of an empty database.
std::string DescribeNewDatabase(const Colmap& colmap) {
  std::string folder = (fs::temp_directory_path() / "vgtw-doctor-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) FailErrno(folder, "cannot be made");
  const fs::path database_path = fs::path(folder) / "database.db";
  std::string description;
  try {
    RunSubprocess(colmap.executable(),
                  {"database_creator", "--database_path", database_path.string()});
    description =
        ColmapDatabase(database_path, ColmapDatabase::Mode::kReadOnly).schema().Describe();
  } catch (const Error& error) {
    description = std::string("database_creator failed: ") + error.what();
  }
  std::error_code ignored;
  fs::remove_all(folder, ignored);
  return description;
}

Finding CheckColmap(const fs::path& executable, json& result) {
  try {
    const Colmap colmap(executable);
    const std::string schema = DescribeNewDatabase(colmap);
    result["colmap"] = {{"executable", colmap.executable().string()},
                        {"version", colmap.version()},
                        {"schema", schema}};
    return {"colmap",
            true,
            colmap.version() + " at " + colmap.executable().string() + ", writes " + schema};
  } catch (const Error& error) {
    return {"colmap", false, error.what(), "apt-get install colmap (run and demo need it)"};
  }
}

Finding CheckNetwork(json& result) {
  const fs::path program = FindNetworkProgram();
  if (program.empty()) {
    return {"LibTorch",
            false,
            "vgtw-network is not installed",
            "build with -DVGTW_WITH_NETWORK=ON after apt-get install libtorch-dev; everything that "
            "reads predictions works without it"};
  }
  PrepareNetworkEnvironment();
  const SubprocessResult run = RunSubprocess(program, {"runtime"});
  const json runtime = json::parse(run.output, nullptr, /*allow_exceptions=*/false);
  if (run.exit_code != 0 || !runtime.is_object()) {
    return {"LibTorch", false, "does not run: " + Printable(run.output), "reinstall libtorch-dev"};
  }
  result["libtorch"] = runtime;
  return {"LibTorch", true, runtime.value("summary", runtime.dump())};
}

std::string Format(const std::vector<Finding>& findings) {
  std::string text = std::string("vgtw ") + kVersion + "\n";
  for (const Finding& finding : findings) {
    text += std::string(finding.is_good ? "  ok       " : "  missing  ") + finding.subject + ": " +
            finding.found + "\n";
    if (!finding.advice.empty()) text += "           -> " + finding.advice + "\n";
  }
  return text;
}

struct DoctorCommand {
  fs::path colmap;
  Usability usability;

  void Run() const {
    Apply(usability);
    const double total_gib = static_cast<double>(TotalMemory()) / kGib;
    const double available_gib = static_cast<double>(AvailableMemory()) / kGib;
    json result = {{"vgtw", kVersion},
                   {"num_cores", std::thread::hardware_concurrency()},
                   {"memory_gib", total_gib},
                   {"memory_available_gib", available_gib}};
    std::vector<Finding> findings = {CheckColmap(colmap, result), CheckNetwork(result)};
    findings.push_back({"machine",
                        true,
                        std::to_string(std::thread::hardware_concurrency()) + " cores, " +
                            FormatNumber(available_gib, 1) + " of " + FormatNumber(total_gib, 1) +
                            " GiB memory free"});
    const bool has_colmap = result.contains("colmap");
    std::string text = Format(findings);
    text += "\nWorks here: import, mask, seed";
    if (result.contains("libtorch")) text += ", predict, probe, weights";
    text += has_colmap ? ", run, demo\n" : "\nNeeds colmap: run, demo\n";
    text += has_colmap ? "Next: vgtw demo --output_path demo/\n" : "Next: apt-get install colmap\n";
    Finish(usability, text, result);
  }
};

}  // namespace

std::function<void()> DeclareDoctor(Flags& flags) {
  const auto command = std::make_shared<DoctorCommand>();
  flags.Group("Input").Add(
      "colmap", &command->colmap, "The colmap executable; empty = the one on PATH");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
