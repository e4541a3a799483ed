// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/network_commands.h"
#include "plugin/network_flags.h"
#include "plugin/probe_sheet.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/safetensors.h"

#include <memory>
#include <numeric>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

double Sum(const Grid<float>& map) {
  return std::accumulate(map.data().begin(), map.data().end(), 0.0);
}

std::string Percent(double share) { return FormatNumber(100.0 * share, 2); }

std::vector<std::string> AttentionCaptions(const std::string& what,
                                           const std::vector<Grid<float>>& maps) {
  std::vector<std::string> captions;
  for (const Grid<float>& map : maps) captions.push_back(what + ": " + Percent(Sum(map)) + " %");
  return captions;
}

// The maps of all views, one after the other: [S, rows, columns].
void AddTensor(const std::string& name,
               const std::vector<Grid<float>>& maps,
               std::vector<std::vector<float>>& storage,
               StoredTensors& tensors) {
  std::vector<float>& values = storage.emplace_back();
  for (const Grid<float>& map : maps) {
    values.insert(values.end(), map.data().begin(), map.data().end());
  }
  tensors[name] = {TensorType::kF32,
                   {maps.size(),
                    static_cast<uint64_t>(maps.front().height()),
                    static_cast<uint64_t>(maps.front().width())},
                   std::as_bytes(std::span(values))};
}

