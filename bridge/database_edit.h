// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/sqlite.h"

#include <filesystem>
#include <optional>

namespace vgtw {

// One transaction that changes a database either in place or on a copy that appears under its final
// name when it is complete. What is read from source() before target() is asked for fails without
// anything having been written.
class DatabaseEdit {
 public:
  // In place `output_path` is empty or the same file; else it must be another. Throws Error if it
  // exists without `overwrite`, and as RecogniseSchema.
  DatabaseEdit(const std::filesystem::path& database_path,
               const std::filesystem::path& output_path,
               bool in_place,
               bool overwrite);

  // Locked against writers from here on.
  SqliteConnection& source() { return source_; }
  // The one to change; on the first call a copy is made where one is asked for.
  SqliteConnection& target();
  void Commit();

 private:
  bool in_place_;
  bool overwrite_;
  std::filesystem::path output_path_;
  SqliteConnection source_;
  SqliteTransaction source_transaction_;
  std::optional<AtomicDatabase> file_;
  std::optional<SqliteConnection> copy_;
  std::optional<SqliteTransaction> copy_transaction_;
};

}  // namespace vgtw
