// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// Which photos an evaluation ran on and under what conditions, as a file: protocol.json of
// docs/design.md, "Files". What another person needs to get the same numbers.

// How the photos were drawn; a record, since the lists themselves are stored.
struct ProtocolSampling {
  uint64_t seed = 0;
  uint64_t num_images = 10;           // per scene
  std::string test_images = "mixed";  // "mixed", "clean" or "clutter", see DrawImages
  uint64_t min_shared_images = 3;
  uint64_t num_clean_images = 0;  // of the pseudo ground truth; 0 = all
};

// What is measured and how. Defaults are what the paper of VGTW says, and what the evaluations that
// it follows do where it says nothing.
struct ProtocolConditions {
  double keep_percent = 50.0;            // of the predictions, see PredictionFilterOptions
  double reference_keep_percent = 50.0;  // of the pseudo ground truth
  std::string keep_scope = "all";        // "all" or "view"
  std::string keep_order = "before";     // "before" or "after" distractors are left out
  double mask_threshold = 0.5;           // in (0, 1]
  // "pixels", "cameras", "auto" or "none" as `evaluate points`; "dataset_cameras": prediction and
  // reference are both aligned to the scene's pose_reference, for which they need no common view.
  std::string alignment = "pixels";
  std::string icp = "none";   // then "rigid" or "similarity"
  double icp_distance = 0.1;  // scene units of the reference
  uint64_t num_normal_neighbours = 30;
  std::string depth_method = "reprojection";  // or "maps"
  std::string depth_cloud = "all";            // "all" or "own", of reprojection
  std::string depth_alignment = "median";     // "median", "scale", "scale_shift", "none", of maps
  std::string depth_mean = "pixels";          // over "pixels" or "views"
  std::string pose_alignment = "sim3";        // "sim3", "se3", "first" or "none"
  uint64_t rpe_delta = 1;                     // views, in the order of names
};

// Paths are relative to the dataset's folder, or absolute.
struct ProtocolScene {
  std::string name;   // of its folder among predictions; no '/'
  std::string title;  // in tables
  std::string group;  // of the table's heading, "" = none
  std::filesystem::path image_path;
  std::vector<std::string> test_images;    // names below image_path, sorted, at least 2
  std::vector<std::string> clean_images;   // without distractors, for the pseudo ground truth
  std::filesystem::path mask_path;         // true masks, "" = none
  std::string mask_convention = "colmap";  // MaskConvention::id
  // A real reference in place of the pseudo ground truth: predictions, COLMAP model or PLY.
  std::filesystem::path reference_path;
  std::filesystem::path pose_reference_path;  // of ReadPoseSet; "" = the poses of the reference
};

struct Protocol {
  std::string dataset;                 // a word for people: "robustnerf", "on_the_go", ...
  std::filesystem::path dataset_path;  // its folder; relative to that of the protocol file
  ProtocolSampling sampling;
  ProtocolConditions conditions;
  std::vector<ProtocolScene> scenes;  // in the order of tables; names are unique
};

// Throws Error for anything but format version 1: a missing field, a wrong type, a word or number
// out of its range, an unsafe, repeated or unsorted name. `path` names the file in messages.
Protocol ParseProtocol(std::string_view text, const std::filesystem::path& path);

// Law: Parse(Format(p)) formats to the same bytes. Throws Error if a string is not UTF-8.
std::string FormatProtocol(const Protocol& protocol);

// With dataset_path absolute, and so every path of the scenes that is not empty.
Protocol ReadProtocol(const std::filesystem::path& path);

}  // namespace vgtw
