// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"
#include "scene/prediction.h"
#include "scene/view.h"

#include <optional>

#include <Eigen/Core>

namespace vgtw {

// What networks say in their own pixels, brought to those of the photo. Both are continuous: value
// [y, x] of a map belongs to the centre (x + 0.5, y + 0.5), and a centred lens has cx = W / 2.

// Intrinsics in network pixels as an exact PINHOLE of the original ones:
//   pixel_in_original = original_from_network * K * ray.
// nullopt if K is not finite, has skew or a wrong last row, or a focal length <= 0.
std::optional<Camera> CameraFromNetwork(const Eigen::Matrix3d& network_intrinsics,
                                        const NetworkGeometry& geometry,
                                        const ImageSize& photo_size);

// Whether the centre of a network pixel lies on the photo (bars and padding do not).
bool IsOnPhoto(const NetworkGeometry& geometry, const ImageSize& size, int x, int y);

// Makes all maps unknown where they are not on the photo. `prediction.view` must be complete.
void ForgetBars(ViewPrediction& prediction);

}  // namespace vgtw
