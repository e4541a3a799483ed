// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/conventions.h"

#include "bridge/colmap_model.h"
#include "scene/random.h"
#include "scene/synthetic.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr size_t kNumViews = 6;
constexpr size_t kNumSeeds = 10;

// A rendered scene with distractors, its photos on disk, and predictions with errors of VGGT's
// size: 0.2 deg, 2 % of the camera extent, 1 % of depth.
struct Scene {
  TemporaryFolder folder;
  ImportJob job;
  std::vector<ImportedView> views;

  Scene(uint64_t seed, CameraPath path) {
    const SyntheticScene scene({.path = path,
                                .num_views = kNumViews,
                                .width = 256,
                                .height = 192,
                                .path_extent_deg = 50.0,
                                .seed = seed});
    job.image_folder = folder.path();
    RandomStream random(HashKey({seed, static_cast<uint64_t>(path)}));
    for (size_t i = 0; i < kNumViews; ++i) {
      const SyntheticView rendered = scene.Render(i);
      ImportedView imported;
      imported.photo_idx = i;
      imported.prediction.view = scene.views()[i];
      imported.prediction.depth = rendered.static_depth;
      const auto depth_scale = static_cast<float>(1.0 + 0.01 * random.Normal());
      for (float& depth : imported.prediction.depth.data()) depth *= depth_scale;
      Rigid3d& cam_from_world = imported.prediction.view.cam_from_world;
      const Eigen::Vector3d centre =
          OriginInSource(cam_from_world) + 0.012 * scene.CameraExtent() * random.NormalVector();
      cam_from_world.rotation =
          RotationAboutAxis(random.NormalVector().normalized(), 0.2 * random.Normal()) *
          cam_from_world.rotation;
      cam_from_world.translation = -(cam_from_world.rotation * centre);
      WriteImage(folder.path() / imported.prediction.view.name, rendered.image);
      job.photos.push_back({imported.prediction.view.name, {256, 192}});
      views.push_back(std::move(imported));
    }
  }

  // What is found if the file has the mistakes that `repair` mends, and photo photo_of_view[i] is
  // taken for that of view i.
  std::vector<std::string> Find(const ConventionRepair& repair,
                                const std::vector<size_t>& photo_of_view = {}) {
    ConventionCheck check(job);
    for (size_t i = 0; i < kNumViews; ++i) {
      ImportedView imported = views[i];
      imported.pose = Mistaken(views[i].prediction.view.cam_from_world, repair);
      if (!photo_of_view.empty()) imported.photo_idx = photo_of_view[i];
      check.Add(imported);
    }
    return check.FindMistakes();
  }

  static FilePose Mistaken(Rigid3d pose, const ConventionRepair& repair) {
    if (repair.opengl_axes) {
      pose = Rigid3d{Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()} * pose;
    }
    if (repair.invert_poses) pose = Inverse(pose);
    if (repair.swap_quaternion_order) {
      const Eigen::Quaterniond& q = pose.rotation;
      pose.rotation = Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w());
    }
    return {pose, false, RotationForm::kQuaternionWxyz};
  }
};

void ExpectOnly(const std::vector<std::string>& mistakes, const std::string& text) {
  ASSERT_EQ(mistakes.size(), 1u) << "expected: " << text;
  EXPECT_NE(mistakes[0].find(text), std::string::npos) << mistakes[0];
}

void ExpectNone(const std::vector<std::string>& mistakes) {
  EXPECT_TRUE(mistakes.empty()) << mistakes[0];
}

class Conventions : public testing::TestWithParam<uint64_t> {};

TEST_P(Conventions, EachMistakeIsNamedOnAnOrbitAndNothingElse) {
  Scene scene(GetParam(), CameraPath::kOrbit);
  ExpectNone(scene.Find({}));
  ExpectOnly(scene.Find({.invert_poses = true}), "with --invert_poses:");
  ExpectOnly(scene.Find({.opengl_axes = true}), "with --opengl_axes:");
  ExpectOnly(scene.Find({.swap_quaternion_order = true}), "with --swap_quaternion_order:");
  ExpectOnly(scene.Find({true, true, false}), "with --invert_poses --opengl_axes:");
}

// Photos of this size do not tell every exchange for sure, and then nothing must be said.
TEST(ConventionsOfOrder, ShufflesOnAnOrbitAreNamedInAlmostAllScenes) {
  size_t num_named = 0;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed) {
    Scene scene(seed, CameraPath::kOrbit);
    for (const std::vector<size_t>& order :
         {std::vector<size_t>{0, 4, 2, 3, 1, 5}, std::vector<size_t>{5, 4, 3, 2, 1, 0}}) {
      const std::vector<std::string> mistakes = scene.Find({}, order);
      if (mistakes.empty()) continue;
      ExpectOnly(mistakes, "another order");
      ++num_named;
    }
  }
  EXPECT_GE(num_named, 2 * kNumSeeds - 2);
}

