// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/view.h"

#include <string>
#include <vector>

namespace vgtw {

// Cameras in other systems' words. Poses come back bit-equal or, where a format has matrices for
// quaternions, within rounding by bridge/{trajectory_text,transforms_json}.h.

enum class TrajectoryLabel { kLine, kImageName };

// TUM RGB-D, a view a line: label tx ty tz qx qy qz qw of world_from_cam. Labels are what others
// take for timestamps: "0", "1", ..., or the images' names.
std::string TumTrajectory(const std::vector<View>& views, TrajectoryLabel label);

// KITTI odometry, a view a line: the 3x4 matrix of world_from_cam, row by row.
std::string KittiTrajectory(const std::vector<View>& views);

// transforms.json of nerfstudio: camera_model, fl_x fl_y cx cy (COLMAP's pixels, as its own
// converter writes them), w h and distortion per frame; file_path = `image_folder`/<image name>;
// transform_matrix = world_from_cam with OpenGL axes (x right, y up, z back). The world stays as it
// is. Throws Error for camera models that nerfstudio has no word for.
std::string TransformsJson(const std::vector<View>& views, const std::string& image_folder);

}  // namespace vgtw
