// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/pose_readings.h"

#include "bridge/import_poses.h"
#include "scene/random.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

bool AreEqual(const Rigid3d& a, const Rigid3d& b) {
  return AngleBetweenDeg(a.rotation, b.rotation) < 1e-9 &&
         (a.translation - b.translation).norm() < 1e-9;
}

// Whether one of the readings with these options gives the true pose back.
bool Mends(const Rigid3d& misread, const Rigid3d& truth, const std::string& options) {
  const std::vector<PoseReading> readings = OtherReadings({{"a", misread}});
  return std::any_of(readings.begin(), readings.end(), [&](const PoseReading& reading) {
    return reading.options == options && AreEqual(reading.poses.at(0).cam_from_world, truth);
  });
}

TEST(OtherReadings, UndoEveryMistakeOfEveryForm) {
  RandomStream random(4);
  for (const bool is_world_from_cam : {false, true}) {
    for (const RotationForm form :
         {RotationForm::kMatrix, RotationForm::kQuaternionWxyz, RotationForm::kQuaternionXyzw}) {
      for (int mistakes = 1; mistakes < 8; ++mistakes) {
        const ConventionRepair repair = {
            (mistakes & 1) != 0, (mistakes & 2) != 0, (mistakes & 4) != 0};
        if (repair.swap_quaternion_order && form == RotationForm::kMatrix) continue;
        const FilePose in_file = {
            {random.Rotation(), random.NormalVector()}, is_world_from_cam, form};
        const Rigid3d misread = CamFromWorld(in_file, {});
        const Rigid3d truth = CamFromWorld(in_file, repair);
        EXPECT_TRUE(Mends(misread, truth, OptionsText(repair)))
            << is_world_from_cam << " " << static_cast<int>(form) << " " << mistakes;
      }
    }
  }
}

TEST(OtherReadings, FewerMistakesComeFirst) {
  const std::vector<PoseReading> readings = OtherReadings({{"a", {}}});
  EXPECT_EQ(readings.front().options.find(' '), std::string::npos);
  EXPECT_EQ(readings.back().options, "--invert_poses --opengl_axes --swap_quaternion_order");
}

}  // namespace
}  // namespace vgtw