TEST_P(Conventions, EachMistakeIsNamedOnADriveForward) {
  Scene scene(GetParam(), CameraPath::kForward);
  ExpectNone(scene.Find({}));
  ExpectOnly(scene.Find({.invert_poses = true}), "with --invert_poses:");
  ExpectOnly(scene.Find({.swap_quaternion_order = true}), "with --swap_quaternion_order:");
  ExpectOnly(scene.Find({}, {3, 1, 2, 0, 5, 4}), "another order");
}

TEST_P(Conventions, CamerasThatAllLookOneWayAreLeftAlone) {
  Scene scene(GetParam(), CameraPath::kGrid);
  ExpectNone(scene.Find({}));
}

INSTANTIATE_TEST_SUITE_P(Seeds, Conventions, testing::Range<uint64_t>(0, kNumSeeds));

TEST(ConventionCheck, ARepairThatIsWrongIsNamed) {
  Scene scene(1, CameraPath::kOrbit);
  scene.job.options.repair.invert_poses = true;
  ExpectOnly(scene.Find({}), "without the repairs");
  ExpectNone(scene.Find({.invert_poses = true}));
}

TEST(ConventionCheck, WithoutDepthNothingIsSaid) {
  Scene scene(1, CameraPath::kOrbit);
  for (ImportedView& view : scene.views) view.prediction.depth = {};
  ExpectNone(scene.Find({.opengl_axes = true}));
}

TEST(ConventionCheck, NumericOrderOfNamesIsRecognised) {
  Scene scene(2, CameraPath::kOrbit);
  // Six views named 8..13: the byte order is 10, 11, 12, 13, 8, 9.
  const std::vector<std::string> by_number = {
      "8.png", "9.png", "10.png", "11.png", "12.png", "13.png"};
  std::vector<std::string> sorted = by_number;
  std::sort(sorted.begin(), sorted.end());
  for (size_t i = 0; i < kNumViews; ++i) {
    fs::rename(scene.folder / scene.job.photos[i].name, scene.folder / by_number[i]);
  }
  for (size_t i = 0; i < kNumViews; ++i) scene.job.photos[i].name = sorted[i];
  ExpectOnly(scene.Find({}), "in numeric order of their names");
}

TEST(AnchorSpread, IgnoresAConstantShift) {
  ConventionProbe probe;
  probe.view.camera = MakePinhole(100, 100, 50, 50);
  for (int i = 0; i < 5; ++i) {
    // Projects to (50 + 5 i, 50); the file says 7 pixels further right.
    probe.anchors.push_back({Eigen::Vector3d(0.1 * i, 0, 1), Eigen::Vector2d(57 + 5 * i, 50)});
  }
  EXPECT_NEAR(AnchorSpread(probe, {}), 0.0, 1e-12);
  // Half a turn around x puts all points behind the camera.
  EXPECT_GT(AnchorSpread(probe, {.opengl_axes = true}), 1e100);
}

// Real predictions of VGGT: 100,000 samples seen once each.
struct Fern {
  ImportJob job;
  Reconstruction model;

  Fern() {
    const fs::path data = SharedData() / "llff_fern_vggt";
    job.image_folder = data / "images";
    job.photos = ListPhotos(job.image_folder, 1);
    model = ReadModel(data / "vggt");
  }
  std::vector<std::string> Find(const ConventionRepair& repair,
                                const std::vector<size_t>& photo_of_view = {}) const {
    ConventionCheck check(job);
    for (const auto& [image_id, image] : model.images) {
      ImportedView imported;
      const auto photo =
          std::find_if(job.photos.begin(), job.photos.end(), [&name = image.name](const Photo& p) {
            return p.name == name;
          });
      imported.photo_idx = static_cast<size_t>(photo - job.photos.begin());
      if (!photo_of_view.empty()) imported.photo_idx = photo_of_view[imported.photo_idx];
      imported.pose = Scene::Mistaken(image.cam_from_world, repair);
      imported.prediction.view.camera = model.cameras.at(image.camera_id);
      for (const Point2D& point2D : image.points2D) {
        const Eigen::Vector3d& point = model.points3D.at(point2D.point3D_id).xyz;
        imported.anchors.push_back({point, point2D.xy});
        const Eigen::Vector3d in_cam = image.cam_from_world * point;
        const Eigen::Vector2d pixel = *Project(imported.prediction.view.camera, in_cam);
        imported.prediction.depth_samples.push_back(
            {pixel.cast<float>(), static_cast<float>(in_cam.z()), 1.0f});
      }
      check.Add(imported);
    }
    return check.FindMistakes();
  }
};

TEST(ConventionCheck, FernOfVggt) {
  VGTW_NEED_SHARED_DATA();
  const Fern fern;
  ExpectNone(fern.Find({}));
  ExpectOnly(fern.Find({.invert_poses = true}), "with --invert_poses:");
  ExpectOnly(fern.Find({.opengl_axes = true}), "with --opengl_axes:");
  ExpectOnly(fern.Find({.swap_quaternion_order = true}), "with --swap_quaternion_order:");
  std::vector<size_t> reversed(20);
  std::iota(reversed.rbegin(), reversed.rend(), size_t{0});
  ExpectOnly(fern.Find({}, reversed), "another order");
}

}  // namespace
}  // namespace vgtw
