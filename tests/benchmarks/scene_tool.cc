// SPDX-License-Identifier: BSD-3-Clause
// What benchmarks of the whole program need beside it:
//   scene_tool render FOLDER NUM_VIEWS PATH      photos/, masks/, truth/ (a predictions folder) of
//                                                the synthetic scene; PATH: orbit, forward, grid
//   scene_tool scenes FOLDER NUM VIEWS WIDTH HEIGHT SEED
//                                                photos/<scene>/, masks/<scene>/, truth/<scene>/ of
//                                                scenes that `vgtw train --scenes demo` renders
//   scene_tool perturb PREDICTIONS OUTPUT ROTATION_DEG CENTRE_% FOCAL_% DEPTH_% SEED
//                                                the same predictions with errors
//   scene_tool error MODEL PREDICTIONS           poses of a COLMAP model against predictions, JSON
//   scene_tool matches DATABASE PREDICTIONS      inlier matches of a database, the share within 3
//   px of
//                                                where poses of predictions allow them, pairs with
//                                                a geometry and photos that these connect, JSON
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "evaluation/pose_error.h"
#include "matching/relative_pose.h"
#include "scene/demo_scenes.h"
#include "scene/disjoint_sets.h"
#include "scene/error.h"
#include "scene/parallel.h"
#include "scene/perturb.h"
#include "scene/synthetic.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

void Render(const fs::path& folder, int num_views, const std::string& path) {
  SyntheticOptions options;
  options.path = path == "forward" ? CameraPath::kForward
                 : path == "grid"  ? CameraPath::kGrid
                                   : CameraPath::kOrbit;
  options.num_views = num_views;
  options.path_extent_deg = 300.0;
  options.width = 800;
  options.height = 600;
  const SyntheticScene scene(options);
  ParallelFor(num_views, 0, [&](int64_t i) {
    const auto idx = static_cast<size_t>(i);
    const SyntheticView view = scene.Render(idx);
    const std::string& name = scene.views()[idx].name;
    WriteImage(folder / "photos" / name, view.image);
    StaticMask mask(view.distractor.width(), view.distractor.height(), 255);
    for (size_t k = 0; k < mask.size(); ++k) {
      if (view.distractor.data()[k] > 0.5f) mask.data()[k] = 0;
    }
    WriteImage(MaskPath(folder / "masks", name), mask);
  });
  WritePrediction(MakeTruePrediction(scene), folder / "truth", /*overwrite=*/false);
}

// What is static and seen.
ViewPrediction TrueView(const SceneSample& scene, size_t view_idx) {
  ViewPrediction truth;
  View& view = truth.view;
  view.name = "view_" + std::to_string(100 + view_idx) + ".png";
  view.camera = scene.cameras[view_idx];
  view.cam_from_world = scene.cam_from_world[view_idx];
  truth.depth = scene.depth[view_idx];
  truth.distractor = scene.distractor[view_idx];
  view.network_width = truth.depth.width();
  view.network_height = truth.depth.height();
  truth.depth_conf = ConfidenceMap(view.network_width, view.network_height, 1.0f);
  for (size_t k = 0; k < truth.depth.size(); ++k) {
    if (truth.distractor.data()[k] > 0.5f) truth.depth.data()[k] = std::nanf("");
  }
  return truth;
}

void WriteScenes(char** args) {
  const fs::path folder = args[0];
  SceneStreamOptions options;
  options.min_views = options.max_views = std::atoi(args[2]);
  options.width = std::atoi(args[3]);
  options.height = std::atoi(args[4]);
  options.seed = std::strtoull(args[5], nullptr, 10);
  ParallelFor(std::atoi(args[1]), 0, [&](int64_t i) {
    const SceneSample scene = SampleDemoScene(options, static_cast<uint64_t>(i));
    const std::string name = "scene_" + std::to_string(1000 + i);
    Prediction truth;
    truth.producer = "scene_tool";
    for (size_t k = 0; k < scene.images.size(); ++k) {
      const ViewPrediction& view = truth.views.emplace_back(TrueView(scene, k));
      WriteImage(folder / "photos" / name / view.view.name, scene.images[k]);
      WriteImage(MaskPath(folder / "masks" / name, view.view.name),
                 MakeStaticMask(view.view, view.distractor, {.dilate_px = 0}));
    }
    WritePrediction(truth, folder / "truth" / name, /*overwrite=*/false);
  });
}

