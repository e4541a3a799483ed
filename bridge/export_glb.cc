// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/export_glb.h"

#include "scene/error.h"

#ifdef VGTW_WITH_TINYGLTF
#include "scene/files.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <sstream>
#include <string>

#include <Eigen/Geometry>
#include <tiny_gltf.h>
#endif

namespace vgtw {

#ifdef VGTW_WITH_TINYGLTF
namespace {

constexpr double kNearPlane = 0.01;  // glTF must have one
constexpr size_t kBytesPerPoint = 3 * sizeof(float) + 4 * sizeof(uint16_t);
constexpr uint64_t kMaxBytes = std::numeric_limits<uint32_t>::max();
constexpr uint64_t kBytesPerCamera = 1024;  // of JSON, and more than it takes

// Of 65535, of an sRGB value. Source: IEC 61966-2-1.
uint16_t LinearLight(uint8_t value) {
  const double c = value / 255.0;
  const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(65535.0 * linear));
}

template <typename T>
void AddBytes(const T* values, size_t count, std::vector<unsigned char>& bytes) {
  const size_t begin = bytes.size();
  bytes.resize(begin + count * sizeof(T));
  std::memcpy(bytes.data() + begin, values, count * sizeof(T));
}

int AddBufferView(size_t offset, size_t length, tinygltf::Model& gltf) {
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = offset;
  view.byteLength = length;
  view.target = TINYGLTF_TARGET_ARRAY_BUFFER;
  gltf.bufferViews.push_back(view);
  return static_cast<int>(gltf.bufferViews.size()) - 1;
}

// Positions of all points, then colours of all points.
void FillBuffer(const std::vector<ColoredPoint>& points, tinygltf::Model& gltf) {
  std::vector<unsigned char>& bytes = gltf.buffers.emplace_back().data;
  bytes.reserve(points.size() * kBytesPerPoint);
  for (const ColoredPoint& point : points) AddBytes(point.xyz.data(), 3, bytes);
  for (const auto& [xyz, rgb] : points) {
    const std::array<uint16_t, 4> color = {LinearLight(rgb[0]),
                                           LinearLight(rgb[1]),
                                           LinearLight(rgb[2]),
                                           std::numeric_limits<uint16_t>::max()};
    AddBytes(color.data(), color.size(), bytes);
  }
}

void AddPoints(const std::vector<ColoredPoint>& points, tinygltf::Model& gltf) {
  FillBuffer(points, gltf);
  Eigen::Vector3f min = points.front().xyz;
  Eigen::Vector3f max = min;
  for (const ColoredPoint& point : points) {
    min = min.cwiseMin(point.xyz);
    max = max.cwiseMax(point.xyz);
  }
  const size_t positions_size = points.size() * 3 * sizeof(float);
  tinygltf::Accessor positions;
  positions.bufferView = AddBufferView(0, positions_size, gltf);
  positions.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
  positions.type = TINYGLTF_TYPE_VEC3;
  positions.count = points.size();
  positions.minValues.assign(min.begin(), min.end());
  positions.maxValues.assign(max.begin(), max.end());
  tinygltf::Accessor colors;
  colors.bufferView =
      AddBufferView(positions_size, gltf.buffers[0].data.size() - positions_size, gltf);
  colors.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
  colors.normalized = true;
  colors.type = TINYGLTF_TYPE_VEC4;
  colors.count = points.size();
  gltf.accessors = {positions, colors};

  tinygltf::Material material;
  material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object());
  gltf.materials = {material};
  gltf.extensionsUsed = {"KHR_materials_unlit"};
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_POINTS;
  primitive.material = 0;
  primitive.attributes = {{"POSITION", 0}, {"COLOR_0", 1}};
  gltf.meshes.emplace_back().primitives = {primitive};
}

// Half a turn about x, in glTF's order x y z w.
const std::vector<double> kHalfTurn = {1.0, 0.0, 0.0, 0.0};

tinygltf::Node CameraNode(const View& view, tinygltf::Model& gltf) {
  const Camera& camera = view.camera;
  const double half_width = 0.5 * static_cast<double>(camera.width) / camera.FocalLengthX();
  const double half_height = 0.5 * static_cast<double>(camera.height) / camera.FocalLengthY();
  tinygltf::Camera& lens = gltf.cameras.emplace_back();
  lens.type = "perspective";
  lens.perspective.yfov = 2.0 * std::atan(half_height);
  lens.perspective.aspectRatio = half_width / half_height;
  lens.perspective.znear = kNearPlane;
  const Rigid3d world_from_cam = Inverse(view.cam_from_world);
  const Eigen::Quaterniond rotation =
      world_from_cam.rotation * Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
  tinygltf::Node node;
  node.name = view.name;
  node.camera = static_cast<int>(gltf.cameras.size()) - 1;
  node.rotation.assign(rotation.coeffs().begin(), rotation.coeffs().end());
  node.translation.assign(world_from_cam.translation.begin(), world_from_cam.translation.end());
  return node;
}

}  // namespace

bool CanWriteGlb() { return true; }

void WriteGlb(const std::filesystem::path& path,
              const SurfaceCloud& cloud,
              const std::vector<View>& views) {
  if (cloud.points.size() * kBytesPerPoint + views.size() * kBytesPerCamera > kMaxBytes) {
    Fail(path,
         "would have " + std::to_string(cloud.points.size()) + " points",
         "at most the 4 GiB of a glTF file",
         "thin them by --voxel_size");
  }
  tinygltf::Model gltf;
  gltf.asset.version = "2.0";
  gltf.asset.generator = "vgtw";
  tinygltf::Node world;
  world.name = "world";
  world.rotation = kHalfTurn;
  gltf.nodes.push_back(world);
  if (!cloud.points.empty()) {
    AddPoints(cloud.points, gltf);
    tinygltf::Node& points = gltf.nodes.emplace_back();
    points.name = "points";
    points.mesh = 0;
  }
  for (const View& view : views) gltf.nodes.push_back(CameraNode(view, gltf));
  for (size_t i = 1; i < gltf.nodes.size(); ++i) {
    gltf.nodes[0].children.push_back(static_cast<int>(i));
  }
  gltf.scenes.emplace_back().nodes = {0};
  gltf.defaultScene = 0;
  std::ostringstream stream;
  tinygltf::TinyGLTF().WriteGltfSceneToStream(
      &gltf, stream, /*prettyPrint=*/false, /*writeBinary=*/true);
  WriteFileAtomically(path, std::move(stream).str());
}

#else

bool CanWriteGlb() { return false; }

void WriteGlb(const std::filesystem::path& path, const SurfaceCloud&, const std::vector<View>&) {
  Fail(path,
       "cannot be written: this vgtw was built without tinygltf",
       "a build with it",
       "install libtinygltf-dev and build again, or take --format ply");
}

#endif

}  // namespace vgtw
