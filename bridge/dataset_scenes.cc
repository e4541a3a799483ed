// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/dataset_scenes.h"

#include "bridge/json_fields.h"
#include "bridge/transforms_json.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 5> kWords = {
    "robustnerf", "on_the_go", "dtu", "davis", "folder"};

constexpr char kHint[] = "see the data set's own description";

// A scene of the paper's tables.
struct KnownScene {
  const char* name;
  const char* title;
  const char* group;
  std::array<std::string_view, 3> folders;  // normalised, see Normalised
};

constexpr KnownScene kRobustNerfScenes[] = {
    {"android", "Android", "RobustNeRF", {"android", "andbot", ""}},
    {"crab1", "Crab1", "RobustNeRF", {"crab1", "crab", ""}},
    {"crab2", "Crab2", "RobustNeRF", {"crab2", "", ""}},
    {"yoda", "Yoda", "RobustNeRF", {"yoda", "", ""}},
};

constexpr KnownScene kOnTheGoScenes[] = {
    {"mountain", "Mountain", "Low occlusion", {"mountain", "", ""}},
    {"fountain", "Fountain", "Low occlusion", {"fountain", "", ""}},
    {"corner", "Corner", "Medium occlusion", {"corner", "", ""}},
    {"patio", "Patio", "Medium occlusion", {"patio", "", ""}},
    {"spot", "Spot", "High occlusion", {"spot", "", ""}},
    {"patio_high", "Patio-High", "High occlusion", {"patiohigh", "", ""}},
};

// Small letters and digits only, without the "undistorted" that preprocessing appends.
std::string Normalised(const std::string& folder) {
  std::string text;
  for (const char c : folder) {
    if (c >= 'A' && c <= 'Z') {
      text += static_cast<char>(c - 'A' + 'a');
    } else if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')) {
      text += c;
    }
  }
  constexpr std::string_view kSuffix = "undistorted";
  if (text.size() > kSuffix.size() && text.ends_with(kSuffix)) {
    text.resize(text.size() - kSuffix.size());
  }
  return text;
}

std::vector<std::string> FoldersIn(const fs::path& folder) {
  std::error_code error;
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() && !name.starts_with('.')) names.push_back(name);
  }
  if (error) Fail(folder, "cannot be read: " + error.message(), "the data set's folder");
  std::sort(names.begin(), names.end());
  return names;
}

// As ListImages; empty where there are none.
std::vector<std::string> ImagesIn(const fs::path& folder) {
  try {
    return fs::is_directory(folder) ? ListImages(folder) : std::vector<std::string>();
  } catch (const Error&) {
    return {};
  }
}

fs::path ImageFolderOf(const fs::path& scene, const std::string& image_folder) {
  if (!image_folder.empty()) {
    if (fs::is_directory(scene / image_folder)) return image_folder;
    Fail(scene, "has no folder " + Printable(image_folder), "photos", "see --image_folder");
  }
  for (const char* name : {"images", "images_2", "images_4", "images_8"}) {
    if (fs::is_directory(scene / name)) return name;
  }
  Fail(scene, "has no folder images", "photos", "see --image_folder");
}

// Sorts photos by what their names say; `scene` has the photos' folder.
void SplitByNames(const fs::path& root, bool is_clean_without_word, DatasetScene& scene) {
  for (const std::string& name : ListImages(root / scene.image_path)) {
    const std::string base = fs::path(name).filename().string();
    const bool is_clean =
        base.find("clean") != std::string::npos || base.find("extra") != std::string::npos;
    const bool is_clutter = base.find("clutter") != std::string::npos;
    if (is_clean == is_clutter && !(is_clean_without_word && !is_clean)) {
      Fail(root / scene.image_path / name,
           "does not tell whether it has distractors",
           "one of clean, extra and clutter in its name",
           "--dataset folder takes photos of any name");
    }
    (is_clutter ? scene.clutter : scene.clean).push_back(name);
  }
}

std::string StemOf(const std::string& name) { return fs::path(name).stem().string(); }

