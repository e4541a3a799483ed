// SPDX-License-Identifier: BSD-3-Clause
#include "network/checkpoint_convert.h"
#include "network/weights_audit.h"
#include "plugin/commands.h"
#include "plugin/network_commands.h"
#include "plugin/network_flags.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"
#include "scene/memory.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <set>

namespace vgtw {
namespace {

using nlohmann::json;

std::string GroupThousands(uint64_t number) {
  std::string text = std::to_string(number);
  for (size_t i = text.size(); i > 3; i -= 3) text.insert(i - 3, 1, ',');
  return text;
}

// "a.blocks.3.attn.weight" -> "a.blocks.3.attn" and "weight"; then numbers become "*".
std::pair<std::string, std::string> SplitLeaf(const std::string& name) {
  const size_t dot = name.rfind('.');
  if (dot == std::string::npos) return {"", name};
  return {name.substr(0, dot), name.substr(dot + 1)};
}

std::string WithoutNumbers(const std::string& module) {
  std::string pattern;
  for (size_t begin = 0; begin <= module.size();) {
    const size_t end = std::min(module.find('.', begin), module.size());
    const std::string part = module.substr(begin, end - begin);
    const bool is_number =
        !part.empty() && part.find_first_not_of("0123456789") == std::string::npos;
    pattern += (begin == 0 ? "" : ".") + (is_number ? std::string("*") : part);
    begin = end + 1;
  }
  return pattern;
}

// Modules whose names differ in numbers only.
struct ModuleGroup {
  std::set<std::string> modules;
  std::map<std::string, std::set<std::string>> shapes;  // by leaf
  uint64_t num_parameters = 0;

  std::string Shapes() const {
    std::string text;
    for (const auto& [leaf, leaf_shapes] : shapes) {
      text += (text.empty() ? "" : ", ") + leaf + " ";
      text += leaf_shapes.size() == 1 ? *leaf_shapes.begin()
                                      : std::to_string(leaf_shapes.size()) + " shapes";
    }
    return text;
  }
};

std::map<std::string, ModuleGroup> GroupModules(const StoredTensors& tensors) {
  std::map<std::string, ModuleGroup> groups;
  for (const auto& [name, tensor] : tensors) {
    const auto [module, leaf] = SplitLeaf(name);
    ModuleGroup& group = groups[WithoutNumbers(module)];
    group.modules.insert(module);
    group.shapes[leaf].insert(FormatShape(tensor.shape));
    group.num_parameters += tensor.NumElements();
  }
  return groups;
}

json ToJson(const std::optional<EncoderConfig>& encoder) {
  if (!encoder) return nullptr;
  return {{"dim", encoder->dim},
          {"depth", encoder->depth},
          {"num_heads", encoder->num_heads},
          {"grid_size", encoder->grid_size}};
}

json ToJson(const std::optional<LoraConfig>& lora) {
  if (!lora) return nullptr;
  return {{"rank", lora->rank}, {"alpha", lora->alpha}};
}

json ToJson(const DptConfig& dpt) {
  return {{"num_features", dpt.num_features}, {"num_channels", dpt.num_channels}};
}

json ToJson(const VggtConfig& config) {
  return {{"dim", config.dim},
          {"depth", config.depth},
          {"num_heads", config.num_heads},
          {"num_camera_heads", config.num_camera_heads},
          {"head_layers", config.head_layers},
          {"encoder", ToJson(config.encoder)},
          {"dpt", ToJson(config.dpt)},
          {"lora", ToJson(config.lora)},
          {"has_distractor_head", config.has_distractor_head}};
}

json ToJson(const Pi3Config& config) {
  return {{"depth", config.depth},
          {"head_dim", config.head_dim},
          {"num_head_heads", config.num_head_heads},
          {"camera_dim", config.camera_dim},
          {"head_layers", config.head_layers},
          {"encoder", ToJson(std::optional(config.encoder))},
          {"dpt", ToJson(config.dpt)},
          {"lora", ToJson(config.lora)},
          {"has_distractor_head", config.has_distractor_head}};
}

struct InspectCommand {
  WeightsFlags input;
  bool lists_all = false;
  Usability usability;

  void Run() {
    Apply(usability);
    const Checkpoint weights = OpenWeights(input.Files());
    json result = Describe(weights);
    std::string text = SummaryText(result);
    try {
      const WeightsAudit audit = AuditWeights(weights, NameOf(input.Files()), ValueCheck::kNone);
      AddAudit(audit, text, result);
    } catch (const Error& error) {
      // What is no network may still be looked at.
      text += std::string("network     none: ") + error.what() + "\n";
      result["network"] = nullptr;
      result["problems"] = error.what();
    }
    text += "\n" + (lists_all ? TensorTable(weights) : ModuleTable(weights));
    Finish(usability, text, result);
  }

  json Describe(const Checkpoint& weights) const {
    uint64_t num_parameters = 0;
    uint64_t num_bytes = 0;
    std::map<std::string, uint64_t> num_by_type;
    json tensors = json::object();
    for (const auto& [name, tensor] : weights.tensors()) {
      const std::string type(TensorTypeName(tensor.type));
      num_parameters += tensor.NumElements();
      num_bytes += tensor.bytes.size();
      ++num_by_type[type];
      if (lists_all) tensors[name] = {{"type", type}, {"shape", tensor.shape}};
    }
    json modules = json::object();
    for (const auto& [name, group] : GroupModules(weights.tensors())) {
      modules[name] = {{"num_modules", group.modules.size()},
                       {"num_parameters", group.num_parameters},
                       {"shapes", group.shapes}};
    }
    json result = {{"format", weights.format()},
                   {"num_tensors", weights.tensors().size()},
                   {"num_parameters", num_parameters},
                   {"num_bytes", num_bytes},
                   {"num_tensors_by_type", num_by_type},
                   {"metadata", weights.metadata()},
                   {"modules", modules}};
    if (lists_all) result["tensors"] = tensors;
    return result;
  }

