// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model_binary.h"

#include "bridge/byte_reader.h"
#include "bridge/colmap_model_records.h"
#include "scene/files.h"

#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

namespace vgtw {
namespace {

// Smallest records: a count that needs more than the file has is refused before allocation.
constexpr size_t kMinCameraBytes = 4 + 4 + 8 + 8 + 3 * 8;
constexpr size_t kMinImageBytes = 4 + 7 * 8 + 4 + 1 + 8;
constexpr size_t kPoint2DBytes = 8 + 8 + 8;
constexpr size_t kMinPoint3DBytes = 8 + 3 * 8 + 3 + 8 + 8;
constexpr size_t kTrackElementBytes = 4 + 4;
constexpr size_t kMinRigBytes = 4 + 4;
constexpr size_t kMinSensorBytes = 4 + 4 + 1;
constexpr size_t kMinFrameBytes = 4 + 4 + 7 * 8 + 4;
constexpr size_t kFrameDataBytes = 4 + 4 + 8;

Eigen::Vector3d ReadVector3(ByteReader& reader) {
  Eigen::Vector3d vector;
  for (double& value : vector) value = reader.Read<double>();
  return vector;
}

Rigid3d ReadPose(ByteReader& reader, const RecordSource& source, const std::string& owner) {
  PoseValues values;
  for (double& value : values) value = reader.Read<double>();
  return PoseFromValues(source, owner, values);
}

SensorId ReadSensorId(ByteReader& reader) {
  const auto type = reader.Read<int32_t>();
  return {type, reader.Read<uint32_t>()};
}

Image ReadImage(ByteReader& reader, const RecordSource& source) {
  Image image;
  image.image_id = reader.Read<uint32_t>();
  image.cam_from_world = ReadPose(reader, source, "image " + std::to_string(image.image_id));
  image.camera_id = reader.Read<uint32_t>();
  image.name = reader.ReadCString();
  image.points2D.resize(reader.ReadCount<uint64_t>(kPoint2DBytes));
  for (Point2D& point2D : image.points2D) {
    point2D.xy.x() = reader.Read<double>();
    point2D.xy.y() = reader.Read<double>();
    point2D.point3D_id = reader.Read<uint64_t>();
  }
  return image;
}

Point3D ReadPoint3D(ByteReader& reader) {
  Point3D point;
  point.xyz = ReadVector3(reader);
  for (uint8_t& channel : point.rgb) channel = reader.Read<uint8_t>();
  point.error = reader.Read<double>();
  point.track.resize(reader.ReadCount<uint64_t>(kTrackElementBytes));
  for (TrackElement& element : point.track) {
    element.image_id = reader.Read<uint32_t>();
    element.point2D_idx = reader.Read<uint32_t>();
  }
  return point;
}

Rig ReadRig(ByteReader& reader, const RecordSource& source) {
  Rig rig;
  rig.rig_id = reader.Read<uint32_t>();
  const std::string owner = "rig " + std::to_string(rig.rig_id);
  // The reference has no flag of a pose, hence the smaller record.
  const size_t num_sensors = reader.ReadCount<uint32_t>(kMinSensorBytes - 1);
  if (num_sensors == 0) source.Fail("has no sensor in " + owner, "at least the reference");
  rig.reference = ReadSensorId(reader);
  for (size_t i = 1; i < num_sensors; ++i) {
    const SensorId sensor = ReadSensorId(reader);
    std::optional<Rigid3d> sensor_from_rig;
    if (reader.Read<uint8_t>() != 0) sensor_from_rig = ReadPose(reader, source, owner);
    if (!rig.sensor_from_rig.emplace(sensor, sensor_from_rig).second) {
      source.Fail("names a sensor of " + owner + " twice", "each once");
    }
  }
  return rig;
}

Frame ReadFrame(ByteReader& reader, const RecordSource& source) {
  Frame frame;
  frame.frame_id = reader.Read<uint32_t>();
  frame.rig_id = reader.Read<uint32_t>();
  frame.rig_from_world = ReadPose(reader, source, "frame " + std::to_string(frame.frame_id));
  frame.data.resize(reader.ReadCount<uint32_t>(kFrameDataBytes));
  for (FrameData& data : frame.data) {
    data.sensor = ReadSensorId(reader);
    data.data_id = reader.Read<uint64_t>();
  }
  return frame;
}

template <typename T>
requires std::is_arithmetic_v<T>
void Put(AtomicFile& file, T value) { file.Write(std::as_bytes(std::span(&value, 1))); }

void PutPose(AtomicFile& file, const Rigid3d& pose) {
  for (const double value : ValuesFromPose(pose)) Put(file, value);
}

void PutSensorId(AtomicFile& file, const SensorId& sensor) {
  Put<int32_t>(file, sensor.type);
  Put<uint32_t>(file, sensor.id);
}

}  // namespace

void ParseCamerasBinary(std::span<const std::byte> bytes,
                        const std::filesystem::path& path,
                        Reconstruction& reconstruction) {
  const RecordSource source{path};
  ByteReader reader(bytes, path);
  const size_t num_cameras = reader.ReadCount<uint64_t>(kMinCameraBytes);
  for (size_t i = 0; i < num_cameras; ++i) {
    Camera camera;
    camera.camera_id = reader.Read<uint32_t>();
    const CameraModelInfo& info = FindModelOrFail(source, reader.Read<int32_t>());
    camera.model = info.model;
    camera.width = reader.Read<uint64_t>();
    camera.height = reader.Read<uint64_t>();
    camera.params.resize(static_cast<size_t>(info.num_params));
    for (double& param : camera.params) param = reader.Read<double>();
    AddCamera(source, std::move(camera), reconstruction.cameras);
  }
  reader.ExpectEnd();
}

void ParseImagesBinary(std::span<const std::byte> bytes,
                       const std::filesystem::path& path,
                       Reconstruction& reconstruction) {
  const RecordSource source{path};
  ByteReader reader(bytes, path);
  const size_t num_images = reader.ReadCount<uint64_t>(kMinImageBytes);
  for (size_t i = 0; i < num_images; ++i) {
    AddImage(source, ReadImage(reader, source), reconstruction.images);
  }
  reader.ExpectEnd();
}

void ParsePoints3DBinary(std::span<const std::byte> bytes,
                         const std::filesystem::path& path,
                         Reconstruction& reconstruction) {
  const RecordSource source{path};
  ByteReader reader(bytes, path);
  const size_t num_points3D = reader.ReadCount<uint64_t>(kMinPoint3DBytes);
  for (size_t i = 0; i < num_points3D; ++i) {
    const auto point3D_id = reader.Read<uint64_t>();
    AddPoint3D(source, point3D_id, ReadPoint3D(reader), reconstruction.points3D);
  }
  reader.ExpectEnd();
}

void ParseRigsBinary(std::span<const std::byte> bytes,
                     const std::filesystem::path& path,
                     Reconstruction& reconstruction) {
  const RecordSource source{path};
  ByteReader reader(bytes, path);
  const size_t num_rigs = reader.ReadCount<uint64_t>(kMinRigBytes);
  for (size_t i = 0; i < num_rigs; ++i) {
    AddRig(source, ReadRig(reader, source), reconstruction.rigs);
  }
  reader.ExpectEnd();
}

void ParseFramesBinary(std::span<const std::byte> bytes,
                       const std::filesystem::path& path,
                       Reconstruction& reconstruction) {
  const RecordSource source{path};
  ByteReader reader(bytes, path);
  const size_t num_frames = reader.ReadCount<uint64_t>(kMinFrameBytes);
  for (size_t i = 0; i < num_frames; ++i) {
    AddFrame(source, ReadFrame(reader, source), reconstruction.frames);
  }
  reader.ExpectEnd();
}

void WriteCamerasBinary(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  AtomicFile file(path);
  Put<uint64_t>(file, reconstruction.cameras.size());
  for (const auto& [camera_id, camera] : reconstruction.cameras) {
    Put<uint32_t>(file, camera_id);
    Put<int32_t>(file, static_cast<int32_t>(camera.model));
    Put<uint64_t>(file, camera.width);
    Put<uint64_t>(file, camera.height);
    for (const double param : camera.params) Put(file, param);
  }
  file.Commit();
}

void WriteImagesBinary(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  AtomicFile file(path);
  Put<uint64_t>(file, reconstruction.images.size());
  for (const auto& [image_id, image] : reconstruction.images) {
    Put<uint32_t>(file, image_id);
    PutPose(file, image.cam_from_world);
    Put<uint32_t>(file, image.camera_id);
    file.Write(std::string_view(image.name.c_str(), image.name.size() + 1));
    Put<uint64_t>(file, image.points2D.size());
    for (const Point2D& point2D : image.points2D) {
      Put(file, point2D.xy.x());
      Put(file, point2D.xy.y());
      Put<uint64_t>(file, point2D.point3D_id);
    }
  }
  file.Commit();
}

void WritePoints3DBinary(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  AtomicFile file(path);
  Put<uint64_t>(file, reconstruction.points3D.size());
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    Put<uint64_t>(file, point3D_id);
    for (const double value : point.xyz) Put(file, value);
    for (const uint8_t channel : point.rgb) Put(file, channel);
    Put(file, point.error);
    Put<uint64_t>(file, point.track.size());
    for (const TrackElement& element : point.track) {
      Put<uint32_t>(file, element.image_id);
      Put<uint32_t>(file, element.point2D_idx);
    }
  }
  file.Commit();
}

