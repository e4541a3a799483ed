// SPDX-License-Identifier: BSD-3-Clause
// Bundle adjustment of a made problem, for comparison with other programs on the same files:
//   bundle_adjustment_benchmark make MODEL NUM_IMAGES NUM_POINTS
//       a ring of cameras that share one SIMPLE_RADIAL camera, five observations per point with
//       0.5 px of noise; poses, points, focal length and distortion start with errors
//   bundle_adjustment_benchmark adjust MODEL OUTPUT ITERATIONS [THREADS]
//       poses, points, f and k of the model with squared residuals; one line of JSON: seconds of
//       the whole and of its parts, costs (half the sum of squares, px^2), peak memory; [seconds
//       since the start, cost] after each iteration
#include "bridge/colmap_model.h"
#include "refine/bundle_adjustment.h"
#include "scene/memory.h"
#include "scene/random.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <numbers>
#include <set>
#include <string>

namespace vgtw {
namespace {

constexpr int kObservationsPerPoint = 5;
constexpr double kNoisePx = 0.5;
constexpr double kRadius = 4.0;
constexpr double kFocalLength = 1000.0;
constexpr double kDistortion = -0.05;

Rigid3d MakePose(uint64_t idx, uint64_t num_images) {
  RandomStream random(HashKey({idx, 1}));
  const double angle =
      2.0 * std::numbers::pi * static_cast<double>(idx) / static_cast<double>(num_images);
  const Eigen::Vector3d centre(
      kRadius * std::cos(angle), kRadius * std::sin(angle), random.Uniform(-0.5, 0.5));
  return LookAt(centre, 0.1 * random.NormalVector(), {0.0, 0.0, 1.0});
}

Rigid3d Disturb(const Rigid3d& cam_from_world, uint64_t idx) {
  RandomStream random(HashKey({idx, 2}));
  const Eigen::Vector3d centre = OriginInSource(cam_from_world) + 0.01 * random.NormalVector();
  const Eigen::Vector3d axis = random.NormalVector().normalized();
  const Eigen::Quaterniond rotation =
      RotationAboutAxis(axis, 0.2 * random.Normal()) * cam_from_world.rotation;
  return {rotation, -(rotation * centre)};
}

Reconstruction MakeStart(uint64_t num_images, uint64_t num_points) {
  Reconstruction model;
  Camera camera = MakePinhole(1600, 1200, kFocalLength, kFocalLength);
  camera.camera_id = 1;
  camera.model = CameraModel::kSimpleRadial;
  camera.params = {kFocalLength, 800.0, 600.0, kDistortion};
  for (uint64_t i = 0; i < num_images; ++i) {
    const auto image_id = static_cast<ImageId>(i + 1);
    model.images[image_id] = {
        image_id, 1, "image" + std::to_string(i) + ".jpg", MakePose(i, num_images), {}};
  }
  for (Point3DId id = 1; id <= num_points; ++id) {
    RandomStream random(HashKey({id, 3}));
    const Eigen::Vector3d point(
        random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-0.8, 0.8));
    Point3D& made = model.points3D[id];
    made.xyz = point + 0.01 * random.NormalVector();
    // Any of a tenth of the ring, as a feature is found in some of the views that it is seen from.
    const uint64_t span = num_images / 10;
    const uint64_t first = random.Bits() % num_images;
    std::set<ImageId> image_ids;
    while (image_ids.size() < kObservationsPerPoint) {
      image_ids.insert(static_cast<ImageId>((first + random.Bits() % span) % num_images + 1));
    }
    for (const ImageId image_id : image_ids) {
      Image& image = model.images.at(image_id);
      const Eigen::Vector2d noise(random.Normal(), random.Normal());
      made.track.push_back({image_id, static_cast<uint32_t>(image.points2D.size())});
      image.points2D.push_back(
          {*Project(camera, image.cam_from_world * point) + kNoisePx * noise, id});
    }
  }
  for (auto& [id, image] : model.images) image.cam_from_world = Disturb(image.cam_from_world, id);
  camera.params[0] *= 1.02;
  camera.params[3] = 0.0;
  model.cameras[1] = camera;
  return model;
}

void Adjust(const std::string& input, const std::string& output, int iterations, int threads) {
  Reconstruction model = ReadModel(input);
  const int64_t resident = ResidentMemory();
  BundleAdjustmentOptions options;
  options.loss = RobustLoss::kTrivial;
  options.refine_extra_params = true;
  options.max_num_iterations = iterations;
  options.function_tolerance = 0.0;
  options.num_threads = threads;
  std::string steps;
  const auto start = std::chrono::steady_clock::now();
  options.on_iteration = [&](int, double cost) {
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
    char step[64];
    std::snprintf(
        step, sizeof(step), "%s[%.3f, %.4f]", steps.empty() ? "" : ", ", seconds.count(), cost);
    steps += step;
    return true;
  };
  const BundleAdjustmentSummary summary = AdjustBundle(options, model);
  std::printf(
      "{\"seconds\": %.3f, \"evaluation_seconds\": %.3f, \"linear_seconds\": %.3f, "
      "\"iterations\": %d, \"residuals\": %zu, \"initial_cost\": %.6f, \"final_cost\": %.6f, "
      "\"f\": %.4f, \"k\": %.6f, \"resident_gib\": %.3f, \"peak_gib\": %.3f, \"steps\": [%s]}\n",
      summary.total_sec,
      summary.evaluation_sec,
      summary.linear_solver_sec,
      summary.num_iterations,
      summary.num_residuals,
      summary.initial_cost,
      summary.final_cost,
      model.cameras.at(1).params[0],
      model.cameras.at(1).params[3],
      static_cast<double>(resident) / kGib,
      static_cast<double>(PeakMemory()) / kGib,
      steps.c_str());
  WriteModel(model, output, {.overwrite = true});
}

int Run(int argc, char** argv) {
  const std::string verb = argc > 1 ? argv[1] : "";
  if (verb == "make" && argc == 5) {
    WriteModel(MakeStart(std::stoull(argv[3]), std::stoull(argv[4])), argv[2]);
    return EXIT_SUCCESS;
  }
  if (verb == "adjust" && (argc == 5 || argc == 6)) {
    Adjust(argv[2], argv[3], std::stoi(argv[4]), argc == 6 ? std::stoi(argv[5]) : 0);
    return EXIT_SUCCESS;
  }
  std::fprintf(stderr, "see the head of bundle_adjustment_benchmark.cc\n");
  return 2;
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  try {
    return vgtw::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bundle_adjustment_benchmark: %s\n", error.what());
    return EXIT_FAILURE;
  }
}
