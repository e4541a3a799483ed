// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/network_program.h"
#include "plugin/network_times.h"
#include "plugin/paper_tables.h"
#include "plugin/progress.h"
#include "plugin/protocol_report.h"
#include "plugin/subprocess.h"
#include "plugin/table.h"
#include "scene/error.h"
#include "scene/files.h"

#include <cmath>
#include <fstream>
#include <memory>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string CpuName() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    const size_t colon = line.find(':');
    if (line.starts_with("model name") && colon + 2 < line.size()) return line.substr(colon + 2);
  }
  return "unknown processor";
}

struct ProtocolTimesCommand {
  NetworkTimesOptions options;
  fs::path weights_path;
  fs::path lora_path;
  fs::path output_path;
  std::string device;
  std::string precision;
  std::string title;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    options.program = RequireNetworkProgram();
    AtomicFolder folder(output_path, overwrite);
    options.scratch = folder.path() / "scratch";
    fs::create_directory(options.scratch);
    SetFlags();
    const std::string machine = Machine();
    ProgressDisplay display("runs");
    const std::vector<NetworkTime> times = MeasureNetwork(options, display.Callback());
    fs::remove_all(options.scratch);
    ResultTable table = Table(times);
    table.conditions = Conditions(machine);
    WriteTableFiles(folder.path(), {table});
    const json result = Json(table, times, machine);
    WriteFileAtomically(folder.path() / "times.json", result.dump(1) + "\n");
    folder.Commit();
    Finish(usability, Text(table, times), result);
  }

  void SetFlags() {
    const auto add = [&](const char* flag, const std::string& value) {
      if (!value.empty()) options.flags.insert(options.flags.end(), {flag, value});
    };
    add("--weights_path", weights_path.string());
    add("--lora_path", lora_path.string());
    add("--device", device);
    add("--precision", precision);
    if (usability.num_threads != 0) add("--threads", std::to_string(usability.num_threads));
  }

  std::string Machine() const {
    const SubprocessResult run = RunSubprocess(options.program, {"runtime"});
    const json runtime = json::parse(run.output, nullptr, /*allow_exceptions=*/false);
    return CpuName() + (runtime.is_object() ? "; " + runtime.value("summary", "") : "");
  }

  std::string Conditions(const std::string& machine) const {
    return "Trunk, cameras and heads, without reading photos and weights; median of " +
           std::to_string(options.num_repeats) + " processes; " +
           (device.empty() ? "default device" : device) + " of " + machine;
  }

  ResultTable Table(const std::vector<NetworkTime>& times) const {
    const ResultTable& paper = PaperTimes();
    ResultTable table = paper;
    table.groups.clear();
    TableRow measured{.system = title.empty() ? weights_path.stem().string() : title,
                      .latex = "",
                      .is_published = false,
                      .values = {}};
    for (TableRow& row : table.rows) row.values.clear();
    for (const int64_t num_views : options.num_views) {
      const std::string text = std::to_string(num_views);
      table.groups.push_back({{text + " views"}, {text}});
      measured.values.push_back(std::nan(""));
      for (const NetworkTime& time : times) {
        if (time.num_views == num_views) measured.values.back() = time.median_sec;
      }
      for (size_t row = 0; row < table.rows.size(); ++row) {
        double seconds = std::nan("");
        for (size_t i = 0; i < paper.groups.size(); ++i) {
          if (paper.groups[i].scenes.front() == text) seconds = paper.rows[row].values[i];
        }
        table.rows[row].values.push_back(seconds);
      }
    }
    table.rows.insert(table.rows.begin(), std::move(measured));
    return table;
  }

  std::string Text(const ResultTable& table, const std::vector<NetworkTime>& times) const {
    std::vector<std::vector<std::string>> rows = {{"seconds"}};
    for (const TableGroup& group : table.groups) rows[0].push_back(group.heads.front());
    for (const TableRow& row : table.rows) {
      rows.push_back({row.system + (row.is_published ? " (paper, its own GPU)" : "")});
      for (const double value : row.values) rows.back().push_back(FormatNumber(value, 2));
    }
    std::string text = FormatTable(rows) + table.conditions + "\n";
    if (times.size() < options.num_views.size()) {
      text += "warning: too few photos in " + options.image_path.string() + " for some columns\n";
    }
    return text + "written: " + output_path.string() + "\n";
  }

  json Json(const ResultTable& table,
            const std::vector<NetworkTime>& times,
            const std::string& machine) const {
    json runs = json::array();
    for (const NetworkTime& time : times) {
      runs.push_back({{"num_views", time.num_views},
                      {"seconds", time.seconds},
                      {"median_sec", time.median_sec},
                      {"predict", time.summary}});
    }
    return {{"format", "vgtw-times"},
            {"version", 1},
            {"machine", machine},
            {"flags", options.flags},
            {"runs", std::move(runs)},
            {"table", AsJson(table)}};
  }
};

}  // namespace

std::function<void()> DeclareProtocolTimes(Flags& flags) {
  const auto command = std::make_shared<ProtocolTimesCommand>();
  NetworkTimesOptions& options = command->options;
  flags.Group("Input")
      .Require("image_path", &options.image_path, "Photos, as many as the largest of --views")
      .Require("weights_path", &command->weights_path, "Weights, as of vgtw predict")
      .Add("lora_path", &command->lora_path, "Weights that replace or extend those");
  flags.Group("Algorithm")
      .Add("views", &options.num_views, "Numbers of views, at least 2: 5,10,20")
      .Add("repeats", &options.num_repeats, "Runs of each, of which the median counts")
      .Add("device", &command->device, "As of vgtw predict: cpu, cuda or cuda:<number>")
      .Add("precision", &command->precision, "As of vgtw predict: fp32, bf16 or fp16")
      .Add("title", &command->title, "Of the row; default the weights' file");
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Folder to write: times.json, .csv and .tex")
      .Add("overwrite", &command->overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
