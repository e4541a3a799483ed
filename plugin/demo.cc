// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/demo.h"

#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "plugin/comparison.h"
#include "plugin/comparison_pictures.h"
#include "plugin/contact_sheet.h"
#include "plugin/mask_scores.h"
#include "plugin/network_program.h"
#include "plugin/progress.h"
#include "scene/image_io.h"
#include "scene/parallel.h"

namespace vgtw {
namespace {

namespace fs = std::filesystem;

StaticMask ExactMask(const DistractorMask& distractor) {
  StaticMask mask(distractor.width(), distractor.height());
  for (size_t i = 0; i < mask.size(); ++i) {
    mask.data()[i] = distractor.data()[i] > 0.5f ? uint8_t{0} : uint8_t{255};
  }
  return mask;
}

// True cameras and poses as a COLMAP model without points.
Reconstruction TrueModel(const std::vector<View>& views) {
  Reconstruction model;
  for (size_t i = 0; i < views.size(); ++i) {
    const auto id = static_cast<uint32_t>(i + 1);
    Camera camera = views[i].camera;
    camera.camera_id = id;
    model.cameras[id] = camera;
    Image& image = model.images[id];
    image.image_id = id;
    image.camera_id = id;
    image.name = views[i].name;
    image.cam_from_world = views[i].cam_from_world;
  }
  return model;
}

void WriteScene(const DemoOptions& options) {
  const SyntheticScene scene(options.scene);
  const fs::path& out = options.output_path;
  ProgressDisplay display("rendering");
  ParallelFor(
      static_cast<int64_t>(scene.views().size()),
      options.pipeline.num_threads,
      [&](int64_t i) {
        const auto idx = static_cast<size_t>(i);
        const SyntheticView view = scene.Render(idx);
        const std::string& name = scene.views()[idx].name;
        WriteImage(out / "photos" / name, view.image);
        WriteImage(MaskPath(out / "truth" / "masks", name), ExactMask(view.distractor));
      },
      display.Callback());
  WriteModelOptions overwrite;
  overwrite.overwrite = true;
  WriteModel(TrueModel(scene.views()), out / "truth" / "sparse", overwrite);
  if (options.weights.empty()) {
    WritePrediction(Perturb(MakeTruePrediction(scene), options.perturb),
                    out / "predictions",
                    /*overwrite=*/true);
  }
}

// Runs `vgtw predict` in a process of its own, as LibTorch lives there.
void PredictByNetwork(const DemoOptions& options) {
  const fs::path& out = options.output_path;
  std::vector<std::string> arguments = {"predict",
                                        "--image_path",
                                        (out / "photos").string(),
                                        "--output_path",
                                        (out / "predictions").string(),
                                        "--overwrite",
                                        "--threads",
                                        std::to_string(options.pipeline.num_threads),
                                        "--weights_path",
                                        options.weights.front().string()};
  if (options.weights.size() > 1) {
    arguments.insert(arguments.end(), {"--lora_path", options.weights[1].string()});
  }
  Announce("predicting poses, depths and masks by the network");
  RunNetworkProgram(RequireNetworkProgram(), arguments, out / "predict.log");
}

PixelCounts ComparePixels(const DemoOptions& options) {
  MaskScoresOptions scores;
  scores.predictions_path = options.output_path / "predictions";
  scores.reference_mask_path = options.output_path / "truth" / "masks";
  scores.num_threads = options.pipeline.num_threads;
  MaskScore sum;
  for (const ImageMaskScore& image : ScoreMasks(scores)) sum += image.score;
  return sum.pixels;
}

DemoRun RunOnce(const DemoOptions& options, bool use_masks) {
  const fs::path& out = options.output_path;
  PipelineOptions pipeline = options.pipeline;
  pipeline.image_path = out / "photos";
  pipeline.predictions_path = out / "predictions";
  pipeline.reference_path = out / "truth" / "sparse";
  pipeline.output_path = out / (use_masks ? "with_masks" : "without_masks");
  pipeline.use_masks = use_masks;
  Announce(use_masks ? "reconstructing with masks" : "reconstructing without masks");
  DemoRun run;
  run.report = RunPipeline(pipeline);
  run.on_distractors = CountOnDistractors(
      ReadModel(pipeline.output_path / "sparse" / "refined"), [&](const std::string& name) {
        return ReadStaticMask(MaskPath(out / "truth" / "masks", name));
      });
  return run;
}

std::vector<Eigen::Vector2d> FeaturesOf(const fs::path& database_path, const std::string& name) {
  const ColmapDatabase database(database_path, ColmapDatabase::Mode::kReadOnly);
  std::vector<Eigen::Vector2d> features;
  for (const DatabaseImage& image : database.ReadImages()) {
    if (image.name != name) continue;
    const auto keypoints = database.ReadKeypoints(image.image_id);
    for (size_t row = 0; keypoints && row < keypoints->rows; ++row) {
      features.emplace_back(keypoints->x(row), keypoints->y(row));
    }
  }
  return features;
}

void DrawContactSheet(const DemoOptions& options) {
  constexpr size_t kMaxRows = 4;
  const fs::path& out = options.output_path;
  const std::vector<std::string> names = ListImages(out / "photos");
  const size_t stride = std::max<size_t>(1, names.size() / kMaxRows);
  std::vector<ContactSheetRow> rows;
  for (size_t i = 0; i < names.size() && rows.size() < kMaxRows; i += stride) {
    ContactSheetRow row;
    row.name = names[i];
    row.photo = ReadRgbImage(out / "photos" / names[i]);
    row.static_mask = ReadStaticMask(MaskPath(out / "with_masks" / "masks", names[i]));
    row.kept_features = FeaturesOf(out / "with_masks" / "database.db", names[i]);
    for (const auto& xy : FeaturesOf(out / "without_masks" / "database.db", names[i])) {
      if (IsExcluded(row.static_mask, xy.x(), xy.y())) row.dropped_features.push_back(xy);
    }
    rows.push_back(std::move(row));
  }
  WriteImage(out / "contact_sheet.png", MakeContactSheet(rows));
}

void WriteReport(const DemoOptions& options) {
  const fs::path& out = options.output_path;
  ComparisonInputs inputs;
  for (const char* name : {"without_masks", "with_masks"}) {
    const fs::path path = out / name / "sparse" / "refined";
    inputs.models.push_back({name, path, ReadModel(path)});
  }
  inputs.reference_path = out / "truth" / "sparse";
  inputs.reference = CamFromWorldByName(ReadModel(inputs.reference_path));
  inputs.image_path = out / "photos";
  inputs.mask_path = out / "truth" / "masks";
  inputs.title = "A made scene, reconstructed without and with masks";
  inputs.command = "vgtw demo";
  inputs.num_threads = options.pipeline.num_threads;
  WriteComparisonPage(out / "report.html", inputs, CompareModels(inputs));
}

}  // namespace

DemoReport RunDemo(const DemoOptions& options) {
  WriteScene(options);
  if (!options.weights.empty()) PredictByNetwork(options);
  DemoReport report;
  report.mask_pixels = ComparePixels(options);
  report.with_masks = RunOnce(options, /*use_masks=*/true);
  report.without_masks = RunOnce(options, /*use_masks=*/false);
  DrawContactSheet(options);
  WriteReport(options);
  return report;
}

}  // namespace vgtw
