// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/pose_readings.h"

#include "bridge/import_poses.h"

#include <algorithm>
#include <utility>

namespace vgtw {
namespace {

struct Misreading {
  ConventionRepair repair;
  bool is_world_from_cam;
  RotationForm form;

  int NumMistakes() const {
    return int{repair.invert_poses} + int{repair.opengl_axes} + int{repair.swap_quaternion_order};
  }
};

std::vector<Misreading> Misreadings() {
  std::vector<Misreading> misreadings;
  for (const bool invert : {false, true}) {
    for (const bool opengl : {false, true}) {
      if (invert || opengl) {
        misreadings.push_back({{invert, opengl, false}, false, RotationForm::kMatrix});
      }
      for (const bool is_world_from_cam : {false, true}) {
        for (const RotationForm form :
             {RotationForm::kQuaternionWxyz, RotationForm::kQuaternionXyzw}) {
          misreadings.push_back({{invert, opengl, true}, is_world_from_cam, form});
        }
      }
    }
  }
  std::stable_sort(misreadings.begin(), misreadings.end(), [](const auto& a, const auto& b) {
    return a.NumMistakes() < b.NumMistakes();
  });
  return misreadings;
}

// A repair that is made twice is undone.
ConventionRepair Toggled(const ConventionRepair& a, const ConventionRepair& b) {
  return {a.invert_poses != b.invert_poses,
          a.opengl_axes != b.opengl_axes,
          a.swap_quaternion_order != b.swap_quaternion_order};
}

}  // namespace

std::vector<PoseReading> OtherReadings(const std::vector<NamedPose>& poses,
                                       const ConventionRepair& as_read) {
  std::vector<PoseReading> readings;
  for (const Misreading& misreading : Misreadings()) {
    PoseReading reading;
    reading.options = OptionsText(Toggled(misreading.repair, as_read));
    for (const NamedPose& pose : poses) {
      const Rigid3d as_stored =
          misreading.is_world_from_cam ? Inverse(pose.cam_from_world) : pose.cam_from_world;
      reading.poses.push_back(
          {pose.name,
           CamFromWorld({as_stored, misreading.is_world_from_cam, misreading.form},
                        misreading.repair)});
    }
    readings.push_back(std::move(reading));
  }
  return readings;
}

}  // namespace vgtw
