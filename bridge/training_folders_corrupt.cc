// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_files.h"
#include "bridge/training_folders.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/parallel.h"
#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <system_error>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRecord = "corrupted.json";

struct TrainingMask {
  std::string name;  // below the mask folder
  fs::path photo_path;
  ImageSize size;
  bool has_distractor = false;
};

std::vector<TrainingMask> ListMasks(const fs::path& image_path, const fs::path& mask_path) {
  std::vector<TrainingMask> masks;
  for (const TrainingScene& scene : FindTrainingScenes(image_path, mask_path)) {
    const std::vector<std::string> names = ListImages(scene.image_path);
    CheckMasksExist(scene.mask_path, names, /*allow_missing=*/false);
    for (const std::string& name : names) {
      const std::string prefix = scene.name.empty() ? "" : scene.name + "/";
      masks.push_back({.name = MaskPath(prefix, name).generic_string(),
                       .photo_path = scene.image_path / name,
                       .size = {}});
    }
  }
  return masks;
}

// The smaller, the sooner a mask is changed.
uint64_t Rank(uint64_t seed, const std::string& name) {
  uint64_t key = HashKey({seed});
  for (const char c : name) key = HashKey({key, static_cast<uint8_t>(c)});
  return key;
}

std::vector<const TrainingMask*> Choose(const std::vector<TrainingMask>& masks,
                                        const CorruptMasksOptions& options) {
  std::vector<std::pair<uint64_t, const TrainingMask*>> ranked;
  for (const TrainingMask& mask : masks) {
    if (mask.has_distractor) ranked.emplace_back(Rank(options.seed, mask.name), &mask);
  }
  const auto by_name = [](const TrainingMask* a, const TrainingMask* b) {
    return a->name < b->name;
  };
  std::sort(ranked.begin(), ranked.end(), [&](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : by_name(a.second, b.second);
  });
  ranked.resize(
      static_cast<size_t>(std::llround(options.share * static_cast<double>(ranked.size()))));
  std::vector<const TrainingMask*> chosen;
  for (const auto& [rank, mask] : ranked) chosen.push_back(mask);
  std::sort(chosen.begin(), chosen.end(), by_name);
  return chosen;
}

void CopyFiles(const fs::path& from, const fs::path& to) {
  std::error_code error;
  // Scenes may be links to folders elsewhere.
  const auto links = fs::directory_options::follow_directory_symlink;
  for (fs::recursive_directory_iterator file(from, links, error), end; !error && file != end;
       file.increment(error)) {
    if (!file->is_regular_file()) continue;
    const fs::path target = to / file->path().lexically_relative(from);
    std::error_code write_error;
    fs::create_directories(target.parent_path(), write_error);
    if (!write_error) fs::copy_file(file->path(), target, write_error);
    if (write_error) {
      Fail(file->path(),
           "cannot be copied: " + write_error.message(),
           "room and the right to write beside the output folder");
    }
  }
  if (error) Fail(from, "cannot be read: " + error.message(), "a folder of masks");
}

void CheckFolders(const fs::path& image_path,
                  const fs::path& mask_path,
                  const fs::path& output_path) {
  for (const fs::path& input : {image_path, mask_path}) {
    CheckNotInput(output_path, input);
    if (!IsInFolder(input, output_path)) continue;
    Fail(output_path,
         "lies in " + Printable(input.string()) + ", which is read",
         "another folder to write");
  }
  if (fs::exists(mask_path / kRecord)) {
    Fail(mask_path,
         "is a corrupted copy already (" + std::string(kRecord) + ")",
         "the true masks",
         "name the folder that it was made from");
  }
}

}  // namespace

void CorruptMasksOptions::Check() const {
  VGTW_CHECK(share >= 0.0 && share <= 1.0,
             "share = " + std::to_string(share) + ", must lie in [0, 1]");
}

CorruptedMasks CorruptMasks(const fs::path& image_path,
                            const fs::path& mask_path,
                            const fs::path& output_path,
                            const CorruptMasksOptions& options,
                            const ProgressCallback& progress) {
  options.Check();
  CheckFolders(image_path, mask_path, output_path);
  std::vector<TrainingMask> masks = ListMasks(image_path, mask_path);
  AtomicFolder folder(output_path, options.overwrite);
  const auto read = [&](int64_t i) {
    TrainingMask& mask = masks[static_cast<size_t>(i)];
    mask.size = ReadImageSize(mask.photo_path);
    mask.has_distractor = ExcludedShare(ReadMaskOfSize(mask_path / mask.name, mask.size)) > 0.0;
  };
  ParallelFor(static_cast<int64_t>(masks.size()), options.num_threads, read, progress);
  const std::vector<const TrainingMask*> chosen = Choose(masks, options);

  CopyFiles(mask_path, folder.path());
  CorruptedMasks result;
  result.num_masks = masks.size();
  for (const TrainingMask& mask : masks) result.num_with_distractor += mask.has_distractor ? 1 : 0;
  for (const TrainingMask* mask : chosen) {
    WriteImage(
        folder.path() / mask->name,
        StaticMask(static_cast<int>(mask->size.width), static_cast<int>(mask->size.height), 255));
    result.names.push_back(mask->name);
  }
  const nlohmann::json record = {{"share", options.share},
                                 {"seed", options.seed},
                                 {"num_masks", result.num_masks},
                                 {"num_with_distractor", result.num_with_distractor},
                                 {"corrupted", result.names}};
  WriteFileAtomically(folder.path() / kRecord, record.dump(2) + "\n");
  folder.Commit();
  return result;
}

}  // namespace vgtw
