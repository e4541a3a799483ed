// SPDX-License-Identifier: BSD-3-Clause
#include "tests/refine/random_problem.h"

#include "scene/random.h"
#include "tests/support/synthetic_model.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <utility>

namespace vgtw {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

class ProblemMaker {
 public:
  explicit ProblemMaker(uint64_t number) : random_(HashKey({number, 77})), number_(number) {}

  RandomProblem Make() {
    MakeTruth();
    problem_.tracks = TracksOf(model_);
    ProjectAgain(model_, noise_px_, static_cast<unsigned>(number_));
    HideObservations();
    MoveThings();
    ScatterKeypoints();
    JoinTracks();
    MakeSeed();
    std::erase_if(problem_.tracks, [](const Track& track) { return track.size() < 2; });
    return std::move(problem_);
  }

 private:
  bool Chance(double probability) { return random_.Uniform() < probability; }
  size_t Below(size_t num) {
    return static_cast<size_t>(random_.Uniform() * static_cast<double>(num));
  }
  ImageId RandomImage() { return static_cast<ImageId>(1 + Below(model_.images.size())); }
  Point2D& KeypointOf(const TrackElement& element) {
    return model_.images.at(element.image_id).points2D[element.point2D_idx];
  }
  // 0 in half of all cases, else up to `most`.
  double SomeOrNone(double most) { return Chance(0.5) ? 0.0 : random_.Uniform(0.0, most); }

  template <typename... Values>
  void Say(const char* format, Values... values) {
    char text[128];
    std::snprintf(text, sizeof(text), format, values...);
    problem_.description += text;
  }

  void MakeTruth() {
    SyntheticModelOptions options;
    options.num_images = Chance(0.12) ? 2 : 3 + static_cast<int>(Below(10));
    options.num_points = static_cast<int>(60.0 * std::exp(random_.Uniform(0.0, 2.0)));
    options.camera_model = static_cast<CameraModel>(Below(kNumCameraModels));
    options.shared_camera = Chance(0.4);
    options.planar = Chance(0.15);
    options.arc_deg = 10.0 * std::exp(random_.Uniform(0.0, 2.5));
    options.seed = static_cast<unsigned>(number_);
    const bool is_pure_rotation = Chance(0.1);
    if (is_pure_rotation) options.arc_deg = 20.0;
    noise_px_ = Chance(0.1) ? 0.0 : random_.Uniform(0.1, 1.0);
    model_ = MakeSyntheticModel(options);
    const Eigen::Vector3d centre(0.1, 0.2, -4.0);
    for (auto& [id, image] : model_.images) {
      if (!is_pure_rotation) break;
      image.cam_from_world.translation = -(image.cam_from_world.rotation * centre);
    }
    Say("%llu: %d views, %d points, %s%s%s%s, arc %.0f deg, noise %.1f px",
        static_cast<unsigned long long>(number_),
        options.num_images,
        options.num_points,
        GetCameraModelInfo(options.camera_model).name.data(),
        options.shared_camera ? " shared" : "",
        options.planar ? ", plane" : "",
        is_pure_rotation ? ", pure rotation" : "",
        options.arc_deg,
        noise_px_);
  }

  void HideObservations() {
    std::vector<double> visibility(model_.images.size() + 1);
    const double usual = random_.Uniform(0.35, 1.0);
    size_t num_weak = 0;
    for (double& share : visibility) {
      const bool is_weak = Chance(0.08);
      share = is_weak ? random_.Uniform(0.0, 0.2) : usual;
      num_weak += is_weak;
    }
    for (Track& track : problem_.tracks) {
      std::erase_if(track, [&](const TrackElement& element) {
        return !Chance(visibility[element.image_id]);
      });
    }
    Say(", %.0f %% seen, %zu weak", 100.0 * usual, num_weak);
  }

  // Points that stand still on a thing that moved between two views.
  void MoveThings() {
    if (!Chance(0.4)) return;
    const ImageId first = RandomImage();
    const ImageId second = static_cast<ImageId>(first % model_.images.size() + 1);
    const double share = random_.Uniform(0.05, 0.5);
    const Rigid3d motion = {RotationAboutAxis(random_.NormalVector().normalized(), 8.0),
                            0.15 * random_.NormalVector()};
    for (Track& track : problem_.tracks) {
      if (!Chance(share) || track.empty()) continue;
      const uint32_t idx = track.front().point2D_idx;  // of all images
      const Image& image = model_.images.at(second);
      const auto pixel = Project(
          model_.cameras.at(image.camera_id),
          image.cam_from_world * (motion * model_.points3D.at(image.points2D[idx].point3D_id).xyz));
      if (!pixel) continue;
      track = {{first, idx}, {second, idx}};
      KeypointOf(track[1]).xy = *pixel;
    }
    Say(", %.0f %% moved in %u and %u", 100.0 * share, first, second);
  }

