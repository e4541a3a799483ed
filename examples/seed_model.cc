// SPDX-License-Identifier: BSD-3-Clause
// From feed-forward predictions to a COLMAP model, with the truth at hand to judge it.
//
// A scene is rendered whose distractors stand elsewhere in every view. A perfect prediction of it
// is perturbed as a network would err, and moved into another world frame. The model made from it
// has a camera per photo and points where static, confident depths of several views agree. It is as
// good as the prediction: bundle adjustment of features is what comes next (`vgtw run`).
//   usage: seed_model EMPTY_FOLDER
#include "bridge/colmap_model.h"
#include "bridge/predictions.h"
#include "bridge/seed.h"
#include "evaluation/pose_error.h"
#include "scene/error.h"
#include "scene/perturb.h"
#include "scene/synthetic.h"

#include <cstdio>

namespace {

std::map<std::string, vgtw::Rigid3d> TruePoses(const vgtw::SyntheticScene& scene) {
  std::map<std::string, vgtw::Rigid3d> cam_from_world_by_name;
  for (const vgtw::View& view : scene.views()) {
    cam_from_world_by_name[view.name] = view.cam_from_world;
  }
  return cam_from_world_by_name;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  try {
    vgtw::SyntheticOptions scene_options;
    scene_options.num_views = 6;
    scene_options.width = 160;
    scene_options.height = 120;
    const vgtw::SyntheticScene scene(scene_options);
    const vgtw::Prediction truth = vgtw::MakeTruePrediction(scene, /*network_width=*/112);
    vgtw::WritePrediction(vgtw::Perturb(truth, {}), folder / "predictions", /*overwrite=*/false);

    const vgtw::PredictionReader predictions(folder / "predictions");
    const vgtw::Seed seed = vgtw::MakeSeed(predictions, vgtw::SeedOptions());
    vgtw::WriteModel(seed.reconstruction, folder / "sparse");

    const vgtw::Reconstruction model = vgtw::ReadModel(folder / "sparse");
    std::printf("model: %zu images, points: %s\n",
                model.images.size(),
                model.points3D.size() > 100 ? "more than 100" : "too few");
    const auto comparison = vgtw::ComparePoses(vgtw::CamFromWorldByName(model), TruePoses(scene));
    if (!comparison.has_value()) return 1;
    std::printf("centres off by %.1f %% of the extent (RMSE, Sim3-aligned)\n",
                comparison->centre_rmse_percent);
    std::printf("relative rotations off by %.1f deg (median of pairs)\n",
                comparison->relative_rotation_median_deg);
    return 0;
  } catch (const vgtw::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
