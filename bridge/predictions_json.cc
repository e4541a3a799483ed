// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions_json.h"

#include "scene/error.h"
#include "scene/files.h"
#include "scene/prediction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using Json = nlohmann::json;

constexpr char kFormat[] = "vgtw-predictions";
constexpr int kVersion = 1;
constexpr uint64_t kMaxSize = 65536;  // pixels

// Access to one JSON object; whatever is not as expected throws Error "<path>: <who> ...".
class Fields {
 public:
  Fields(const Json& object, std::string who, const std::filesystem::path& path)
      : object_(object), who_(std::move(who)), path_(path) {
    if (!object.is_object()) {
      Fail(std::string("is a JSON ") + object.type_name(), "an object");
    }
  }

  [[noreturn]] void Fail(const std::string& found, const std::string& expected) const {
    vgtw::Fail(path_, who_ + " " + found, expected, "write the predictions again");
  }

  const Json& At(const char* key) const {
    const auto found = object_.find(key);
    if (found == object_.end()) Fail(std::string("lacks '") + key + "'", "it");
    return *found;
  }

  std::string String(const char* key) const {
    const Json& value = At(key);
    if (!value.is_string()) FailType(key, value, "a string");
    return value.get<std::string>();
  }

  // Finite numbers; `size` 0 = any number of them.
  std::vector<double> Numbers(const char* key, size_t size) const {
    return NumbersOf(key, At(key), size);
  }

  std::vector<double> NumbersOf(const char* key, const Json& array, size_t size) const {
    const std::string expected =
        "an array of " + (size == 0 ? "" : std::to_string(size) + " ") + "finite numbers";
    if (!array.is_array() || (size != 0 && array.size() != size)) FailType(key, array, expected);
    std::vector<double> values;
    for (const Json& element : array) {
      if (!element.is_number()) FailType(key, element, expected);
      values.push_back(element.get<double>());
      if (!std::isfinite(values.back())) FailType(key, element, expected);
    }
    return values;
  }

  // [width, height] in pixels.
  std::array<uint64_t, 2> Size(const char* key) const {
    const Json& array = At(key);
    const auto is_size = [](const Json& value) {
      return value.is_number_unsigned() && value.get<uint64_t>() <= kMaxSize;
    };
    if (!array.is_array() || array.size() != 2 ||
        !std::all_of(array.begin(), array.end(), is_size)) {
      FailType(key, array, "[width, height] in pixels up to " + std::to_string(kMaxSize));
    }
    return {array[0].get<uint64_t>(), array[1].get<uint64_t>()};
  }

  Fields Object(const char* key) const { return {At(key), who_ + " '" + key + "'", path_}; }

 private:
  [[noreturn]] void FailType(const char* key,
                             const Json& value,
                             const std::string& expected) const {
    Fail(std::string("has '") + key + "' = " + Quote(value), expected);
  }

  static std::string Quote(const Json& value) {
    if (value.is_structured()) {
      return std::string("an ") + value.type_name() + " of " + std::to_string(value.size());
    }
    return Printable(value.dump());
  }

  const Json& object_;
  std::string who_;
  const std::filesystem::path& path_;
};

Camera ParseCamera(const Fields& fields, const std::array<uint64_t, 2>& size) {
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

Rigid3d ParsePose(const Fields& fields) {
  const std::vector<double> q = fields.Numbers("rotation_wxyz", 4);
  const std::vector<double> t = fields.Numbers("translation", 3);
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), Eigen::Vector3d(t[0], t[1], t[2])};
}

PixelMap ParsePixelMap(const Fields& fields, const char* key) {
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
  const std::string name = Fields(json, "view " + std::to_string(idx), path).String("name");
  const Fields fields(json, "view '" + Printable(name) + "'", path);
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

Json ParseJson(std::string_view text, const std::filesystem::path& path) {
  try {
    return Json::parse(text);
  } catch (const Json::exception& exception) {
    Fail(path,
         Printable(exception.what()),
         "JSON, in which NaN and Infinity do not exist",
         "write the predictions again");
  }
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
  const Json json = ParseJson(text, path);
  const Fields fields(json, "the file", path);
  const Json& format = fields.At("format");
  const Json& version = fields.At("version");
  if (format != kFormat || version != kVersion) {
    fields.Fail("has format " + Printable(format.dump()) + ", version " + Printable(version.dump()),
                std::string("format \"") + kFormat + "\", version " + std::to_string(kVersion));
  }
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
