// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <filesystem>
#include <string_view>

namespace vgtw {

// COLMAP's five text files: one record a line, '#' starts a comment line. Only images.txt takes two
// lines a record: the pose, then the points2D, a line that may be empty but must be there. Parsers
// throw Error with file and line; writers write `path` atomically, sorted by id, numbers with 17
// significant digits so that they are read back exactly.
void ParseCamerasText(std::string_view text,
                      const std::filesystem::path& path,
                      Reconstruction& reconstruction);
void ParseImagesText(std::string_view text,
                     const std::filesystem::path& path,
                     Reconstruction& reconstruction);
void ParsePoints3DText(std::string_view text,
                       const std::filesystem::path& path,
                       Reconstruction& reconstruction);
void ParseRigsText(std::string_view text,
                   const std::filesystem::path& path,
                   Reconstruction& reconstruction);
void ParseFramesText(std::string_view text,
                     const std::filesystem::path& path,
                     Reconstruction& reconstruction);

// WriteImagesText throws std::invalid_argument for a name with a space, which would end it here.
void WriteCamerasText(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WriteImagesText(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WritePoints3DText(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WriteRigsText(const Reconstruction& reconstruction, const std::filesystem::path& path);
void WriteFramesText(const Reconstruction& reconstruction, const std::filesystem::path& path);

}  // namespace vgtw
