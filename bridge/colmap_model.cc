// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"

#include "bridge/colmap_model_binary.h"
#include "bridge/colmap_model_text.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// One of the five files in both formats.
struct FileKind {
  const char* name;
  void (*parse_binary)(std::span<const std::byte>, const fs::path&, Reconstruction&);
  void (*parse_text)(std::string_view, const fs::path&, Reconstruction&);
  void (*write_binary)(const Reconstruction&, const fs::path&);
  void (*write_text)(const Reconstruction&, const fs::path&);
};
constexpr std::array<FileKind, 3> kModelFiles = {{
    {"cameras", ParseCamerasBinary, ParseCamerasText, WriteCamerasBinary, WriteCamerasText},
    {"images", ParseImagesBinary, ParseImagesText, WriteImagesBinary, WriteImagesText},
    {"points3D", ParsePoints3DBinary, ParsePoints3DText, WritePoints3DBinary, WritePoints3DText},
}};
constexpr std::array<FileKind, 2> kRigFiles = {{
    {"rigs", ParseRigsBinary, ParseRigsText, WriteRigsBinary, WriteRigsText},
    {"frames", ParseFramesBinary, ParseFramesText, WriteFramesBinary, WriteFramesText},
}};

fs::path PathOf(const fs::path& folder, const FileKind& kind, ModelFormat format) {
  return folder / (std::string(kind.name) + (format == ModelFormat::kBinary ? ".bin" : ".txt"));
}

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

bool HasModelFiles(const fs::path& folder, ModelFormat format) {
  return std::all_of(kModelFiles.begin(), kModelFiles.end(), [&](const FileKind& kind) {
    return IsFile(PathOf(folder, kind, format));
  });
}

// Why there is no model, with the nearest thing that would be one.
[[noreturn]] void FailWithoutModel(const fs::path& folder) {
  std::error_code ignored;
  std::string found =
      fs::is_directory(folder, ignored) ? "holds no sparse model" : "is not a folder";
  for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
    std::string present;
    std::string missing;
    for (const FileKind& kind : kModelFiles) {
      const fs::path path = PathOf(folder, kind, format);
      (IsFile(path) ? present : missing) = path.filename().string();
    }
    if (!present.empty()) found = "holds " + present + " but no " + missing;
  }
  const bool below = IsModelFolder(folder / "0");
  Fail(folder,
       found,
       "cameras, images and points3D, all .bin or all .txt",
       below ? "name its sub-folder 0, which holds one" : "name the folder that the mapper wrote");
}

void ParseFile(const fs::path& folder,
               const FileKind& kind,
               ModelFormat format,
               Reconstruction& reconstruction) {
  const fs::path path = PathOf(folder, kind, format);
  const MappedFile file(path);
  if (format == ModelFormat::kBinary) {
    kind.parse_binary(file.bytes(), path, reconstruction);
  } else {
    const auto* text = reinterpret_cast<const char*>(file.bytes().data());
    kind.parse_text({text, file.bytes().size()}, path, reconstruction);
  }
}

// Whether rigs.* and frames.* are there; one without the other is an Error.
bool HasRigFiles(const fs::path& folder, ModelFormat format) {
  const bool has_rigs = IsFile(PathOf(folder, kRigFiles[0], format));
  const bool has_frames = IsFile(PathOf(folder, kRigFiles[1], format));
  if (has_rigs != has_frames) {
    Fail(folder,
         has_rigs ? "holds rigs but no frames" : "holds frames but no rigs",
         "both (COLMAP >= 3.12) or none",
         "copy the model again");
  }
  return has_rigs;
}

// sensor_from_rig, the identity for the rig's reference; nullptr if it is unknown.
const Rigid3d* FindSensorFromRig(const Rig& rig, const SensorId& sensor) {
  static const Rigid3d kIdentity;
  if (sensor == rig.reference) return &kIdentity;
  const auto found = rig.sensor_from_rig.find(sensor);
  return found == rig.sensor_from_rig.end() || !found->second ? nullptr : &*found->second;
}

// Calls visit(image, cam_from_world) for every image of every frame. `fail(text)` must throw.
template <typename Model, typename Fail, typename Visit>
void ForEachFrameImage(Model& reconstruction, const Fail& fail, const Visit& visit) {
  constexpr int kCameraSensor = 0;
  for (const auto& [frame_id, frame] : reconstruction.frames) {
    const std::string who = "frame " + std::to_string(frame_id) + " ";
    const auto rig = reconstruction.rigs.find(frame.rig_id);
    if (rig == reconstruction.rigs.end()) fail(who + "has an unknown rig");
    for (const FrameData& data : frame.data) {
      if (data.sensor.type != kCameraSensor) continue;
      const std::string image_id = std::to_string(data.data_id);
      const auto image = data.data_id > std::numeric_limits<ImageId>::max()
                             ? reconstruction.images.end()
                             : reconstruction.images.find(static_cast<ImageId>(data.data_id));
      if (image == reconstruction.images.end()) fail(who + "has the unknown image " + image_id);
      if (image->second.camera_id != data.sensor.id) {
        fail(who + "sees image " + image_id + " with another camera than the image's own");
      }
      const Rigid3d* sensor_from_rig = FindSensorFromRig(rig->second, data.sensor);
      if (sensor_from_rig == nullptr) fail(who + "has no pose of the sensor of image " + image_id);
      // The reference keeps the frame's pose bit by bit.
      visit(image->second,
            data.sensor == rig->second.reference ? frame.rig_from_world
                                                 : *sensor_from_rig * frame.rig_from_world);
    }
  }
}

