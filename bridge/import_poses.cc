// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_poses.h"

namespace vgtw {
namespace {

Eigen::Quaterniond SwapOrder(const Eigen::Quaterniond& read, RotationForm form) {
  switch (form) {
    case RotationForm::kQuaternionWxyz:  // numbers (w, x, y, z) mean (x, y, z, w)
      return {read.z(), read.w(), read.x(), read.y()};
    case RotationForm::kQuaternionXyzw:  // numbers (x, y, z, w) mean (w, x, y, z)
      return {read.x(), read.y(), read.z(), read.w()};
    case RotationForm::kMatrix:
      break;
  }
  return read;
}

}  // namespace

Rigid3d CamFromWorld(const FilePose& pose, const ConventionRepair& repair) {
  Rigid3d transform = pose.transform;
  if (repair.swap_quaternion_order) {
    transform.rotation = SwapOrder(transform.rotation, pose.form);
  }
  const bool is_world_from_cam = pose.is_world_from_cam != repair.invert_poses;
  if (is_world_from_cam) transform = Inverse(transform);
  if (!repair.opengl_axes) return transform;
  // Half a turn around x.
  const Rigid3d opencv_from_opengl = {Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0),
                                      Eigen::Vector3d::Zero()};
  return opencv_from_opengl * transform;
}

std::string OptionsText(const ConventionRepair& repair) {
  std::string text;
  const auto add = [&](bool is_set, const char* option) {
    if (is_set) text += (text.empty() ? "" : " ") + std::string(option);
  };
  add(repair.invert_poses, "--invert_poses");
  add(repair.opengl_axes, "--opengl_axes");
  add(repair.swap_quaternion_order, "--swap_quaternion_order");
  return text;
}

}  // namespace vgtw
