// SPDX-License-Identifier: BSD-3-Clause
#include "scene/reconstruction.h"

#include "scene/error.h"

#include <algorithm>
#include <set>

namespace vgtw {
namespace {

constexpr int32_t kCameraSensor = 0;

// Which points2D of every image are named by a track.
using TrackedPoints2D = std::map<ImageId, std::vector<bool>>;

std::string Naming(std::string_view kind, uint64_t id) {
  return std::string(kind) + " " + std::to_string(id);
}

std::string FindFaultOfCameras(const Reconstruction& reconstruction) {
  for (const auto& [camera_id, camera] : reconstruction.cameras) {
    const std::string name = Naming("camera", camera_id);
    if (camera.camera_id != camera_id) return name + " is filed under another id";
    if (std::string fault = FindFault(camera); !fault.empty()) return name + ": " + fault;
  }
  return {};
}

std::string FindFaultOfImages(const Reconstruction& reconstruction) {
  for (const auto& [image_id, image] : reconstruction.images) {
    const std::string name = Naming("image", image_id);
    if (image.image_id != image_id) return name + " is filed under another id";
    if (!reconstruction.cameras.contains(image.camera_id)) {
      return name + " names the missing " + Naming("camera", image.camera_id);
    }
    if (std::string fault = FindFault(image.cam_from_world); !fault.empty()) {
      return name + ": " + fault;
    }
    for (const Point2D& point2D : image.points2D) {
      if (!point2D.xy.allFinite()) return name + " has a point2D that is not finite";
    }
  }
  return {};
}

// Marks the points2D of one track in `tracked`.
std::string FindFaultOfTrack(const Reconstruction& reconstruction,
                             Point3DId point3D_id,
                             const Point3D& point,
                             TrackedPoints2D& tracked) {
  for (const TrackElement& element : point.track) {
    const auto image = reconstruction.images.find(element.image_id);
    if (image == reconstruction.images.end()) {
      return "the track names the missing " + Naming("image", element.image_id);
    }
    const std::string where =
        Naming("point2D", element.point2D_idx) + " of " + Naming("image", element.image_id);
    const std::vector<Point2D>& points2D = image->second.points2D;
    if (element.point2D_idx >= points2D.size()) return "the track names the missing " + where;
    if (points2D[element.point2D_idx].point3D_id != point3D_id) {
      return "the track names " + where + ", which does not name the point";
    }
    std::vector<bool>& is_tracked = tracked[element.image_id];
    is_tracked.resize(points2D.size());
    if (is_tracked[element.point2D_idx]) return "the track names " + where + " twice";
    is_tracked[element.point2D_idx] = true;
  }
  return {};
}

std::string FindFaultOfPoints3D(const Reconstruction& reconstruction, TrackedPoints2D& tracked) {
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    if (point3D_id == kInvalidPoint3DId) return "a point3D has the invalid id";
    std::string fault;
    if (!point.xyz.allFinite()) fault = "the position is not finite";
    if (fault.empty()) fault = FindFaultOfTrack(reconstruction, point3D_id, point, tracked);
    if (!fault.empty()) return Naming("point3D", point3D_id) + ": " + fault;
  }
  return {};
}

std::string FindUntrackedPoint2D(const Reconstruction& reconstruction,
                                 const TrackedPoints2D& tracked) {
  for (const auto& [image_id, image] : reconstruction.images) {
    const auto is_tracked = tracked.find(image_id);
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      if (!image.points2D[i].HasPoint3D()) continue;
      if (is_tracked != tracked.end() && is_tracked->second[i]) continue;
      return Naming("point2D", i) + " of " + Naming("image", image_id) + " names " +
             Naming("point3D", image.points2D[i].point3D_id) + ", whose track does not name it";
    }
  }
  return {};
}

std::string FindFaultOfRigs(const Reconstruction& reconstruction) {
  for (const auto& [rig_id, rig] : reconstruction.rigs) {
    const std::string name = Naming("rig", rig_id);
    if (rig.rig_id != rig_id) return name + " is filed under another id";
    for (const auto& [sensor, sensor_from_rig] : rig.sensor_from_rig) {
      if (sensor == rig.reference) return name + " names its reference sensor twice";
      if (!sensor_from_rig) continue;
      if (std::string fault = FindFault(*sensor_from_rig); !fault.empty()) {
        return name + ": " + fault;
      }
    }
  }
  return {};
}

bool HasSensor(const Rig& rig, const SensorId& sensor) {
  return sensor == rig.reference || rig.sensor_from_rig.contains(sensor);
}

// The image of that id or nullptr; frames give ids in 64 bits.
const Image* FindImage(const Reconstruction& reconstruction, uint64_t image_id) {
  if (image_id > std::numeric_limits<ImageId>::max()) return nullptr;
  const auto image = reconstruction.images.find(static_cast<ImageId>(image_id));
  return image == reconstruction.images.end() ? nullptr : &image->second;
}

