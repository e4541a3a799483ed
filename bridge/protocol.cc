// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/protocol.h"

#include "bridge/json_fields.h"
#include "bridge/mask_conventions.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <initializer_list>
#include <set>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr char kFormat[] = "vgtw-protocol";
constexpr int kVersion = 1;
constexpr char kHint[] = "vgtw protocol make writes it anew";
constexpr size_t kMaxFileBytes = size_t{256} << 20;
constexpr uint64_t kMaxCount = 1000000;

std::string OneOf(const JsonFields& fields,
                  const char* key,
                  std::initializer_list<std::string_view> words) {
  const std::string word = fields.String(key);
  if (std::find(words.begin(), words.end(), word) != words.end()) return word;
  std::string expected;
  for (const std::string_view known : words) {
    expected += (expected.empty() ? "" : ", ") + std::string(known);
  }
  fields.Fail(std::string("has '") + key + "' = " + Printable(word), "one of " + expected);
}

// In (0, max].
double Positive(const JsonFields& fields, const char* key, double max) {
  const double value = fields.Number(key);
  if (!(value > 0.0 && value <= max)) {
    fields.Fail(std::string("has '") + key + "' = " + Json(value).dump(),
                "above 0, at most " + Json(max).dump());
  }
  return value;
}

uint64_t AtLeast(const JsonFields& fields, const char* key, uint64_t min) {
  const uint64_t value = fields.Unsigned(key, kMaxCount);
  if (value < min) {
    fields.Fail(std::string("has '") + key + "' = " + std::to_string(value),
                "at least " + std::to_string(min));
  }
  return value;
}

ProtocolSampling ParseSampling(const JsonFields& fields) {
  ProtocolSampling sampling;
  sampling.seed = fields.Unsigned("seed", UINT64_MAX);
  sampling.num_images = AtLeast(fields, "num_images", 2);
  sampling.test_images = OneOf(fields, "test_images", {"mixed", "clean", "clutter"});
  sampling.min_shared_images = fields.Unsigned("min_shared_images", kMaxCount);
  sampling.num_clean_images = fields.Unsigned("num_clean_images", kMaxCount);
  return sampling;
}

ProtocolConditions ParseConditions(const JsonFields& fields) {
  constexpr double kPercent = 100.0;
  constexpr double kMaxDistance = 1e9;  // scene units
  ProtocolConditions conditions;
  conditions.keep_percent = Positive(fields, "keep_percent", kPercent);
  conditions.reference_keep_percent = Positive(fields, "reference_keep_percent", kPercent);
  conditions.keep_scope = OneOf(fields, "keep_scope", {"all", "view"});
  conditions.keep_order = OneOf(fields, "keep_order", {"before", "after"});
  conditions.mask_threshold = Positive(fields, "mask_threshold", 1.0);
  conditions.alignment =
      OneOf(fields, "alignment", {"pixels", "cameras", "dataset_cameras", "auto", "none"});
  conditions.icp = OneOf(fields, "icp", {"none", "rigid", "similarity"});
  conditions.icp_distance = Positive(fields, "icp_distance", kMaxDistance);
  conditions.num_normal_neighbours = AtLeast(fields, "num_normal_neighbours", 3);
  conditions.depth_method = OneOf(fields, "depth_method", {"reprojection", "maps"});
  conditions.depth_cloud = OneOf(fields, "depth_cloud", {"all", "own"});
  conditions.depth_alignment =
      OneOf(fields, "depth_alignment", {"median", "scale", "scale_shift", "none"});
  conditions.depth_mean = OneOf(fields, "depth_mean", {"pixels", "views"});
  conditions.pose_alignment = OneOf(fields, "pose_alignment", {"sim3", "se3", "first", "none"});
  conditions.rpe_delta = AtLeast(fields, "rpe_delta", 1);
  return conditions;
}

std::vector<std::string> ImageNames(const JsonFields& fields, const char* key) {
  std::vector<std::string> names = fields.Strings(key);
  for (size_t i = 0; i < names.size(); ++i) {
    if (!IsSafeRelativeName(names[i])) {
      fields.Fail("has photo '" + Printable(names[i]) + "'", "a file inside the photos' folder");
    }
    if (i > 0 && names[i - 1] >= names[i]) {
      fields.Fail(
          "has photo '" + Printable(names[i]) + "' behind '" + Printable(names[i - 1]) + "'",
          "each name once, sorted by bytes");
    }
  }
  return names;
}

// Without control characters, since it goes to tables and shell lines.
std::string PrintableString(const JsonFields& fields, const char* key) {
  std::string text = fields.String(key);
  if (Printable(text) != text) {
    fields.Fail(std::string("has '") + key + "' = " + Printable(text),
                "printable text, not longer");
  }
  return text;
}