void TakePosesFromFrames(const fs::path& folder, Reconstruction& reconstruction) {
  const auto fail = [&](const std::string& fault) {
    Fail(folder,
         fault,
         "rigs and frames that fit the images",
         "delete rigs.* and frames.* if an older COLMAP wrote the other files later");
  };
  ForEachFrameImage(reconstruction, fail, [](Image& image, const Rigid3d& cam_from_world) {
    image.cam_from_world = cam_from_world;
  });
}

// Names are how models are joined, so two images must not share one.
std::string FindRepeatedName(const Reconstruction& reconstruction) {
  std::set<std::string_view> names;
  for (const auto& [image_id, image] : reconstruction.images) {
    if (!names.insert(image.name).second) return image.name;
  }
  return "";
}

// What ReadModel would refuse or undo.
void CheckWritable(const Reconstruction& reconstruction) {
  const std::string fault = FindFault(reconstruction);
  VGTW_CHECK(fault.empty(), fault);
  for (const auto& [image_id, image] : reconstruction.images) {
    VGTW_CHECK(IsSafeRelativeName(image.name), "unsafe image name " + Printable(image.name));
  }
  const std::string repeated = FindRepeatedName(reconstruction);
  VGTW_CHECK(repeated.empty(), "two images are named " + repeated);
  // Frames win when a model is read, so that stale ones would undo a change of poses. The bound is
  // loose against rounding and tight against any step of an optimiser.
  constexpr double kMaxDifference = 1e-9;
  const auto fail = [](const std::string& text) { throw std::invalid_argument(text); };
  ForEachFrameImage(reconstruction, fail, [&](const Image& image, const Rigid3d& cam_from_world) {
    const double difference =
        (image.cam_from_world.ToMatrix() - cam_from_world.ToMatrix()).cwiseAbs().maxCoeff();
    const double scale = 1.0 + cam_from_world.translation.cwiseAbs().maxCoeff();
    VGTW_CHECK(difference <= kMaxDifference * scale,
               "the frame of image " + image.name + " has another pose; call UpdateFrames");
  });
}

}  // namespace

Reconstruction ReadModel(const fs::path& folder) {
  const ModelFormat format = ModelFormatOf(folder);
  Reconstruction reconstruction;
  for (const FileKind& kind : kModelFiles) ParseFile(folder, kind, format, reconstruction);
  if (HasRigFiles(folder, format)) {
    for (const FileKind& kind : kRigFiles) ParseFile(folder, kind, format, reconstruction);
    TakePosesFromFrames(folder, reconstruction);
  }
  const std::string repeated = FindRepeatedName(reconstruction);
  if (!repeated.empty()) Fail(folder, "names image " + Printable(repeated) + " twice", "each once");
  const std::string fault = FindFault(reconstruction);
  if (!fault.empty()) {
    Fail(folder, "contradicts itself: " + fault, "a consistent sparse model", "write it again");
  }
  return reconstruction;
}

bool IsModelFolder(const fs::path& folder) {
  return HasModelFiles(folder, ModelFormat::kBinary) || HasModelFiles(folder, ModelFormat::kText);
}

ModelFormat ModelFormatOf(const fs::path& folder) {
  if (!IsModelFolder(folder)) FailWithoutModel(folder);
  return HasModelFiles(folder, ModelFormat::kBinary) ? ModelFormat::kBinary : ModelFormat::kText;
}

void WriteModel(const Reconstruction& reconstruction,
                const fs::path& folder,
                const WriteModelOptions& options) {
  CheckWritable(reconstruction);
  AtomicFolder output(folder, options.overwrite);
  const auto write = [&](const FileKind& kind) {
    const bool binary = options.format == ModelFormat::kBinary;
    const fs::path path = PathOf(output.path(), kind, options.format);
    (binary ? kind.write_binary : kind.write_text)(reconstruction, path);
  };
  for (const FileKind& kind : kModelFiles) write(kind);
  if (!reconstruction.frames.empty()) {
    for (const FileKind& kind : kRigFiles) write(kind);
  }
  output.Commit();
}

}  // namespace vgtw
