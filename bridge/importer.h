// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import.h"
#include "bridge/import_photos.h"
#include "bridge/import_poses.h"
#include "scene/prediction.h"

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// A world point and the pixel where the file says that the view sees it.
struct Anchor {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector2d pixel_in_original = Eigen::Vector2d::Zero();
};

// One photo as a format's reader understood it. prediction.view is complete; its cam_from_world is
// CamFromWorld(pose, options.repair).
struct ImportedView {
  ViewPrediction prediction;
  size_t photo_idx = 0;
  FilePose pose;
  std::vector<Anchor> anchors;  // where the file ties points to pixels; tell mistaken conventions
};

struct ImportJob {
  std::filesystem::path input_path;  // as the format's `locate` found it
  std::filesystem::path image_folder;
  std::vector<Photo> photos;  // sorted by name
  ImportOptions options;
};

using ViewSink = std::function<void(ImportedView)>;

// One format. `locate` recognises it by content: the file or folder below `input_path` that holds
// it, or nullopt. `read` gives each view to `sink` once, in any order, and adds to notes, warnings
// and `resize` of the summary; it throws Error if the input is damaged or does not fit the photos.
struct Importer {
  ImportFormat format;
  std::string_view name;         // the word of --format
  std::string_view description;  // for people who gave something else
  std::optional<std::filesystem::path> (*locate)(const std::filesystem::path& input_path,
                                                 const PhotoIndex& photos);
  void (*read)(const ImportJob& job, const ViewSink& sink, ImportSummary& summary);
  // Whose files look the same but for what tells this format apart: if both are recognised, this is
  // meant.
  const Importer* special_case_of = nullptr;
};

extern const Importer kColmapImporter;
extern const Importer kVggtNpzImporter;
extern const Importer kDa3NpzImporter;
extern const Importer kNpzFolderImporter;
extern const Importer kTumImporter;
extern const Importer kLlffImporter;
extern const Importer kMonst3rImporter;
extern const Importer kVggtLongImporter;
extern const Importer kCut3rImporter;
extern const Importer kDust3rImporter;
extern const Importer kFast3rImporter;
extern const Importer kPi3Importer;
extern const Importer kMapAnythingImporter;

}  // namespace vgtw