  static std::string SummaryText(const json& result) {
    std::string types;
    for (const auto& [type, number] : result["num_tensors_by_type"].items()) {
      types += (types.empty() ? "" : ", ") + std::to_string(number.get<uint64_t>()) + " " + type;
    }
    return "format      " + result["format"].get<std::string>() + "\ntensors     " + types +
           "\nparameters  " + GroupThousands(result["num_parameters"]) + ", " +
           FormatNumber(result["num_bytes"].get<double>() / kGib, 3) + " GiB\n";
  }

  static void AddAudit(const WeightsAudit& audit, std::string& text, json& result) {
    const std::string kind(NetworkKindName(audit.description.kind));
    const json config =
        std::visit([](const auto& sizes) { return ToJson(sizes); }, audit.description.config);
    const std::string problems = audit.Problems();
    text += "network     " + kind + ", " +
            GroupThousands(static_cast<uint64_t>(audit.num_parameters)) + " parameters\n";
    text += "sizes       " + config.dump() + "\n";
    if (!audit.ignored.empty()) {
      text += "ignored     " + std::to_string(audit.ignored.size()) + " tensors of track_head\n";
    }
    text += "problems    " + (problems.empty() ? "none" : problems) + "\n";
    result["network"] = kind;
    result["config"] = config;
    result["problems"] = problems;
    result["missing"] = audit.missing;
    result["misshapen"] = audit.misshapen;
    result["mistyped"] = audit.mistyped;
    result["unknown"] = audit.unknown;
    result["ignored"] = audit.ignored;
  }

  static std::string ModuleTable(const Checkpoint& weights) {
    std::vector<std::vector<std::string>> rows = {{"module", "number", "parameters", "shapes"}};
    for (const auto& [name, group] : GroupModules(weights.tensors())) {
      rows.push_back({Printable(name),
                      std::to_string(group.modules.size()),
                      GroupThousands(group.num_parameters),
                      Printable(group.Shapes())});
    }
    return FormatTable(rows);
  }

  static std::string TensorTable(const Checkpoint& weights) {
    std::vector<std::vector<std::string>> rows = {{"tensor", "type", "shape"}};
    for (const auto& [name, tensor] : weights.tensors()) {
      rows.push_back(
          {Printable(name), std::string(TensorTypeName(tensor.type)), FormatShape(tensor.shape)});
    }
    return FormatTable(rows);
  }
};

struct CheckCommand {
  WeightsFlags input;
  Usability usability;

  void Run() const {
    Apply(usability);
    const auto start = std::chrono::steady_clock::now();
    const NetworkDescription description = Try();
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    const std::string kind(NetworkKindName(description.kind));
    const double peak_gib = static_cast<double>(PeakMemory()) / kGib;
    Finish(usability,
           "OK: all weights of " + kind + ", all finite, loaded in " +
               FormatNumber(seconds.count(), 1) + " s with " + FormatNumber(peak_gib, 2) +
               " GiB of memory\n",
           {{"network", kind}, {"load_sec", seconds.count()}, {"peak_memory_gib", peak_gib}});
  }

 private:
  NetworkDescription Try() const {
    ProgressDisplay display("reading");
    return TryWeights(input.Files(), usability.num_threads, display.Callback());
  }
};

struct ConvertCommand {
  WeightsFlags input;
  std::filesystem::path output_path;
  std::string type = "f32";
  bool overwrite = false;
  Usability usability;

  void Run() const {
    Apply(usability);
    const Checkpoint weights = OpenWeights(input.Files());
    const TensorType tensor_type = type == "f16"    ? TensorType::kF16
                                   : type == "bf16" ? TensorType::kBF16
                                                    : TensorType::kF32;
    Convert(weights, tensor_type);
    const uint64_t num_bytes = std::filesystem::file_size(output_path);
    Finish(usability,
           std::to_string(weights.tensors().size()) + " tensors, " +
               FormatNumber(static_cast<double>(num_bytes) / kGib, 3) +
               " GiB\nwritten: " + output_path.string() + "\n",
           {{"num_tensors", weights.tensors().size()},
            {"num_bytes", num_bytes},
            {"output_path", output_path.string()}});
  }

 private:
  void Convert(const Checkpoint& weights, TensorType tensor_type) const {
    ProgressDisplay display("converting");
    ConvertCheckpoint(weights, tensor_type, output_path, overwrite, display.Callback());
  }
};

}  // namespace

std::function<void()> DeclareWeightsInspect(Flags& flags) {
  const auto command = std::make_shared<InspectCommand>();
  command->input.Declare(flags);
  flags.Group("Output").Add("all", &command->lists_all, "List every tensor, not modules");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

std::function<void()> DeclareWeightsCheck(Flags& flags) {
  const auto command = std::make_shared<CheckCommand>();
  command->input.Declare(flags);
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

std::function<void()> DeclareWeightsConvert(Flags& flags) {
  const auto command = std::make_shared<ConvertCommand>();
  command->input.Declare(flags);
  flags.Group("Output")
      .Require("output_path", &command->output_path, "One .safetensors file to write")
      .AddChoice("type", &command->type, {"f32", "f16", "bf16"}, "Type of the numbers")
      .Add("overwrite", &command->overwrite, "Replace an existing file");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