// split.json counts the photos of transforms.json by the sorted names of their files; smaller
// copies of the photos may have another extension.
void SplitByFile(const fs::path& root, const fs::path& folder, DatasetScene& scene) {
  const fs::path split_path = root / folder / "split.json";
  const fs::path poses_path = root / folder / "transforms.json";
  std::vector<std::string> names;
  for (const TransformsFrame& frame :
       ParseTransformsJson(ReadFile(poses_path), poses_path.string())) {
    names.push_back(fs::path(frame.name).filename().string());
  }
  std::sort(names.begin(), names.end());
  std::map<std::string, std::string> photo_by_stem;
  for (const std::string& photo : ListImages(root / scene.image_path)) {
    photo_by_stem[StemOf(photo)] = photo;
  }
  const SplitIndices split = ParseSplitJson(ReadFile(split_path), names.size(), split_path);
  const auto photos = [&](const std::vector<size_t>& indices) {
    std::vector<std::string> found;
    for (const size_t idx : indices) {
      const auto photo = photo_by_stem.find(StemOf(names[idx]));
      if (photo == photo_by_stem.end()) {
        Fail(root / scene.image_path,
             "has no " + Printable(StemOf(names[idx])),
             "the photos that " + split_path.string() + " names",
             "unpack the data set again");
      }
      found.push_back(photo->second);
    }
    std::sort(found.begin(), found.end());
    return found;
  };
  scene.clean = photos(split.clean);
  scene.clutter = photos(split.clutter);
}

fs::path PosesOf(const fs::path& root, const fs::path& folder) {
  for (const char* name : {"transforms.json", "sparse/0"}) {
    if (fs::exists(root / folder / name)) return folder / name;
  }
  return {};
}

// Masks in COLMAP's naming, beside the photos' folder.
fs::path MasksOf(const fs::path& root, const fs::path& folder) {
  return fs::is_directory(root / folder / "masks") ? folder / "masks" : fs::path();
}

DatasetScan ScanKnown(const fs::path& root,
                      std::span<const KnownScene> known_scenes,
                      const std::string& image_folder) {
  std::map<std::string, std::string> folder_by_name;
  DatasetScan scan;
  for (const std::string& folder : FoldersIn(root)) {
    const std::string normalised = Normalised(folder);
    const auto known =
        std::find_if(known_scenes.begin(), known_scenes.end(), [&](const KnownScene& scene) {
          return !normalised.empty() &&
                 std::find(scene.folders.begin(), scene.folders.end(), normalised) !=
                     scene.folders.end();
        });
    if (known == known_scenes.end() || !folder_by_name.emplace(known->name, folder).second) {
      scan.left_out.push_back(folder);
    }
  }
  for (const KnownScene& known : known_scenes) {
    const auto found = folder_by_name.find(known.name);
    if (found == folder_by_name.end()) {
      scan.missing.emplace_back(known.name);
      continue;
    }
    const fs::path folder = found->second;
    DatasetScene scene{.name = known.name, .title = known.title, .group = known.group};
    scene.image_path = folder / ImageFolderOf(root / folder, image_folder);
    scene.mask_path = MasksOf(root, folder);
    scene.pose_path = PosesOf(root, folder);
    if (fs::exists(root / folder / "split.json")) {
      SplitByFile(root, folder, scene);
    } else {
      SplitByNames(root, /*is_clean_without_word=*/false, scene);
    }
    scan.scenes.push_back(std::move(scene));
  }
  return scan;
}

DatasetScan ScanDavis(const fs::path& root) {
  DatasetScan scan;
  const std::vector<std::string> resolutions = fs::is_directory(root / "JPEGImages")
                                                   ? FoldersIn(root / "JPEGImages")
                                                   : std::vector<std::string>();
  if (resolutions.empty()) return scan;
  const bool has_480p =
      std::find(resolutions.begin(), resolutions.end(), "480p") != resolutions.end();
  const std::string resolution = has_480p ? "480p" : resolutions.front();
  for (const std::string& sequence : FoldersIn(root / "JPEGImages" / resolution)) {
    DatasetScene scene{.name = sequence, .title = sequence, .group = ""};
    scene.image_path = fs::path("JPEGImages") / resolution / sequence;
    scene.clutter = ImagesIn(root / scene.image_path);
    if (scene.clutter.empty()) continue;
    const fs::path masks = fs::path("Annotations") / resolution / sequence;
    if (fs::is_directory(root / masks)) {
      scene.mask_path = masks;
      scene.mask_convention = "sam2";  // label images of any palette, named as the frame
    }
    scan.scenes.push_back(std::move(scene));
  }
  return scan;
}

// The photos' folder of a scene's folder, or nullopt.
std::optional<fs::path> PhotosBelow(const fs::path& folder) {
  for (const char* name : {"images", "image"}) {
    if (!ImagesIn(folder / name).empty()) return name;
  }
  if (!ImagesIn(folder).empty()) return fs::path();
  return std::nullopt;
}

