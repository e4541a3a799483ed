// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// Data sets as their authors and those who repackaged them publish them:
//   robustnerf  <scene>/images*/, photos named 0clean*, 1extra* (both without distractors) and
//               2clutter* (Sabour et al.; SpotLessSplats' copies lack the digit)
//   on_the_go   <scene>/images*/ with split.json, whose "clean", "extra" and "clutter" are indices
//               into the sorted names of transforms.json (Ren et al.); without it as robustnerf
//   dtu         scan*/images/ or scan*/image/, static
//   davis       JPEGImages/<resolution>/<sequence>/, Annotations/<resolution>/<sequence>/
//   folder      photos in it are one scene, else every folder in it that holds photos (or images/)
//               is; photos are clean unless their names say clutter
// Beside images/ there may be true masks in masks/, as COLMAP has them (not in davis).
enum class DatasetKind { kRobustNerf, kOnTheGo, kDtu, kDavis, kFolder };

// The words above, in this order, and back. Throws std::invalid_argument for another word.
std::span<const std::string_view> DatasetWords();
DatasetKind DatasetKindOf(std::string_view word);

struct DatasetScene {
  std::string name;   // "patio_high"
  std::string title;  // "Patio-High"
  std::string group;  // "Low occlusion", ...; "" = none
  // Relative to the data set's folder, "" = none.
  std::filesystem::path image_path = {};
  std::filesystem::path mask_path = {};
  std::string mask_convention = "colmap";
  std::filesystem::path pose_path = {};
  std::vector<std::string> clean = {};    // names below image_path, sorted
  std::vector<std::string> clutter = {};  // the others, sorted
};

struct DatasetScan {
  std::vector<DatasetScene> scenes;   // the paper's, in its order; others by name
  std::vector<std::string> missing;   // of the paper's scenes
  std::vector<std::string> left_out;  // folders that are none of them
};

// `image_folder` is the photos' folder in a scene of robustnerf and on_the_go ("images_8"); "" is
// images or, where that is absent, the first of images_2, images_4, images_8. Scenes' folders may
// be called as in other copies: "crab (1)", "crab_1" and "crab" are crab1.
// Throws Error if no scene is found, or photos are not named or split as above.
DatasetScan ScanDataset(DatasetKind kind,
                        const std::filesystem::path& folder,
                        const std::string& image_folder = "");

// Indices of split.json. Throws Error if the text is not an object of arrays of indices below
// `num_images`, or an index comes twice.
struct SplitIndices {
  std::vector<size_t> clean;  // "clean" and "extra", each of which may be absent
  std::vector<size_t> clutter;
};
SplitIndices ParseSplitJson(std::string_view text,
                            size_t num_images,
                            const std::filesystem::path& path);

}  // namespace vgtw
