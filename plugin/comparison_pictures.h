// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/comparison.h"

namespace vgtw {

// Adds to CompareModels' object what report.html shows besides (plugin/report_page.h):
//   views [].thumbnail, .overlay: data URLs of JPEGs, or null where the photo is missing; the
//     overlay shows what masks exclude and the features that the last model uses
//   scene {up, centre, radius, models [{cameras [{view, centre, rotation_wxyz, fov_x_deg,
//     fov_y_deg}], points {count, min, step, xyz, rgb}}]}: all in the world of the reference, or of
//     the first model; rotation_wxyz is world_from_cam; x = min + step * q with q little-endian
//     uint16 [count, 3] and rgb uint8 [count, 3], both in base64
//   and the reference, if there is one, as a last model of role "reference" that has only cameras.
// Throws Error if a photo or mask is damaged.
void AddPictures(const ComparisonInputs& inputs,
                 nlohmann::json& comparison,
                 const ProgressCallback& progress = {});

// Writes report.html of CompareModels' object, with pictures.
void WriteComparisonPage(const std::filesystem::path& path,
                         const ComparisonInputs& inputs,
                         nlohmann::json comparison);

}  // namespace vgtw
