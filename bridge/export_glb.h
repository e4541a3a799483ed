// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/surface_cloud.h"
#include "scene/view.h"

#include <filesystem>
#include <vector>

namespace vgtw {

// Whether this was built with tinygltf (Debian's libtinygltf-dev), which WriteGlb needs.
bool CanWriteGlb();

// Points and cameras as binary glTF 2.0, which browsers, Blender and MeshLab open. A node "points"
// has them as mode POINTS, without lighting, their colours in linear light, as glTF wants them; a
// node per view has its name, the pose of its camera (which in glTF looks along -z, y up) and its
// angles of view. glTF has no words for principal points, distortion, and normals or scalars of
// points that are unknown: these are left out. World coordinates stay as they are, below a node
// "world" that turns them by half a turn about x, because glTF's y is up and that of the first
// camera, which is the world of most predictions, is down.
// Throws Error if this was built without tinygltf or the file would exceed glTF's 4 GiB.
void WriteGlb(const std::filesystem::path& path,
              const SurfaceCloud& cloud,
              const std::vector<View>& views);

}  // namespace vgtw
