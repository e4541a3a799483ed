// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model_records.h"

#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

namespace vgtw {
namespace {

constexpr char kKnownModels[] = "a camera model of COLMAP 3.8 (ids 0 to 10)";
constexpr char kModelHint[] = "convert the model with colmap image_undistorter or model_converter";

template <typename Id, typename Record>
void AddUnique(const RecordSource& source,
               const char* kind,
               Id id,
               Record record,
               std::map<Id, Record>& records) {
  // Files are mostly sorted, so that the hint makes insertion constant-time.
  const size_t num_before = records.size();
  records.emplace_hint(records.end(), id, std::move(record));
  if (records.size() == num_before) {
    source.Fail(std::string("holds ") + kind + " " + std::to_string(id) + " twice", "each id once");
  }
}

}  // namespace

void RecordSource::Fail(const std::string& found,
                        std::string_view expected,
                        std::string_view hint) const {
  const std::string where = line == 0 ? "" : "line " + std::to_string(line) + " ";
  vgtw::Fail(path, where + found, expected, hint);
}

const CameraModelInfo& FindModelOrFail(const RecordSource& source, int model_id) {
  const auto model = FindCameraModel(model_id);
  if (!model) {
    source.Fail("has a camera of model " + std::to_string(model_id), kKnownModels, kModelHint);
  }
  return GetCameraModelInfo(*model);
}

const CameraModelInfo& FindModelOrFail(const RecordSource& source, std::string_view name) {
  const auto model = FindCameraModel(name);
  if (!model) source.Fail("has a camera of model " + Printable(name), kKnownModels, kModelHint);
  return GetCameraModelInfo(*model);
}

Rigid3d PoseFromValues(const RecordSource& source,
                       const std::string& owner,
                       const PoseValues& values) {
  constexpr double kMaxDeviation = 0.01;
  const auto is_finite = [](double value) { return std::isfinite(value); };
  if (!std::all_of(values.begin(), values.end(), is_finite)) {
    source.Fail("has a pose of " + owner + " that is not finite", "finite numbers");
  }
  Rigid3d pose;
  pose.rotation = Eigen::Quaterniond(values[0], values[1], values[2], values[3]);
  pose.translation = Eigen::Vector3d(values[4], values[5], values[6]);
  const double norm = pose.rotation.norm();
  if (!(std::abs(norm - 1.0) <= kMaxDeviation)) {
    source.Fail("has a rotation of " + owner + " of norm " + std::to_string(norm),
                "a unit quaternion qw qx qy qz");
  }
  if (!FindFault(pose).empty()) pose.rotation.normalize();
  return pose;
}

PoseValues ValuesFromPose(const Rigid3d& pose) {
  const auto& [q, t] = pose;
  return {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
}

void AddCamera(const RecordSource& source, Camera camera, std::map<CameraId, Camera>& cameras) {
  const std::string fault = FindFault(camera);
  const CameraId id = camera.camera_id;
  if (!fault.empty()) {
    source.Fail("has a wrong camera " + std::to_string(id) + " (" + fault + ")", "a usable one");
  }
  AddUnique(source, "camera", id, std::move(camera), cameras);
}

void AddImage(const RecordSource& source, Image image, std::map<ImageId, Image>& images) {
  const ImageId id = image.image_id;
  if (!IsSafeRelativeName(image.name)) {
    source.Fail("names image " + std::to_string(id) + " '" + Printable(image.name) + "'",
                "a relative path inside the image folder");
  }
  for (const Point2D& point2D : image.points2D) {
    if (!point2D.xy.allFinite()) {
      source.Fail("has a point2D of image " + std::to_string(id) + " that is not finite", "pixels");
    }
  }
  AddUnique(source, "image", id, std::move(image), images);
}

void AddPoint3D(const RecordSource& source,
                Point3DId id,
                Point3D point,
                std::map<Point3DId, Point3D>& points3D) {
  if (id == kInvalidPoint3DId) source.Fail("has a point3D with the id -1", "ids from 0");
  if (!point.xyz.allFinite()) {
    source.Fail("has a point3D " + std::to_string(id) + " that is not finite",
                "finite coordinates");
  }
  AddUnique(source, "point3D", id, std::move(point), points3D);
}

void AddRig(const RecordSource& source, Rig rig, std::map<RigId, Rig>& rigs) {
  const RigId id = rig.rig_id;
  if (rig.sensor_from_rig.contains(rig.reference)) {
    source.Fail("names the reference sensor of rig " + std::to_string(id) + " twice", "each once");
  }
  AddUnique(source, "rig", id, std::move(rig), rigs);
}

void AddFrame(const RecordSource& source, Frame frame, std::map<FrameId, Frame>& frames) {
  const FrameId id = frame.frame_id;
  AddUnique(source, "frame", id, std::move(frame), frames);
}

}  // namespace vgtw