struct ProbeCommand {
  NetworkFlags network_flags;
  std::string query_image;
  double query_x = -1.0;
  double query_y = -1.0;
  std::vector<int64_t> layers;
  fs::path output_path;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    AtomicFolder folder(output_path, overwrite);
    const std::vector<std::string> names = ListImages(network_flags.image_path);
    const ProbeRequest request = Request(names);
    Announce("reading the weights");
    const Predictor predictor(network_flags.weights.Files(),
                              network_flags.Options(names, usability));
    const ProbeSummary probed = Probe(predictor, names, request);
    WriteSheets(names, request, probed, folder.path());
    WriteMaps(names, request, probed, folder.path() / "maps.safetensors");
    folder.Commit();
    Finish(usability, Text(request, probed), Json(names, request, probed));
  }

 private:
  ProbeRequest Request(const std::vector<std::string>& names) const {
    ProbeRequest request;
    request.image_name = query_image.empty() ? names.front() : query_image;
    request.layers = layers;
    const fs::path photo = network_flags.image_path / request.image_name;
    if (query_x >= 0.0 && query_y >= 0.0) {
      request.pixel_in_original = {query_x, query_y};
    } else {
      const ImageSize size = ReadImageSize(photo);
      request.pixel_in_original = {0.5 * static_cast<double>(size.width),
                                   0.5 * static_cast<double>(size.height)};
    }
    return request;
  }

  ProbeSummary Probe(const Predictor& predictor,
                     const std::vector<std::string>& names,
                     const ProbeRequest& request) const {
    ProgressDisplay display("probe");
    return predictor.Probe(network_flags.image_path, names, request, display.Callback());
  }

  void WriteSheets(const std::vector<std::string>& names,
                   const ProbeRequest& request,
                   const ProbeSummary& probed,
                   const fs::path& folder) const {
    std::vector<ProbePhoto> photos;
    for (size_t i = 0; i < names.size(); ++i) {
      photos.push_back({names[i],
                        ReadRgbImage(network_flags.image_path / names[i]),
                        probed.original_from_patch[i]});
    }
    for (size_t i = 0; i < probed.layers.size(); ++i) {
      const ProbedLayer& layer = probed.layers[i];
      const auto range = RangeOf(layer.attention);
      std::vector<ProbeColumn> columns = {
          {std::vector<std::string>(names.size(), "similarity"),
           &layer.similarity,
           RangeOf(layer.similarity)},
          {AttentionCaptions("attention", layer.attention), &layer.attention, range}};
      if (!probed.masked_layers.empty()) {
        const ProbedLayer& masked = probed.masked_layers[i];
        columns.push_back(
            {AttentionCaptions("attention, masked", masked.attention), &masked.attention, range});
      }
      WriteImage(folder / ("layer_" + std::to_string(layer.layer) + ".png"),
                 MakeProbeSheet(photos, {probed.query_view, request.pixel_in_original}, columns));
    }
  }

  static void WriteMaps(const std::vector<std::string>& names,
                        const ProbeRequest& request,
                        const ProbeSummary& probed,
                        const fs::path& path) {
    StoredTensors tensors;
    std::vector<std::vector<float>> storage;
    storage.reserve(2 * (probed.layers.size() + probed.masked_layers.size()));
    const auto add = [&](const std::string& prefix, const std::vector<ProbedLayer>& layers) {
      for (const ProbedLayer& layer : layers) {
        const std::string suffix = ".layer_" + std::to_string(layer.layer);
        AddTensor(prefix + "similarity" + suffix, layer.similarity, storage, tensors);
        AddTensor(prefix + "attention" + suffix, layer.attention, storage, tensors);
      }
    };
    add("", probed.layers);
    add("masked.", probed.masked_layers);
    WriteSafetensors(path,
                     tensors,
                     {{"views", json(names).dump(-1, ' ', false, json::error_handler_t::replace)},
                      {"query_image", Printable(request.image_name)},
                      {"query_row", std::to_string(probed.query_row)},
                      {"query_column", std::to_string(probed.query_column)}});
  }

  std::string Text(const ProbeRequest& request, const ProbeSummary& probed) const {
    const bool has_masks = !probed.masked_layers.empty();
    std::vector<std::vector<std::string>> rows = {
        {"layer", "own view (%)", "other views (%)", "special tokens (%)", "distractors (%)"}};
    for (const ProbedLayer& layer : probed.layers) {
      const double own = Sum(layer.attention[probed.query_view]);
      rows.push_back({std::to_string(layer.layer),
                      Percent(own),
                      Percent(1.0 - own - layer.special_attention),
                      Percent(layer.special_attention),
                      has_masks ? Percent(layer.distractor_attention) : "no masks"});
    }
    return "Where the patch of pixel " + FormatNumber(request.pixel_in_original.x(), 1) + "," +
           FormatNumber(request.pixel_in_original.y(), 1) + " of " + Printable(request.image_name) +
           " looks, mean over the heads:\n" + FormatTable(rows) +
           "written: " + output_path.string() + "\n";
  }

  json Json(const std::vector<std::string>& names,
            const ProbeRequest& request,
            const ProbeSummary& probed) const {
    const auto to_json = [&](const std::vector<ProbedLayer>& layers) {
      json result = json::array();
      for (const ProbedLayer& layer : layers) {
        json views = json::object();
        for (size_t i = 0; i < names.size(); ++i) views[names[i]] = Sum(layer.attention[i]);
        result.push_back({{"layer", layer.layer},
                          {"attention_of_views", views},
                          {"special_attention", layer.special_attention},
                          {"distractor_attention", layer.distractor_attention}});
      }
      return result;
    };
    return {{"query",
             {{"image", request.image_name},
              {"x", request.pixel_in_original.x()},
              {"y", request.pixel_in_original.y()},
              {"row", probed.query_row},
              {"column", probed.query_column}}},
            {"layers", to_json(probed.layers)},
            {"masked_layers", to_json(probed.masked_layers)},
            {"output_path", output_path.string()}};
  }
};

}  // namespace

std::function<void()> DeclareProbe(Flags& flags) {
  const auto command = std::make_shared<ProbeCommand>();
  command->network_flags.DeclareInput(flags);
  flags.Group("Algorithm")
      .Add("query_image", &command->query_image, "Photo of the queried patch; default: the first")
      .Add("query_x", &command->query_x, "Its pixel in the photo; negative = the middle")
      .Add("query_y", &command->query_y, "Its pixel in the photo; negative = the middle")
      .Add("layers",
           &command->layers,
           "Layers to look at, counted from 0, such as 4,11,17,23; none = the last");
  command->network_flags.DeclareImageSize(flags);
  command->network_flags.DeclareMachine(flags);
  flags.Group("Output")
      .Require("output_path",
               &command->output_path,
               "Folder to write: layer_<n>.png each, and the maps in maps.safetensors")
      .Add("overwrite", &command->overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
