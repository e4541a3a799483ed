// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/distractor_points.h"
#include "plugin/pipeline.h"
#include "scene/perturb.h"
#include "scene/synthetic.h"

#include <filesystem>
#include <string>

namespace vgtw {

struct DemoOptions {
  std::filesystem::path output_path;
  SyntheticOptions scene;
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
};

// Writes photos/, predictions/ (the truth with feed-forward errors), truth/{masks,sparse}, runs the
// pipeline into with_masks/ and without_masks/, draws contact_sheet.png, and compares the two
// refined models in report.html.
DemoReport RunDemo(const DemoOptions& options);

}  // namespace vgtw