void WriteRigsBinary(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  AtomicFile file(path);
  Put<uint64_t>(file, reconstruction.rigs.size());
  for (const auto& [rig_id, rig] : reconstruction.rigs) {
    Put<uint32_t>(file, rig_id);
    Put<uint32_t>(file, static_cast<uint32_t>(1 + rig.sensor_from_rig.size()));
    PutSensorId(file, rig.reference);
    for (const auto& [sensor, sensor_from_rig] : rig.sensor_from_rig) {
      PutSensorId(file, sensor);
      Put<uint8_t>(file, sensor_from_rig.has_value());
      if (sensor_from_rig) PutPose(file, *sensor_from_rig);
    }
  }
  file.Commit();
}

void WriteFramesBinary(const Reconstruction& reconstruction, const std::filesystem::path& path) {
  AtomicFile file(path);
  Put<uint64_t>(file, reconstruction.frames.size());
  for (const auto& [frame_id, frame] : reconstruction.frames) {
    Put<uint32_t>(file, frame_id);
    Put<uint32_t>(file, frame.rig_id);
    PutPose(file, frame.rig_from_world);
    Put<uint32_t>(file, static_cast<uint32_t>(frame.data.size()));
    for (const FrameData& data : frame.data) {
      PutSensorId(file, data.sensor);
      Put<uint64_t>(file, data.data_id);
    }
  }
  file.Commit();
}

}  // namespace vgtw
