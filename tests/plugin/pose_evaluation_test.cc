// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/pose_evaluation.h"

#include "bridge/colmap_model.h"
#include "scene/files.h"
#include "scene/random.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string NameOf(size_t i) { return "photo" + std::to_string(10 + i) + ".jpg"; }

// Cameras around the origin, which they look at.
std::vector<Rigid3d> Ring(size_t num_views) {
  std::vector<Rigid3d> cams_from_world;
  for (size_t i = 0; i < num_views; ++i) {
    const double angle = 4.5 * static_cast<double>(i) / static_cast<double>(num_views);
    const Eigen::Vector3d centre(
        3.0 * std::cos(angle), 0.5 * std::sin(5.0 * angle), 3.0 * std::sin(angle));
    cams_from_world.push_back(LookAt(centre, {0, 0, 0}, {0, 1, 0}));
  }
  return cams_from_world;
}

// In another world, with errors of about half a degree.
std::vector<Rigid3d> Estimated(std::vector<Rigid3d> cams_from_world) {
  RandomStream random(2);
  const Sim3d similarity = {0.4, random.Rotation(), random.NormalVector()};
  for (Rigid3d& cam_from_world : cams_from_world) {
    const Eigen::Vector3d axis = random.NormalVector().normalized();
    cam_from_world.rotation = RotationAboutAxis(axis, 0.5) * cam_from_world.rotation;
    cam_from_world = TransformCamera(similarity, cam_from_world);
  }
  return cams_from_world;
}

std::string Numbers(std::initializer_list<double> values) {
  std::string text;
  for (const double value : values) {
    char number[40];
    std::snprintf(number, sizeof(number), " %.17g", value);
    text += number;
  }
  return text;
}

