// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <filesystem>

namespace vgtw {

// COLMAP's sparse model: cameras, images, points3D (.bin or .txt), from 3.12 on also rigs, frames.
// Like COLMAP: .bin is read if cameras.bin, images.bin and points3D.bin all exist, else .txt.
// Where frames exist they hold the poses (COLMAP >= 3.12 ignores those in images.*): images'
// cam_from_world is then sensor_from_rig * rig_from_world.
// Throws Error if a file is missing, truncated, has counts larger than the file can hold, an
// unknown camera model, non-finite poses, ids or names twice, names outside the image folder, or
// breaks Reconstruction's law. In text, Error tells the line.
Reconstruction ReadModel(const std::filesystem::path& folder);

// Whether the folder holds a model in one of the formats.
bool IsModelFolder(const std::filesystem::path& folder);

enum class ModelFormat { kBinary, kText };

// The format that ReadModel reads there. Throws Error if the folder holds no model.
ModelFormat ModelFormatOf(const std::filesystem::path& folder);

struct WriteModelOptions {
  ModelFormat format = ModelFormat::kBinary;
  bool overwrite = false;  // replace the folder as a whole; else it must be new or empty
};

// rigs.* and frames.* are written only if the reconstruction has them. The folder appears complete
// or not at all. What ReadModel gave is written back byte by byte, except for the order of records,
// which is by id. Throws std::invalid_argument if the reconstruction breaks its law, has names that
// ReadModel refuses (in text also a space), or frames with other poses than its images have (see
// UpdateFrames); Error if it cannot be written.
void WriteModel(const Reconstruction& reconstruction,
                const std::filesystem::path& folder,
                const WriteModelOptions& options = {});

}  // namespace vgtw
