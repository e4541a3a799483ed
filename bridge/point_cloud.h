// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct ColoredPoint {
  Eigen::Vector3f xyz = Eigen::Vector3f::Zero();
  std::array<uint8_t, 3> rgb = {0, 0, 0};
};

std::vector<ColoredPoint> PointsOf(const Reconstruction& reconstruction);

// Binary little-endian PLY (float x y z, uchar red green blue).
void WritePly(const std::filesystem::path& path, const std::vector<ColoredPoint>& points);

// Reads ASCII and binary little-endian PLY whose element "vertex" has x y z of any scalar type;
// red green blue are taken if they are uchar. Other properties and elements are skipped, and so are
// points with a coordinate that is not finite. Throws Error if the header is wrong or announces
// more than the file holds.
std::vector<ColoredPoint> ReadPly(const std::filesystem::path& path);

// The same from memory; `path` is for messages.
std::vector<ColoredPoint> ParsePly(std::span<const std::byte> bytes,
                                   const std::filesystem::path& path);

// Binary PCD 0.7 (x y z rgb), as PCL reads it.
void WritePcd(const std::filesystem::path& path, const std::vector<ColoredPoint>& points);

}  // namespace vgtw
