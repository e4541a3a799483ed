// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/seed.h"
#include "evaluation/pose_error.h"
#include "matching/sift.h"
#include "plugin/match_stage.h"
#include "plugin/refine_priors.h"
#include "refine/refine_model.h"
#include "scene/distractor_mask.h"
#include "scene/reprojection.h"

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

enum class Matcher {
  kGuided,     // our features, matched where the predictions put them
  kColmap,     // colmap's features, its exhaustive matcher
  kSequential  // colmap's features, its matcher for sequences
};
std::string_view Name(Matcher matcher);

struct PipelineOptions {
  std::filesystem::path image_path;
  std::filesystem::path predictions_path;
  std::filesystem::path mask_path;  // COLMAP masks from elsewhere; "" = from the predictions
  std::filesystem::path output_path;
  std::filesystem::path reference_path;  // COLMAP model or predictions with better poses; "" = none
  std::filesystem::path colmap;          // executable; "" = on PATH

  bool use_masks = true;
  StaticMaskOptions mask;

  Matcher matcher = Matcher::kGuided;
  int sequential_overlap = 10;  // images before and after, kSequential
  SiftOptions sift;             // colmap's features obey its two limits only
  MatchStageOptions match;      // kGuided
  bool use_gpu = false;         // for colmap's SIFT
  // For photos that were predicted as pinholes; refinement then finds the lens' distortion.
  CameraModel camera_model = CameraModel::kSimpleRadial;
  bool shared_camera = false;
  RefineModelOptions refine;  // without priors, which follow from the next
  PriorOptions priors;

  int num_threads = 0;
  bool overwrite = false;
  bool force = false;
};

// What became of one photo.
struct ViewReport {
  std::string name;
  size_t num_keypoints = 0;
  size_t num_excluded_keypoints = 0;  // that lie in excluded pixels; 0 if masking worked
  double excluded_share = 0.0;
  size_t num_observations = 0;       // in the refined model
  size_t num_supporting = 0;         // of these, of points that three views see
  double rotation_change_deg = 0.0;  // refined against feed-forward, relative to the others
  std::string outcome;               // Name(ViewOutcome)
  std::string reason;                // why it is not refined; "" if it is
};

struct PipelineReport {
  std::vector<ViewReport> views;
  ReprojectionStats feedforward;  // triangulated with the feed-forward poses
  ReprojectionStats refined;
  std::optional<PoseComparison> feedforward_error;  // against the reference, if there is one
  std::optional<PoseComparison> refined_error;
  size_t num_matched_pairs = 0;
  std::vector<std::string> notes;  // what the user should know
};

// Photos and predictions to a COLMAP reconstruction of the static scene:
//   masks -> features -> matches (ours or by the real colmap) -> feedforward: triangulated with the
//   predicted poses -> refined: rounds of triangulation and robust bundle adjustment that end no
//   worse than they began (refine/refine_model.h).
// Stages that are up to date are skipped. Throws Error if a stage leaves nothing to go on with.
PipelineReport RunPipeline(const PipelineOptions& options);

// The report as text for stdout.
std::string FormatReport(const PipelineReport& report);

}  // namespace vgtw
