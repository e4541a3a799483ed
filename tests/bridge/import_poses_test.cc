// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_poses.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Half a unit in each number: rounding errors stay below 1e-15.
constexpr double kTolerance = 1e-12;

void ExpectSame(const Rigid3d& a, const Rigid3d& b) {
  EXPECT_LT((a.ToMatrix() - b.ToMatrix()).cwiseAbs().maxCoeff(), kTolerance);
}

Rigid3d Sample() {
  return {Eigen::Quaterniond(0.1, -0.5, 0.7, 0.3).normalized(), Eigen::Vector3d(1, -2, 3)};
}

TEST(CamFromWorld, ReadsBothDirections) {
  ExpectSame(CamFromWorld({Sample(), false, RotationForm::kMatrix}, {}), Sample());
  ExpectSame(CamFromWorld({Sample(), true, RotationForm::kMatrix}, {}), Inverse(Sample()));
}

TEST(CamFromWorld, InvertPosesMendsTheWrongDirection) {
  const ConventionRepair repair = {.invert_poses = true};
  ExpectSame(CamFromWorld({Inverse(Sample()), false, RotationForm::kMatrix}, repair), Sample());
  ExpectSame(CamFromWorld({Sample(), true, RotationForm::kMatrix}, repair), Sample());
}

TEST(CamFromWorld, OpenglAxesTurnAroundX) {
  // A point one unit ahead of, and two above, an OpenGL camera has (0, 2, -1) there, (0, -2, 1)
  // here.
  const FilePose opengl = {Rigid3d{}, false, RotationForm::kMatrix};
  const Rigid3d cam_from_world = CamFromWorld(opengl, {.opengl_axes = true});
  EXPECT_LT((cam_from_world * Eigen::Vector3d(0, 2, -1) - Eigen::Vector3d(0, -2, 1)).norm(),
            kTolerance);
}

TEST(CamFromWorld, SwapsTheOrderThatTheFormatPrescribes) {
  const Eigen::Quaterniond& truth = Sample().rotation;
  // Numbers x y z w where w x y z were due are read as w=x, x=y, y=z, z=w.
  const Rigid3d read_wxyz = {{truth.x(), truth.y(), truth.z(), truth.w()}, Sample().translation};
  // Numbers w x y z where x y z w were due are read as x=w, y=x, z=y, w=z.
  const Rigid3d read_xyzw = {{truth.z(), truth.w(), truth.x(), truth.y()}, Sample().translation};
  const ConventionRepair repair = {.swap_quaternion_order = true};
  ExpectSame(CamFromWorld({read_wxyz, false, RotationForm::kQuaternionWxyz}, repair), Sample());
  ExpectSame(CamFromWorld({read_xyzw, false, RotationForm::kQuaternionXyzw}, repair), Sample());
}

TEST(CamFromWorld, MendsAllMistakesAtOnce) {
  const Rigid3d opengl_from_opencv = {Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()};
  const Rigid3d written = Inverse(opengl_from_opencv * Sample());
  const Eigen::Quaterniond& q = written.rotation;
  const Rigid3d read = {{q.x(), q.y(), q.z(), q.w()}, written.translation};
  ExpectSame(CamFromWorld({read, false, RotationForm::kQuaternionWxyz}, {true, true, true}),
             Sample());
}

TEST(OptionsText, NamesTheOptions) {
  EXPECT_EQ(OptionsText({}), "");
  EXPECT_EQ(OptionsText({true, false, true}), "--invert_poses --swap_quaternion_order");
}

}  // namespace
}  // namespace vgtw