// Adds the images of one frame to `covered`.
std::string FindFaultOfFrame(const Reconstruction& reconstruction,
                             const Frame& frame,
                             std::set<ImageId>& covered) {
  const auto rig = reconstruction.rigs.find(frame.rig_id);
  if (rig == reconstruction.rigs.end()) return "names the missing " + Naming("rig", frame.rig_id);
  if (std::string fault = FindFault(frame.rig_from_world); !fault.empty()) return fault;
  for (const FrameData& data : frame.data) {
    if (!HasSensor(rig->second, data.sensor)) return "names a sensor that its rig lacks";
    if (data.sensor.type != kCameraSensor) continue;
    const std::string image_name = Naming("image", data.data_id);
    const Image* image = FindImage(reconstruction, data.data_id);
    if (image == nullptr) return "names the missing " + image_name;
    if (image->camera_id != data.sensor.id) return image_name + " has another camera";
    if (!covered.insert(image->image_id).second) return image_name + " belongs to two frames";
  }
  return {};
}

std::string FindFaultOfFrames(const Reconstruction& reconstruction) {
  if (reconstruction.rigs.empty() && reconstruction.frames.empty()) return {};
  std::set<ImageId> covered;
  for (const auto& [frame_id, frame] : reconstruction.frames) {
    const std::string name = Naming("frame", frame_id);
    if (frame.frame_id != frame_id) return name + " is filed under another id";
    std::string fault = FindFaultOfFrame(reconstruction, frame, covered);
    if (!fault.empty()) return name + ": " + fault;
  }
  for (const auto& [image_id, image] : reconstruction.images) {
    if (!covered.contains(image_id)) return Naming("image", image_id) + " belongs to no frame";
  }
  return {};
}

// The image that a frame of a single camera holds, or nullptr.
const Image* OnlyImage(const Reconstruction& reconstruction, const Frame& frame) {
  if (frame.data.size() != 1 || frame.data.front().sensor.type != kCameraSensor) return nullptr;
  return FindImage(reconstruction, frame.data.front().data_id);
}

Point3D& FindPoint3D(Reconstruction& reconstruction, Point3DId point3D_id) {
  const auto point = reconstruction.points3D.find(point3D_id);
  VGTW_CHECK(point != reconstruction.points3D.end(), Naming("no point3D", point3D_id));
  return point->second;
}

Point2D& FindPoint2D(Reconstruction& reconstruction, const TrackElement& observation) {
  const auto image = reconstruction.images.find(observation.image_id);
  VGTW_CHECK(image != reconstruction.images.end(), Naming("no image", observation.image_id));
  VGTW_CHECK(observation.point2D_idx < image->second.points2D.size(),
             Naming("no point2D", observation.point2D_idx));
  return image->second.points2D[observation.point2D_idx];
}

}  // namespace

std::string FindFault(const Reconstruction& reconstruction) {
  if (std::string fault = FindFaultOfCameras(reconstruction); !fault.empty()) return fault;
  if (std::string fault = FindFaultOfImages(reconstruction); !fault.empty()) return fault;
  TrackedPoints2D tracked;
  if (std::string fault = FindFaultOfPoints3D(reconstruction, tracked); !fault.empty()) {
    return fault;
  }
  if (std::string fault = FindUntrackedPoint2D(reconstruction, tracked); !fault.empty()) {
    return fault;
  }
  if (std::string fault = FindFaultOfRigs(reconstruction); !fault.empty()) return fault;
  return FindFaultOfFrames(reconstruction);
}

void UpdateFrames(Reconstruction& reconstruction) {
  const bool has_rig_of_many =
      std::any_of(reconstruction.rigs.begin(), reconstruction.rigs.end(), [](const auto& entry) {
        return !entry.second.sensor_from_rig.empty();
      });
  if (has_rig_of_many) {
    reconstruction.rigs.clear();
    reconstruction.frames.clear();
    return;
  }
  std::erase_if(reconstruction.frames, [&](const auto& entry) {
    return OnlyImage(reconstruction, entry.second) == nullptr;
  });
  for (auto& [frame_id, frame] : reconstruction.frames) {
    frame.rig_from_world = OnlyImage(reconstruction, frame)->cam_from_world;
  }
}

void RemovePoint3D(Reconstruction& reconstruction, Point3DId point3D_id) {
  for (const TrackElement& element : FindPoint3D(reconstruction, point3D_id).track) {
    FindPoint2D(reconstruction, element).point3D_id = kInvalidPoint3DId;
  }
  reconstruction.points3D.erase(point3D_id);
}

void RemoveObservation(Reconstruction& reconstruction, const TrackElement& observation) {
  Point2D& point2D = FindPoint2D(reconstruction, observation);
  const Point3DId point3D_id = point2D.point3D_id;
  std::vector<TrackElement>& track = FindPoint3D(reconstruction, point3D_id).track;
  if (track.size() <= 2) {
    RemovePoint3D(reconstruction, point3D_id);
    return;
  }
  std::erase(track, observation);
  point2D.point3D_id = kInvalidPoint3DId;
}

std::map<std::string, Rigid3d> CamFromWorldByName(const Reconstruction& reconstruction) {
  std::map<std::string, Rigid3d> cam_from_world_by_name;
  for (const auto& [image_id, image] : reconstruction.images) {
    cam_from_world_by_name.emplace(image.name, image.cam_from_world);
  }
  return cam_from_world_by_name;
}

}  // namespace vgtw
