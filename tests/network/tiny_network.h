// SPDX-License-Identifier: BSD-3-Clause
// A network and photos small enough for tests.
#pragma once

#include "network/config.h"
#include "network/model.h"
#include "network/preprocess.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace vgtw {

// Four layers, all of which the heads read, LoRA and distractor head.
VggtConfig TinyVgtw(int64_t dim);

// TinyVgtw(64), which a file tells without metadata, with the parity tests' formula as weights; the
// network is returned, too.
std::unique_ptr<Model> WriteTinyVgtw(const std::filesystem::path& path);

// Rendered photos of 120 x 84 pixels.
struct TinyScene {
  TemporaryFolder folder;
  std::vector<std::string> names;
  std::vector<ImageSize> sizes;

  explicit TinyScene(int num_views);
  // [S, 3, H, W] in [0, 1], as the loader makes it.
  at::Tensor Images(const PreprocessOptions& options) const;
};

}  // namespace vgtw
