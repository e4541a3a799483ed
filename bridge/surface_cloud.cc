// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/surface_cloud.h"

#include "scene/error.h"
#include "scene/files.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace vgtw {
namespace {

void CheckLaw(const SurfaceCloud& cloud) {
  const size_t size = cloud.points.size();
  VGTW_CHECK(cloud.normals.empty() || cloud.normals.size() == size, "a normal is missing");
  for (const CloudScalar& scalar : cloud.scalars) {
    VGTW_CHECK(scalar.values.size() == size, "a value of " + scalar.name + " is missing");
  }
}

template <typename T>
void WriteValue(const T& value, AtomicFile& file) {
  file.Write(std::as_bytes(std::span(&value, 1)));
}

void WriteVector(const Eigen::Vector3f& vector, AtomicFile& file) {
  file.Write(std::as_bytes(std::span(vector.data(), 3)));
}

void WriteScalars(const SurfaceCloud& cloud, size_t i, AtomicFile& file) {
  for (const CloudScalar& scalar : cloud.scalars) WriteValue(scalar.values[i], file);
}

}  // namespace

void Append(const SurfaceCloud& part, SurfaceCloud& cloud) {
  if (cloud.points.empty()) {
    cloud = part;
    return;
  }
  VGTW_CHECK(part.scalars.size() == cloud.scalars.size(), "clouds have other scalars");
  cloud.points.insert(cloud.points.end(), part.points.begin(), part.points.end());
  cloud.normals.insert(cloud.normals.end(), part.normals.begin(), part.normals.end());
  for (size_t i = 0; i < cloud.scalars.size(); ++i) {
    const std::vector<float>& values = part.scalars[i].values;
    cloud.scalars[i].values.insert(cloud.scalars[i].values.end(), values.begin(), values.end());
  }
  CheckLaw(cloud);
}

void WritePly(const std::filesystem::path& path, const SurfaceCloud& cloud) {
  CheckLaw(cloud);
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                       std::to_string(cloud.points.size()) +
                       "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!cloud.normals.empty()) {
    header += "property float nx\nproperty float ny\nproperty float nz\n";
  }
  header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  for (const CloudScalar& scalar : cloud.scalars) header += "property float " + scalar.name + "\n";
  AtomicFile file(path);
  file.Write(header + "end_header\n");
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    WriteVector(cloud.points[i].xyz, file);
    if (!cloud.normals.empty()) WriteVector(cloud.normals[i], file);
    WriteValue(cloud.points[i].rgb, file);
    WriteScalars(cloud, i, file);
  }
  file.Commit();
}

void WritePcd(const std::filesystem::path& path, const SurfaceCloud& cloud) {
  CheckLaw(cloud);
  std::string fields = "x y z rgb";
  size_t num_fields = 4;
  if (!cloud.normals.empty()) {
    fields += " normal_x normal_y normal_z";
    num_fields += 3;
  }
  for (const CloudScalar& scalar : cloud.scalars) fields += " " + scalar.name;
  num_fields += cloud.scalars.size();
  const auto repeated = [&](const std::string& word) {
    std::string words;
    for (size_t i = 0; i < num_fields; ++i) words += " " + word;
    return words;
  };
  const std::string count = std::to_string(cloud.points.size());
  AtomicFile file(path);
  file.Write("# .PCD v0.7\nVERSION 0.7\nFIELDS " + fields + "\nSIZE" + repeated("4") + "\nTYPE" +
             repeated("F") + "\nCOUNT" + repeated("1") + "\nWIDTH " + count +
             "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + count + "\nDATA binary\n");
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    WriteVector(cloud.points[i].xyz, file);
    const auto [red, green, blue] = cloud.points[i].rgb;
    WriteValue(uint32_t{red} << 16 | uint32_t{green} << 8 | blue, file);
    if (!cloud.normals.empty()) WriteVector(cloud.normals[i], file);
    WriteScalars(cloud, i, file);
  }
  file.Commit();
}

}  // namespace vgtw
