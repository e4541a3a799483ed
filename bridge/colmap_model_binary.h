// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <cstddef>
#include <filesystem>
#include <span>

namespace vgtw {

// COLMAP's five binary files, little-endian, each a u64 count followed by its records. `path` is
// for messages only. Records are checked one by one (see colmap_model_records.h), not yet against
// each other. Parsers throw Error; writers write `path` atomically, sorted by id.
void ParseCamerasBinary(std::span<const std::byte> bytes,
                        const std::filesystem::path& path,
                        Reconstruction& reconstruction);
void ParseImagesBinary(std::span<const std::byte> bytes,
                       const std::filesystem::path& path,
                       Reconstruction& reconstruction);
void ParsePoints3DBinary(std::span<const std::byte> bytes,
                         const std::filesystem::path& path,
                         Reconstruction& reconstruction);
void ParseRigsBinary(std::span<const std::byte> bytes,
                     const std::filesystem::path& path,
                     Reconstruction& reconstruction);
void ParseFramesBinary(std::span<const std::byte> bytes,
                       const std::filesystem::path& path,
                       Reconstruction& reconstruction);

void WriteCamerasBinary(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WriteImagesBinary(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WritePoints3DBinary(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WriteRigsBinary(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WriteFramesBinary(const Reconstruction& reconstruction, const std::filesystem::path& path);

}  // namespace vgtw
