// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions_json.h"

#include "bridge/json_fields.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/prediction.h"

#include <algorithm>
#include <array>
#include <utility>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using Json = nlohmann::json;

constexpr char kFormat[] = "vgtw-predictions";
constexpr int kVersion = 1;
constexpr char kHint[] = "write the predictions again";

Camera ParseCamera(const JsonFields& fields, const std::array<uint64_t, 2>& size) {
  const std::string name = fields.String("model");
  const auto model = FindCameraModel(name);
  if (!model) fields.Fail("has model " + Printable(name), "a camera model of COLMAP 3.8");
  Camera camera;
  camera.model = *model;
  camera.width = size[0];
  camera.height = size[1];
  camera.params = fields.Numbers("params", 0);
  return camera;
}

Rigid3d ParsePose(const JsonFields& fields) {
  const std::vector<double> q = fields.Numbers("rotation_wxyz", 4);
  const std::vector<double> t = fields.Numbers("translation", 3);
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])};
}

PixelMap ParsePixelMap(const JsonFields& fields, const char* key) {
  const Json& rows = fields.At(key);
  if (!rows.is_array() || rows.size() != 2) {
    fields.Fail(std::string("has no '") + key + "' of two rows", "[[a, b, c], [d, e, f]]");
  }
  PixelMap map;
  for (int row = 0; row < 2; ++row) {
    const std::vector<double> values = fields.NumbersOf(key, rows[static_cast<size_t>(row)], 3);
    map.row(row) = Eigen::Map<const Eigen::RowVector3d>(values.data());
  }
  return map;
}

PredictionsIndex::Entry ParseEntry(const Json& json,
                                   size_t idx,
                                   const std::filesystem::path& path) {
  const std::string name =
      JsonFields(json, "view " + std::to_string(idx), path, kHint).String("name");
  const JsonFields fields(json, "view '" + Printable(name) + "'", path, kHint);
  PredictionsIndex::Entry entry;
  entry.view.name = name;
  entry.view.camera = ParseCamera(fields.Object("camera"), fields.Size("original_size"));
  entry.view.cam_from_world = ParsePose(fields.Object("cam_from_world"));
  const auto network_size = fields.Size("network_size");
  entry.view.network_width = static_cast<int>(network_size[0]);
  entry.view.network_height = static_cast<int>(network_size[1]);
  entry.view.original_from_network = ParsePixelMap(fields, "original_from_network");
  entry.file = fields.String("file");
  if (!IsSafeRelativeName(entry.file)) {
    fields.Fail("has its maps in '" + Printable(entry.file) + "'", "a file inside the folder");
  }
  ViewPrediction prediction;
  prediction.view = entry.view;
  const std::string fault = FindFault(prediction);
  if (!fault.empty()) fields.Fail("cannot be used: " + fault, "a valid view");
  return entry;
}

Json ToJson(const PredictionsIndex::Entry& entry) {
  const View& view = entry.view;
  const Eigen::Quaterniond& q = view.cam_from_world.rotation;
  const Eigen::Vector3d& t = view.cam_from_world.translation;
  const PixelMap& m = view.original_from_network;
  return {
      {"name", view.name},
      {"original_size", {view.camera.width, view.camera.height}},
      {"network_size", {view.network_width, view.network_height}},
      {"original_from_network", {{m(0, 0), m(0, 1), m(0, 2)}, {m(1, 0), m(1, 1), m(1, 2)}}},
      {"camera",
       {{"model", GetCameraModelInfo(view.camera.model).name}, {"params", view.camera.params}}},
      {"cam_from_world",
       {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}}, {"translation", {t.x(), t.y(), t.z()}}}},
      {"file", entry.file},
  };
}

}  // namespace

PredictionsIndex ParsePredictionsIndex(std::string_view text, const std::filesystem::path& path) {
  const Json json = ParseJsonText(text, path, kHint);
  const JsonFields fields(json, "the file", path, kHint);
  fields.CheckFormat(kFormat, kVersion);
  PredictionsIndex index;
  index.producer = fields.String("producer");
  index.weights_hash = fields.String("weights_hash");
  const Json& views = fields.At("views");
  if (!views.is_array()) fields.Fail("has no array of views", "one");
  for (const Json& view : views) {
    index.entries.push_back(ParseEntry(view, index.entries.size(), path));
  }
  std::sort(index.entries.begin(), index.entries.end(), [](const auto& a, const auto& b) {
    return a.view.name < b.view.name;
  });
  const auto repeated = std::adjacent_find(
      index.entries.begin(), index.entries.end(), [](const auto& a, const auto& b) {
        return a.view.name == b.view.name;
      });
  if (repeated != index.entries.end()) {
    fields.Fail("has view '" + Printable(repeated->view.name) + "' twice", "each name once");
  }
  return index;
}

std::string FormatPredictionsIndex(const PredictionsIndex& index) {
  Json views = Json::array();
  for (const PredictionsIndex::Entry& entry : index.entries) views.push_back(ToJson(entry));
  const Json json = {{"format", kFormat},
                     {"version", kVersion},
                     {"producer", index.producer},
                     {"weights_hash", index.weights_hash},
                     {"views", std::move(views)}};
  try {
    return json.dump(1) + "\n";
  } catch (const Json::exception&) {
    const std::string name = index.entries.empty() ? "" : index.entries.front().view.name;
    Fail(name, "or another name is not UTF-8", "UTF-8, as JSON demands", "rename the photo");
  }
}

}  // namespace vgtw
