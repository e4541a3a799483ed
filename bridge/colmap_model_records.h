// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace vgtw {

// What binary and text models share: the checks of each record as it enters the reconstruction.

// Where a record stands; `line` is 0 in binary files.
struct RecordSource {
  const std::filesystem::path& path;
  size_t line = 0;

  [[noreturn]] void Fail(const std::string& found,
                         std::string_view expected,
                         std::string_view hint = {}) const;
};

// Throw Error for a model that this project does not know.
const CameraModelInfo& FindModelOrFail(const RecordSource& source, int model_id);
const CameraModelInfo& FindModelOrFail(const RecordSource& source, std::string_view name);

// qw qx qy qz tx ty tz as in files. Poses without a fault (see FindFault) keep their bits;
// rotations whose norm is off by up to 1 % (text with few digits) are normalised.
using PoseValues = std::array<double, 7>;
Rigid3d PoseFromValues(const RecordSource& source, const std::string& owner, const PoseValues&);
PoseValues ValuesFromPose(const Rigid3d& pose);

// Each throws Error if the record is invalid by itself or its id was there before.
void AddCamera(const RecordSource& source, Camera camera, std::map<CameraId, Camera>& cameras);
void AddImage(const RecordSource& source, Image image, std::map<ImageId, Image>& images);
void AddPoint3D(const RecordSource& source,
                Point3DId point3D_id,
                Point3D point,
                std::map<Point3DId, Point3D>& points3D);
void AddRig(const RecordSource& source, Rig rig, std::map<RigId, Rig>& rigs);
void AddFrame(const RecordSource& source, Frame frame, std::map<FrameId, Frame>& frames);

}  // namespace vgtw
