// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/checkpoint.h"
#include "scene/progress.h"
#include "scene/safetensors.h"

#include <filesystem>

namespace vgtw {

// Writes the tensors and metadata of `checkpoint` as one .safetensors file, atomically and without
// holding more than a few MiB. Floating-point values become `float_type` (F32, F16 or BF16) by ONE
// rounding to nearest, ties to even; infinities and NaNs stay such; tensors of integers and bools
// stay as they are. Calls `progress` with bytes read.
// Throws Error if `output` exists and not `overwrite`, if it cannot be written, and, naming the
// tensor, if a finite value would become infinite (F16: from 65520 on).
// Throws std::invalid_argument for another float_type.
void ConvertCheckpoint(const Checkpoint& checkpoint,
                       TensorType float_type,
                       const std::filesystem::path& output,
                       bool overwrite,
                       const ProgressCallback& progress = {});

}  // namespace vgtw