ProtocolScene ParseScene(const Json& json, size_t idx, const fs::path& path) {
  const std::string name =
      JsonFields(json, "scene " + std::to_string(idx), path, kHint).String("name");
  const JsonFields fields(json, "scene '" + Printable(name) + "'", path, kHint);
  if (!IsSafeRelativeName(name) || name.find('/') != std::string::npos) {
    fields.Fail("cannot be a folder", "a name without '/'");
  }
  ProtocolScene scene;
  scene.name = name;
  scene.title = PrintableString(fields, "title");
  scene.group = PrintableString(fields, "group");
  scene.image_path = PrintableString(fields, "image_path");
  scene.test_images = ImageNames(fields, "test_images");
  if (scene.test_images.size() < 2) {
    fields.Fail("has " + std::to_string(scene.test_images.size()) + " test images", "at least 2");
  }
  scene.clean_images = ImageNames(fields, "clean_images");
  scene.mask_path = PrintableString(fields, "mask_path");
  scene.mask_convention = fields.String("mask_convention");
  const auto conventions = MaskConventions();
  if (std::none_of(conventions.begin(), conventions.end(), [&](const MaskConvention& known) {
        return known.id == scene.mask_convention;
      })) {
    fields.Fail("has 'mask_convention' = " + Printable(scene.mask_convention),
                "a word of vgtw mask convert --from");
  }
  scene.reference_path = PrintableString(fields, "reference_path");
  scene.pose_reference_path = PrintableString(fields, "pose_reference_path");
  return scene;
}

Json ToJson(const ProtocolSampling& sampling) {
  return {{"seed", sampling.seed},
          {"num_images", sampling.num_images},
          {"test_images", sampling.test_images},
          {"min_shared_images", sampling.min_shared_images},
          {"num_clean_images", sampling.num_clean_images}};
}

Json ToJson(const ProtocolConditions& conditions) {
  return {{"keep_percent", conditions.keep_percent},
          {"reference_keep_percent", conditions.reference_keep_percent},
          {"keep_scope", conditions.keep_scope},
          {"keep_order", conditions.keep_order},
          {"mask_threshold", conditions.mask_threshold},
          {"alignment", conditions.alignment},
          {"icp", conditions.icp},
          {"icp_distance", conditions.icp_distance},
          {"num_normal_neighbours", conditions.num_normal_neighbours},
          {"depth_method", conditions.depth_method},
          {"depth_cloud", conditions.depth_cloud},
          {"depth_alignment", conditions.depth_alignment},
          {"depth_mean", conditions.depth_mean},
          {"pose_alignment", conditions.pose_alignment},
          {"rpe_delta", conditions.rpe_delta}};
}

Json ToJson(const ProtocolScene& scene) {
  return {{"name", scene.name},
          {"title", scene.title},
          {"group", scene.group},
          {"image_path", scene.image_path.string()},
          {"test_images", scene.test_images},
          {"clean_images", scene.clean_images},
          {"mask_path", scene.mask_path.string()},
          {"mask_convention", scene.mask_convention},
          {"reference_path", scene.reference_path.string()},
          {"pose_reference_path", scene.pose_reference_path.string()}};
}

void MakeAbsolute(const fs::path& folder, fs::path& path) {
  if (!path.empty()) path = folder / path;
}

}  // namespace

Protocol ParseProtocol(std::string_view text, const fs::path& path) {
  const Json json = ParseJsonText(text, path, kHint);
  const JsonFields fields(json, "the file", path, kHint);
  fields.CheckFormat(kFormat, kVersion);
  Protocol protocol;
  protocol.dataset = PrintableString(fields, "dataset");
  protocol.dataset_path = PrintableString(fields, "dataset_path");
  protocol.sampling = ParseSampling(fields.Object("sampling"));
  protocol.conditions = ParseConditions(fields.Object("conditions"));
  std::set<std::string> names;
  for (const Json& scene : fields.Array("scenes")) {
    protocol.scenes.push_back(ParseScene(scene, protocol.scenes.size(), path));
    const std::string& name = protocol.scenes.back().name;
    if (!names.insert(name).second) {
      fields.Fail("has scene '" + Printable(name) + "' twice", "each name once");
    }
  }
  if (protocol.scenes.empty()) fields.Fail("has no scene", "at least one");
  return protocol;
}

std::string FormatProtocol(const Protocol& protocol) {
  Json scenes = Json::array();
  for (const ProtocolScene& scene : protocol.scenes) scenes.push_back(ToJson(scene));
  const Json json = {{"format", kFormat},
                     {"version", kVersion},
                     {"dataset", protocol.dataset},
                     {"dataset_path", protocol.dataset_path.string()},
                     {"sampling", ToJson(protocol.sampling)},
                     {"conditions", ToJson(protocol.conditions)},
                     {"scenes", std::move(scenes)}};
  try {
    return json.dump(1) + "\n";
  } catch (const Json::exception&) {
    Fail(protocol.dataset_path,
         "or a name of a photo is not UTF-8",
         "UTF-8, as JSON demands",
         "rename it");
  }
}

Protocol ReadProtocol(const fs::path& path) {
  Protocol protocol = ParseProtocol(ReadFile(path, kMaxFileBytes), path);
  const fs::path folder = fs::absolute(path).parent_path();
  protocol.dataset_path = folder / protocol.dataset_path;
  for (ProtocolScene& scene : protocol.scenes) {
    scene.image_path = protocol.dataset_path / scene.image_path;
    MakeAbsolute(protocol.dataset_path, scene.mask_path);
    MakeAbsolute(protocol.dataset_path, scene.reference_path);
    MakeAbsolute(protocol.dataset_path, scene.pose_reference_path);
  }
  return protocol;
}

}  // namespace vgtw