DatasetScan ScanFolders(const fs::path& root, std::string_view prefix) {
  DatasetScan scan;
  for (const std::string& folder : FoldersIn(root)) {
    const auto photos = folder.starts_with(prefix) ? PhotosBelow(root / folder) : std::nullopt;
    if (!photos) {
      scan.left_out.push_back(folder);
      continue;
    }
    DatasetScene scene{.name = folder, .title = folder, .group = ""};
    scene.image_path = photos->empty() ? fs::path(folder) : folder / *photos;
    if (!photos->empty()) scene.mask_path = MasksOf(root, folder);
    scene.pose_path = PosesOf(root, folder);
    SplitByNames(root, /*is_clean_without_word=*/true, scene);
    scan.scenes.push_back(std::move(scene));
  }
  return scan;
}

// Photos directly in the folder, or in its images/, are one scene.
std::optional<DatasetScene> ScanOne(const fs::path& root) {
  const std::vector<std::string> names = ImagesIn(root);
  const bool is_flat = std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return name.find('/') == std::string::npos;
  });
  if (!is_flat && ImagesIn(root / "images").empty()) return std::nullopt;
  const fs::path absolute = fs::absolute(root).lexically_normal();
  const fs::path named = absolute.has_filename() ? absolute : absolute.parent_path();
  DatasetScene scene;
  scene.name = scene.title = named.filename().string();
  scene.image_path = is_flat ? "." : "images";
  if (!is_flat) scene.mask_path = MasksOf(root, "");
  scene.pose_path = PosesOf(root, "");
  SplitByNames(root, /*is_clean_without_word=*/true, scene);
  return scene;
}

DatasetScan Scan(DatasetKind kind, const fs::path& root, const std::string& image_folder) {
  switch (kind) {
    case DatasetKind::kRobustNerf:
      return ScanKnown(root, kRobustNerfScenes, image_folder);
    case DatasetKind::kOnTheGo:
      return ScanKnown(root, kOnTheGoScenes, image_folder);
    case DatasetKind::kDtu:
      return ScanFolders(root, "scan");
    case DatasetKind::kDavis:
      return ScanDavis(root);
    case DatasetKind::kFolder:
      break;
  }
  if (auto one = ScanOne(root)) return {.scenes = {*std::move(one)}, .missing = {}, .left_out = {}};
  return ScanFolders(root, "");
}

}  // namespace

std::span<const std::string_view> DatasetWords() { return kWords; }

DatasetKind DatasetKindOf(std::string_view word) {
  const auto found = std::find(kWords.begin(), kWords.end(), word);
  VGTW_CHECK(found != kWords.end(), "unknown data set '" + std::string(word) + "'");
  return static_cast<DatasetKind>(found - kWords.begin());
}

SplitIndices ParseSplitJson(std::string_view text, size_t num_images, const fs::path& path) {
  const nlohmann::json json = ParseJsonText(text, path, kHint);
  const JsonFields fields(json, "the file", path, kHint);
  SplitIndices split;
  std::vector<bool> is_taken(num_images, false);
  for (const char* key : {"clean", "extra", "clutter"}) {
    if (!fields.Has(key)) continue;
    std::vector<size_t>& indices = std::string_view(key) == "clutter" ? split.clutter : split.clean;
    for (const nlohmann::json& value : fields.Array(key)) {
      if (!value.is_number_unsigned() || value.get<uint64_t>() >= num_images) {
        fields.Fail(std::string("has ") + Printable(value.dump()) + " in '" + key + "'",
                    "the index of one of " + std::to_string(num_images) + " photos");
      }
      const size_t idx = value.get<size_t>();
      if (is_taken[idx]) {
        fields.Fail("has photo " + std::to_string(idx) + " twice", "each photo once");
      }
      is_taken[idx] = true;
      indices.push_back(idx);
    }
  }
  return split;
}

DatasetScan ScanDataset(DatasetKind kind, const fs::path& folder, const std::string& image_folder) {
  if (!fs::is_directory(folder)) Fail(folder, "is no folder", "the data set's folder");
  DatasetScan scan = Scan(kind, folder, image_folder);
  if (scan.scenes.empty()) {
    Fail(folder,
         "holds no scene of " + std::string(kWords[static_cast<size_t>(kind)]),
         "the folders of its scenes",
         "--dataset folder takes any photos");
  }
  return scan;
}

}  // namespace vgtw
