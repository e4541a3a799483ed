// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/rigid3d.h"

#include <string>

#include <Eigen/Core>

namespace vgtw {

// b_from_a of pixels:  pixel_in_b = m.leftCols<2>() * pixel_in_a + m.col(2).
// Both sides use continuous pixels (corner (0,0), first centre (0.5, 0.5)), so that a plain resize
// is a pure scale without offsets.
using PixelMap = Eigen::Matrix<double, 2, 3>;

PixelMap IdentityPixelMap();
PixelMap Inverse(const PixelMap& b_from_a);
Eigen::Vector2d Apply(const PixelMap& b_from_a, const Eigen::Vector2d& pixel_in_a);

// How a network's loader turned an original image into its input.
enum class ResizePolicy {
  kStretch,  // resized to the network size, aspect not kept (pi3)
  kCrop,     // width to `network_width`, height rounded to a multiple of 14, centre rows kept if
             // that exceeds `network_width` (VGGT's and VGTW's loader, 518)
  kPad,  // longest side to `network_width`, the other rounded to a multiple of 14, white bars to
         // a square (VGGT's loader)
  kSquarePad  // centred on a black square of the longest side, then resized (VGGT's demo_colmap)
};

struct NetworkGeometry {
  int network_width = 0;
  int network_height = 0;
  PixelMap original_from_network = IdentityPixelMap();
};

// The exact map of one of these policies. `network_width` is the loader's target (518 by default);
// `network_height` is used by kStretch only. Where a batch was padded to a common larger size
// (images of different shapes), use PadGeometry afterwards.
// Source: VGGT's and pi3's loaders as specified by their authors; Python's round() (half to even).
NetworkGeometry MakeNetworkGeometry(ResizePolicy policy,
                                    uint64_t original_width,
                                    uint64_t original_height,
                                    int network_width,
                                    int network_height);

// The same geometry inside a centred, larger canvas (padding split floor/ceil as the loader does).
NetworkGeometry PadGeometry(const NetworkGeometry& geometry, int network_width, int network_height);

// One photo with its camera. `name` is the relative path with '/', as in COLMAP's database.
struct View {
  std::string name;
  Camera camera;  // original pixels (the file as stored, EXIF orientation not applied)
  Rigid3d cam_from_world;
  int network_width = 0;  // size of the per-pixel maps; 0 where there are none
  int network_height = 0;
  PixelMap original_from_network = IdentityPixelMap();
};

// The camera of the network's pixels: a pinhole `network_camera` such that projecting into it and
// mapping to original pixels equals projecting into `view.camera`. Law holds for PINHOLE and
// SIMPLE_PINHOLE and axis-aligned maps; std::invalid_argument otherwise.
Camera NetworkCamera(const View& view);

}  // namespace vgtw