  void ScatterKeypoints() {
    const double wrong_tracks = SomeOrNone(0.4);
    const double wrong_elements = SomeOrNone(0.2);
    for (const Track& track : problem_.tracks) {
      const bool is_wrong = Chance(wrong_tracks);
      for (const TrackElement& element : track) {
        if (!is_wrong && !Chance(wrong_elements)) continue;
        const double x = random_.Uniform(0.0, 640.0);
        KeypointOf(element).xy = {x, random_.Uniform(0.0, 480.0)};
      }
    }
    Say(", wrong %.0f %% of tracks, %.0f %% of elements",
        100.0 * wrong_tracks,
        100.0 * wrong_elements);
  }

  void JoinTracks() {
    const double share = SomeOrNone(0.2);
    std::vector<Track> joined;
    for (Track& track : problem_.tracks) {
      if (!joined.empty() && Chance(share)) {
        joined.back().insert(joined.back().end(), track.begin(), track.end());
      } else {
        joined.push_back(std::move(track));
      }
    }
    problem_.tracks = std::move(joined);
    Say(", %.0f %% joined", 100.0 * share);
  }

  void MakeSeed() {
    const double rotation_deg = random_.Uniform(0.0, 8.0) * random_.Uniform();
    const double centre = 0.1 * rotation_deg;
    const double focal_percent = SomeOrNone(4.0 * rotation_deg);
    const bool has_points = Chance(0.5);
    problem_.truth = model_;
    problem_.truth.points3D.clear();
    for (auto& [id, image] : problem_.truth.images) {
      for (Point2D& point2D : image.points2D) point2D.point3D_id = kInvalidPoint3DId;
    }
    Reconstruction& seed = problem_.seed = has_points ? model_ : problem_.truth;
    PerturbPoses(seed, rotation_deg, centre, static_cast<unsigned>(number_));
    // Points that are nowhere near, as of wrong depths.
    PerturbPoints(seed, random_.Uniform(0.0, 3.0), static_cast<unsigned>(number_));
    for (auto& [id, camera] : seed.cameras) {
      const double factor = std::exp(0.01 * focal_percent * random_.Normal());
      camera.SetFocalLength(factor * camera.FocalLengthX(), factor * camera.FocalLengthY());
    }
    Say(", seed off %.2f deg, %.2f, %.1f %%", rotation_deg, centre, focal_percent);
    BreakViews(seed);
  }

  void BreakViews(Reconstruction& seed) {
    if (Chance(0.15)) {
      const ImageId id = RandomImage();
      seed.images.at(id).cam_from_world = {random_.Rotation(), random_.NormalVector()};
      Say(", %u anywhere", id);
    }
    if (Chance(0.1)) {
      const ImageId id = RandomImage();
      Rigid3d& pose = seed.images.at(id).cam_from_world;
      (Chance(0.5) ? pose.rotation.coeffs()[2] : pose.translation[1]) = kNaN;
      Say(", %u not a number", id);
    }
    if (Chance(0.05)) {
      Camera& camera = seed.cameras.begin()->second;
      camera.params[Below(camera.params.size())] = kNaN;
      Say(", camera %u not a number", camera.camera_id);
    }
  }

  RandomStream random_;
  uint64_t number_;
  double noise_px_ = 0.0;
  Reconstruction model_;  // the truth with its points
  RandomProblem problem_;
};

}  // namespace

RandomProblem MakeRandomProblem(uint64_t number) { return ProblemMaker(number).Make(); }

PairError ComparePairs(const Reconstruction& model, const Reconstruction& truth) {
  PairError sum;
  double num_rotations = 0.0;
  double num_directions = 0.0;
  for (const auto& [id1, image1] : model.images) {
    for (const auto& [id2, image2] : model.images) {
      if (id2 <= id1 || !truth.images.contains(id1) || !truth.images.contains(id2)) continue;
      const Rigid3d found = image2.cam_from_world * Inverse(image1.cam_from_world);
      const Rigid3d expected =
          truth.images.at(id2).cam_from_world * Inverse(truth.images.at(id1).cam_from_world);
      sum.rotation_deg += AngleBetweenDeg(found.rotation, expected.rotation);
      num_rotations += 1.0;
      const Eigen::Vector3d centre = OriginInSource(found);
      const Eigen::Vector3d true_centre = OriginInSource(expected);
      if (centre.norm() < 1e-9 || true_centre.norm() < 1e-9) continue;
      sum.direction_deg += std::atan2(centre.cross(true_centre).norm(), centre.dot(true_centre)) *
                           180.0 / std::numbers::pi;
      num_directions += 1.0;
    }
  }
  return {sum.rotation_deg / std::max(num_rotations, 1.0),
          sum.direction_deg / std::max(num_directions, 1.0)};
}

}  // namespace vgtw
