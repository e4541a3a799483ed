// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/distractor_points.h"
#include "evaluation/mask_score.h"
#include "plugin/pipeline.h"
#include "scene/perturb.h"
#include "scene/synthetic.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

struct DemoOptions {
  std::filesystem::path output_path;
  SyntheticOptions scene;
  // Of the network that looks at the photos: VGTW's, or VGGT's and a LoRA with its head. None = the
  // truth with the errors of `perturb` takes the network's place.
  std::vector<std::filesystem::path> weights;
  PerturbOptions perturb;
  PipelineOptions pipeline;  // its paths are set by the demo
};

struct DemoRun {
  PipelineReport report;
  DistractorCount on_distractors;  // by the exact masks
};

struct DemoReport {
  DemoRun with_masks;
  DemoRun without_masks;
  PixelCounts mask_pixels;  // of predicted masks at probability 0.5, beside the exact ones
};

// Writes photos/, predictions/ (the network's, or the truth with feed-forward errors),
// truth/{masks,sparse}, runs the pipeline into with_masks/ and without_masks/, draws
// contact_sheet.png, and compares the two refined models in report.html. Throws Error if the
// network fails.
DemoReport RunDemo(const DemoOptions& options);

}  // namespace vgtw
