// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/prediction.h"
#include "scene/progress.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

// What lies at --input_path. Every format is one row of a table in import.cc.
enum class ImportFormat {
  kAuto,       // recognised by content
  kColmap,     // sparse model, .bin or .txt (also VGGT's demo_colmap: depth samples)
  kVggtNpz,    // predictions.npz of VGGT's and VGTW's demos
  kNpzFolder,  // one <image name or stem>.npz (or folder of .npy) per image
  kTum,        // trajectory "timestamp tx ty tz qx qy qz qw" (camera-to-world) + intrinsics
  kLlff,       // poses_bounds.npy
  kDa3Npz,     // results.npz of Depth Anything 3
  kMonst3r,    // folder of MonST3R, Easi3R or CUT3R's evaluation: pred_traj.txt, frame_*.npy
  kVggtLong,   // camera_poses.txt (and intrinsic.txt) of VGGT-Long
  kCut3r,      // folder of CUT3R's demo: camera/%06d.npz, depth, conf
  kDust3r,     // scene of DUSt3R or MASt3R as .npz or folder of .npy: poses, focals, depthmaps, ...
  kFast3r,     // pointmaps_and_camera_params.npz of Fast3R
  kPi3,        // predictions.npz of pi3's demo: points, conf, camera_poses
  kMapAnything  // predictions.npz of MapAnything's demo
};

// How per-pixel maps relate to the original photos. kAuto is resolved from the sizes.
enum class ImportResize { kAuto, kCrop, kPad, kSquarePad, kStretch };

// Repairs of convention mistakes; nothing is changed unless asked for.
struct ConventionRepair {
  bool invert_poses = false;           // the file holds world_from_cam where cam_from_world was due
  bool opengl_axes = false;            // the file's camera looks along -z with y up
  bool swap_quaternion_order = false;  // the file's quaternions are xyzw where wxyz was due
};

struct ImportOptions {
  ImportFormat format = ImportFormat::kAuto;
  ImportResize resize = ImportResize::kAuto;
  ConventionRepair repair = {};
  // Intrinsics for formats without them: "fx,fy,cx,cy" or "f" in original pixels; else EXIF; else
  // 1.2 * max(width, height) with a warning.
  std::string camera_params = {};
  bool overwrite = false;
  int num_threads = 0;
};

struct ImportSummary {
  ImportFormat format = ImportFormat::kAuto;
  ImportResize resize = ImportResize::kAuto;
  size_t num_views = 0;
  size_t num_views_with_depth = 0;
  size_t num_views_with_samples = 0;
  size_t num_views_with_distractors = 0;
  std::vector<std::string> notes;  // what was understood and undone, for instance a shift
  std::vector<std::string>
      warnings;  // suspected convention mistakes, with the option that mends them
};

// Reads `input_path` and writes a predictions folder. Image sizes come from the photos. Throws
// Error if the input is damaged, of no known format, or does not fit the photos.
ImportSummary Import(const std::filesystem::path& input_path,
                     const std::filesystem::path& image_folder,
                     const std::filesystem::path& output_folder,
                     const ImportOptions& options,
                     const ProgressCallback& progress = {});

}  // namespace vgtw
