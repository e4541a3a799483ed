// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/training_folders.h"

#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <string_view>
#include <system_error>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kExpected = "photos, or a folder of photos for each scene";

bool HasPhotosRightIn(const fs::path& folder) {
  std::vector<std::string> names;
  try {
    names = ListImages(folder);
  } catch (const Error&) {  // there is none; scenes are read by others, who say what is wrong
    return false;
  }
  return std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return name.find('/') == std::string::npos;
  });
}

}  // namespace

std::vector<TrainingScene> FindTrainingScenes(const fs::path& image_path,
                                              const fs::path& mask_path) {
  if (!fs::is_directory(image_path)) Fail(image_path, "is not a folder", kExpected);
  if (HasPhotosRightIn(image_path)) return {{"", image_path, mask_path}};
  std::vector<TrainingScene> scenes;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(image_path, error)) {
    const std::string name = entry.path().filename().string();
    if (!entry.is_directory() || name.starts_with('.')) continue;
    if (!IsSafeRelativeName(name)) {
      Fail(entry.path(),
           "has a name with control characters or '\\'",
           "a plain name",
           "rename the folder");
    }
    scenes.push_back({name, entry.path(), mask_path / name});
  }
  if (error) Fail(image_path, "cannot be read: " + error.message(), kExpected);
  if (scenes.empty()) Fail(image_path, "holds neither photos nor folders", kExpected);
  std::sort(scenes.begin(), scenes.end(), [](const TrainingScene& a, const TrainingScene& b) {
    return a.name < b.name;
  });
  return scenes;
}

}  // namespace vgtw
