// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"
#include "scene/reconstruction.h"
#include "scene/rigid3d.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

struct ComparedModel {
  std::string name;
  std::filesystem::path path;
  Reconstruction model;
};

struct ComparisonInputs {
  std::vector<ComparedModel> models;  // at least one; changes are measured against the first
  std::filesystem::path reference_path;
  std::map<std::string, Rigid3d> reference;  // better poses by name; empty = none

  // "" = left out, and with it what needs it
  std::filesystem::path image_path;
  std::filesystem::path mask_path;      // true masks, COLMAP's names; a photo without one has none
  std::filesystem::path database_path;  // its tracks judge the models

  // The result of the refinement that made the last model (plugin/refine_report.h), or null.
  nlohmann::json refinement;
  // Of the database's tracks, as refinement holds them out.
  double held_out_percent = 10.0;
  uint64_t held_out_seed = 0;
  double held_out_max_px = 32.0;  // errors beyond count alike

  std::string title;
  std::string command;
  size_t max_num_points = 100000;  // of each model, in the 3D view
  int num_threads = 0;
};

// Takes what run.json (plugin/workspace.h) says of the refinement that made the last model: what
// became of views, and how tracks were held out. Does nothing with another object.
void UseRunRecord(const nlohmann::json& record, ComparisonInputs& inputs);

// All that is said of models side by side, in every form: stdout, CSV, Markdown, JSON and the data
// of report.html. One object:
//   title, summary [sentences, the first is the answer], notes [..], producer, command, alignment
//   models [{name, path, role: before | after | other | reference, num_images, num_points3D,
//     num_observations, mean_track_length, median_px, p90_px, median_angle_deg, coverage_percent,
//     held_out_px, points_on_distractors, scale_drift_percent, error_histogram and track_histogram
//     {first, step, counts} of observations (px) and points, over the same bins for all models,
//     pose_error {centre_rmse_percent, rotation_median_deg, direction_median_deg, num_views}}]
//   views [{name, width, height, excluded_percent, by_model [{num_observations, median_px,
//     held_out_px, coverage_percent, mean_track_length, median_angle_deg,
//     observations_on_distractors, rotation_change_deg, centre_change_percent, rotation_error_deg,
//     centre_error_percent, status, reason}]}]   by_model: null where the model lacks the view
//   guilty [{name, why}]   views to look at first
// What is not known is null. Definitions: evaluation/{model_quality,pose_error,scale_drift}.h and
// refine/held_out.h; percents of centres are of the extent.
// Throws Error if a mask is unreadable or of another size.
nlohmann::json CompareModels(const ComparisonInputs& inputs, const ProgressCallback& progress = {});

}  // namespace vgtw
