// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import.h"
#include "scene/named_pose.h"
#include "scene/rigid3d.h"

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// Poses as files of other systems and our own tell them, without photos.
enum class PoseFormat {
  kColmap,       // folder of a sparse model, .bin or .txt
  kPredictions,  // predictions folder
  kTransforms,   // transforms.json or a folder with one
  kTum,          // trajectory_text.h
  kKitti
};

// What the names of a set are, and so what its order is.
enum class PoseKey {
  kImageName,  // in the order of names in which runs of digits compare as numbers
  kTimestamp,  // "1305031102.175304"; in the order of time
  kLine        // "0", "1", ...; in the order of lines
};

struct PoseSet {
  std::filesystem::path path;
  PoseFormat format = PoseFormat::kColmap;
  PoseKey key = PoseKey::kImageName;
  std::vector<NamedPose> poses;   // names are unique
  std::vector<double> times_sec;  // of kTimestamp, one per pose
};

// "a COLMAP model", "a TUM trajectory", ...
std::string_view Name(PoseFormat format);

// "names", "timestamps" or "lines".
std::string_view OrderName(PoseKey key);

// Recognises the format by content and reads under `repair`. Labels of a TUM trajectory are
// timestamps if all of them are numbers. Throws Error if nothing is recognised, the file is
// damaged, a name or time comes twice, or quaternions of a format with matrices shall be swapped.
PoseSet ReadPoseSet(const std::filesystem::path& path, const ConventionRepair& repair = {});

// Poses by image name. Throws Error as ReadPoseSet, and for trajectories without image names.
std::map<std::string, Rigid3d> ReadPoses(const std::filesystem::path& path);

}  // namespace vgtw
