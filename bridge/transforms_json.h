// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// A frame of transforms.json (NeRF's Blender scenes, instant-ngp, nerfstudio).
struct TransformsFrame {
  std::string name;  // "file_path" without a leading "./"; Blender's have no extension
  // With our camera axes: the file's cameras look along -z with y up (OpenGL).
  Rigid3d world_from_cam;
};

// Reads "frames"[]."file_path" and "transform_matrix" (4x4 or 3x4, world_from_cam) in their order;
// the world is the file's ("applied_transform" of nerfstudio is not undone).
// Throws Error if the text is no JSON, lacks these, or a matrix is no rigid motion within 1 %.
// `origin` names the file in messages.
std::vector<TransformsFrame> ParseTransformsJson(std::string_view text, const std::string& origin);

}  // namespace vgtw
