// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <cstdint>
#include <filesystem>

namespace vgtw {

struct RestoreMasksOptions {
  // Change `database_path` itself instead of writing a new file.
  bool in_place = false;
  // Replace an existing output database.
  bool overwrite = false;
  // Go on if rows were written since masks were applied, and give up what they hold: changed ones
  // get their original content, new ones that name renumbered keypoints go. Else that is an Error.
  bool force = false;
};

struct RestoreMasksSummary {
  uint64_t num_images = 0;      // whose keypoints came back
  uint64_t num_matches = 0;     // pairs of `matches` that are as before
  uint64_t num_geometries = 0;  // pairs of `two_view_geometries` that are as before
  uint64_t num_given_up = 0;    // rows written since that were changed or removed
  uint64_t num_missing = 0;     // rows deleted since, which stay deleted
};

// Undoes every ApplyMasks on this database: each row that they changed gets back its content from
// before the first, byte by byte, and the table that kept it goes. Rows that COLMAP added since and
// that remain valid stay. One transaction, with the same promises as ApplyMasks; sparse models are
// not touched. Throws Error, with nothing written, for a database that keeps no originals, and,
// without `force`, if restoring would lose something written since.
RestoreMasksSummary RestoreMasks(const std::filesystem::path& database_path,
                                 const std::filesystem::path& output_path,
                                 const RestoreMasksOptions& options,
                                 const ProgressCallback& progress = {});

}  // namespace vgtw