void PerturbFolder(char** args) {
  PerturbOptions options;
  options.rotation_deg = std::atof(args[2]);
  options.centre_percent = std::atof(args[3]);
  options.focal_percent = std::atof(args[4]);
  options.depth_scale_percent = options.depth_noise_percent = std::atof(args[5]);
  options.seed = std::strtoull(args[6], nullptr, 10);
  WritePrediction(Perturb(ReadPrediction(args[0]), options), args[1], /*overwrite=*/false);
}

void PrintError(const fs::path& model, const fs::path& predictions) {
  std::map<std::string, Rigid3d> reference;
  const PredictionReader reader(predictions);
  for (const View& view : reader.views()) {
    reference[view.name] = view.cam_from_world;
  }
  const auto estimate = CamFromWorldByName(ReadModel(model));
  const auto comparison = ComparePoses(estimate, reference);
  if (!comparison) throw Error(model.string() + ": too few poses to compare");
  std::printf("{\"num_images\": %zu, \"centre_rmse_percent\": %.4f, \"rotation_deg\": %.4f}\n",
              estimate.size(),
              comparison->centre_rmse_percent,
              comparison->relative_rotation_median_deg);
}

constexpr double kMaxErrorPx = 3.0;

// Of the matches of a pair, those whose Sampson distance by the poses is small.
size_t CountRight(const View& view1,
                  const View& view2,
                  const Keypoints& keypoints1,
                  const Keypoints& keypoints2,
                  const FeatureMatches& matches) {
  const Eigen::Matrix3d E = EssentialMatrix(view2.cam_from_world * Inverse(view1.cam_from_world));
  const double focal = 0.5 * (view1.camera.MeanFocalLength() + view2.camera.MeanFocalLength());
  return static_cast<size_t>(std::count_if(matches.begin(), matches.end(), [&](const auto& match) {
    const auto ray1 = Unproject(view1.camera, {keypoints1.x(match[0]), keypoints1.y(match[0])});
    const auto ray2 = Unproject(view2.camera, {keypoints2.x(match[1]), keypoints2.y(match[1])});
    return ray1 && ray2 && focal * SampsonDistance(E, *ray1, *ray2) <= kMaxErrorPx;
  }));
}

void PrintMatches(const fs::path& database_path, const fs::path& predictions) {
  const PredictionReader reader(predictions);
  std::map<std::string, const View*> view_by_name;
  for (const View& view : reader.views()) view_by_name[view.name] = &view;
  const ColmapDatabase database(database_path, ColmapDatabase::Mode::kReadOnly);
  std::map<ImageId, const View*> views;
  std::map<ImageId, Keypoints> keypoints;
  for (const DatabaseImage& image : database.ReadImages()) {
    views[image.image_id] = view_by_name.at(image.name);
    keypoints[image.image_id] = database.ReadKeypoints(image.image_id).value();
  }
  size_t num_matches = 0, num_right = 0, num_pairs = 0;
  DisjointSets<ImageId> connected(views.rbegin()->first + 1);
  for (const auto& [id1, id2] : database.ReadTwoViewPairs()) {
    const FeatureMatches matches = database.ReadTwoViewGeometry(id1, id2)->inlier_matches;
    if (matches.empty()) continue;
    ++num_pairs;
    num_matches += matches.size();
    num_right += CountRight(*views[id1], *views[id2], keypoints[id1], keypoints[id2], matches);
    connected.Join(id1, id2);
  }
  std::map<ImageId, size_t> sizes;
  for (const auto& [image_id, view] : views) ++sizes[connected.Find(image_id)];
  size_t num_connected = 0;
  for (const auto& [root, size] : sizes) num_connected = std::max(num_connected, size);
  std::printf(
      "{\"num_matches\": %zu, \"right\": %.4f, \"num_pairs\": %zu, \"num_connected\": %zu}\n",
      num_matches,
      static_cast<double>(num_right) / static_cast<double>(std::max<size_t>(num_matches, 1)),
      num_pairs,
      num_connected);
}

int Main(int argc, char** argv) {
  const std::string verb = argc > 1 ? argv[1] : "";
  try {
    if (verb == "render" && argc == 5) {
      Render(argv[2], std::atoi(argv[3]), argv[4]);
    } else if (verb == "scenes" && argc == 8) {
      WriteScenes(argv + 2);
    } else if (verb == "perturb" && argc == 9) {
      PerturbFolder(argv + 2);
    } else if (verb == "error" && argc == 4) {
      PrintError(argv[2], argv[3]);
    } else if (verb == "matches" && argc == 4) {
      PrintMatches(argv[2], argv[3]);
    } else {
      std::fprintf(stderr, "see the head of tests/benchmarks/scene_tool.cc\n");
      return 2;
    }
  } catch (const Error& error) {
    std::fprintf(stderr, "scene_tool: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) { return vgtw::Main(argc, argv); }