std::string TumText(const std::vector<Rigid3d>& cams_from_world) {
  std::string text;
  for (size_t i = 0; i < cams_from_world.size(); ++i) {
    const auto [q, t] = Inverse(cams_from_world[i]);
    text += NameOf(i) + Numbers({t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) + "\n";
  }
  return text;
}

std::string KittiText(const std::vector<Rigid3d>& cams_from_world) {
  std::string text;
  for (const Rigid3d& cam_from_world : cams_from_world) {
    const Eigen::Matrix<double, 3, 4> matrix = Inverse(cam_from_world).ToMatrix();
    for (int row = 0; row < 3; ++row) {
      text += Numbers({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
    }
    text += "\n";
  }
  return text;
}

Reconstruction ModelOf(const std::vector<Rigid3d>& cams_from_world) {
  Reconstruction model;
  model.cameras[1] = MakePinhole(640, 480, 500.0, 500.0);
  model.cameras[1].camera_id = 1;
  for (size_t i = 0; i < cams_from_world.size(); ++i) {
    const auto id = static_cast<ImageId>(i + 1);
    model.images[id] = {id, 1, NameOf(i), cams_from_world[i], {}};
  }
  return model;
}

class EvaluatePosesTest : public testing::Test {
 protected:
  static constexpr size_t kNumViews = 12;

  void SetUp() override {
    truth_ = Ring(kNumViews);
    estimate_ = Estimated(truth_);
    WriteModel(ModelOf(truth_), folder_ / "truth");
  }

  PoseEvaluation Evaluate(const std::string& text, PoseEvaluationOptions options = {}) const {
    WriteFileAtomically(folder_ / "estimate.txt", text);
    options.input_path = folder_ / "estimate.txt";
    options.reference_path = folder_ / "truth";
    return EvaluatePoses(options);
  }

  // The warning about the poses as they are, and what --`repair` then finds.
  void ExpectMended(const std::string& text,
                    const std::string& flags,
                    const ConventionRepair& repair) const {
    EXPECT_THAT(Evaluate(text).warnings, ElementsAre(HasSubstr("read with " + flags + " they")));
    const PoseEvaluation mended = Evaluate(text, {.repair = repair});
    EXPECT_THAT(mended.warnings, IsEmpty());
    EXPECT_LT(mended.comparison.relative_rotation_median_deg, 1.0);
  }

  const TemporaryFolder folder_;
  std::vector<Rigid3d> truth_;
  std::vector<Rigid3d> estimate_;
};

TEST_F(EvaluatePosesTest, EveryFormatGivesTheSameFigures) {
  const PoseEvaluation tum = Evaluate(TumText(estimate_));
  EXPECT_EQ(tum.comparison.views.size(), kNumViews);
  EXPECT_EQ(tum.order, "names");
  EXPECT_THAT(tum.warnings, IsEmpty());
  EXPECT_THAT(tum.notes, IsEmpty());
  EXPECT_GT(tum.ate.rmse, 1e-3);
  EXPECT_LT(tum.ate.rmse, 0.1);
  ASSERT_EQ(tum.accuracies.size(), 4u);
  EXPECT_EQ(tum.accuracies[1].threshold_deg, 5.0);

  const PoseEvaluation kitti = Evaluate(KittiText(estimate_));
  EXPECT_THAT(kitti.notes, ElementsAre(HasSubstr("order")));
  WriteModel(ModelOf(estimate_), folder_ / "model");
  const PoseEvaluation colmap =
      EvaluatePoses({.input_path = folder_ / "model", .reference_path = folder_ / "truth"});
  for (const PoseEvaluation* other : {&kitti, &colmap}) {
    // Rotations are written as matrices and as quaternions.
    EXPECT_NEAR(other->ate.rmse, tum.ate.rmse, 1e-12);
    EXPECT_NEAR(other->rpe->translation.rmse, tum.rpe->translation.rmse, 1e-12);
    EXPECT_NEAR(other->rpe->rotation_deg.rmse, tum.rpe->rotation_deg.rmse, 1e-11);
    EXPECT_NEAR(other->accuracies[0].auc_trapezoid, tum.accuracies[0].auc_trapezoid, 1e-12);
  }
}

TEST_F(EvaluatePosesTest, InvertedPosesAreNoticed) {
  std::vector<Rigid3d> inverted = estimate_;
  for (Rigid3d& pose : inverted) pose = Inverse(pose);
  ExpectMended(TumText(inverted), "--invert_poses", {.invert_poses = true});
  ExpectMended(KittiText(inverted), "--invert_poses", {.invert_poses = true});
}

TEST_F(EvaluatePosesTest, OpenGlAxesAreNoticed) {
  std::vector<Rigid3d> opengl = estimate_;
  const Rigid3d turn = {RotationAboutAxis({1, 0, 0}, 180.0), {0, 0, 0}};
  for (Rigid3d& pose : opengl) pose = turn * pose;
  ExpectMended(TumText(opengl), "--opengl_axes", {.opengl_axes = true});
}

TEST_F(EvaluatePosesTest, TheOrderOfQuaternionsIsNoticed) {
  std::string text;
  for (size_t i = 0; i < estimate_.size(); ++i) {
    const auto [q, t] = Inverse(estimate_[i]);
    text += NameOf(i) + Numbers({t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()}) + "\n";
  }
  ExpectMended(text, "--swap_quaternion_order", {.swap_quaternion_order = true});
}

TEST_F(EvaluatePosesTest, RepairsOfWhatIsRightAreNoticed) {
  const ConventionRepair wrong = {.invert_poses = true, .swap_quaternion_order = true};
  EXPECT_THAT(Evaluate(TumText(estimate_), {.repair = wrong}).warnings,
              ElementsAre(HasSubstr("read without the repairs asked for they")));
}

TEST_F(EvaluatePosesTest, ShuffledNamesAreNoticed) {
  std::vector<Rigid3d> shuffled = estimate_;
  std::rotate(shuffled.begin(), shuffled.begin() + 5, shuffled.end());
  EXPECT_THAT(Evaluate(TumText(shuffled)).warnings,
              ElementsAre(HasSubstr("names of 12 poses seem to be shuffled")));
}

TEST_F(EvaluatePosesTest, MissingViewsAreNamedAndCountIfAskedFor) {
  std::vector<Rigid3d> some(estimate_.begin(), estimate_.begin() + 9);
  const PoseEvaluation evaluation = Evaluate(TumText(some) + "stranger 0 0 0 0 0 0 1\n");
  EXPECT_THAT(evaluation.comparison.missing, ElementsAre(NameOf(9), NameOf(10), NameOf(11)));
  EXPECT_EQ(evaluation.num_reference, 12u);
  EXPECT_EQ(evaluation.num_surplus, 1u);
  EXPECT_EQ(evaluation.accuracies[3].rotation, 1.0);
  const PoseEvaluation strict = Evaluate(TumText(some), {.count_missing = true});
  EXPECT_EQ(strict.num_wrong_pairs, 66u - 36u);
  EXPECT_EQ(strict.accuracies[3].rotation, 36.0 / 66.0);
}

TEST_F(EvaluatePosesTest, TooFewViewsAreAnErrorThatSaysWhatIsNeeded) {
  const std::vector<Rigid3d> two(estimate_.begin(), estimate_.begin() + 2);
  const std::string message = ErrorOf([&] { Evaluate(TumText(two)); });
  EXPECT_THAT(message, HasSubstr("shares 2 views"));
  EXPECT_THAT(message, HasSubstr("--alignment first or none"));
  EXPECT_EQ(Evaluate(TumText(two), {.alignment = {.type = PoseAlignment::kFirstCamera}})
                .comparison.views.size(),
            2u);
}

}  // namespace
}  // namespace vgtw
