// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"

#include <filesystem>
#include <memory>

namespace vgtw {

// A database that appears under its final name only when it is complete: fill database(), then
// Commit(). Without Commit() nothing is left. Throws Error if something is at `final_path` and
// `overwrite` is not set.
class NewDatabase {
 public:
  // An empty one, as ColmapDatabase::Create.
  NewDatabase(const std::filesystem::path& final_path, bool overwrite);
  // A copy of another, including what its -wal file holds; `source_path` stays as it is. Throws
  // Error also if that is no COLMAP database or the same file.
  NewDatabase(const std::filesystem::path& final_path,
              bool overwrite,
              const std::filesystem::path& source_path);
  ~NewDatabase();

  ColmapDatabase& database();
  void Commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vgtw
