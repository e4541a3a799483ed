// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/database_edit.h"

#include "bridge/colmap_schema.h"
#include "scene/error.h"

namespace vgtw {
namespace {

namespace fs = std::filesystem;

bool IsSameFile(const fs::path& a, const fs::path& b) {
  std::error_code code;
  return fs::equivalent(a, b, code) && !code;
}

// The mode in which the source is opened, once the paths are found to be in order.
SqliteConnection::Mode CheckedMode(const fs::path& database_path,
                                   const fs::path& output_path,
                                   bool in_place) {
  const bool is_same = IsSameFile(database_path, output_path);
  if (in_place) {
    VGTW_CHECK(output_path.empty() || is_same, "in_place writes to database_path alone");
    return SqliteConnection::Mode::kReadWrite;
  }
  if (is_same) {
    Fail(output_path, "is the database to be read", "another file", "or ask for in-place changes");
  }
  return SqliteConnection::Mode::kReadOnly;
}

}  // namespace

DatabaseEdit::DatabaseEdit(const fs::path& database_path,
                           const fs::path& output_path,
                           bool in_place,
                           bool overwrite)
    : in_place_(in_place),
      overwrite_(overwrite),
      output_path_(output_path),
      source_(database_path, CheckedMode(database_path, output_path, in_place)),
      source_transaction_(source_) {
  RecogniseSchema(source_);
}

SqliteConnection& DatabaseEdit::target() {
  if (in_place_) return source_;
  if (!copy_) {
    file_.emplace(output_path_, overwrite_);
    source_.CopyTo(file_->path());
    copy_.emplace(file_->path(), SqliteConnection::Mode::kPrivate, source_.path());
    copy_transaction_.emplace(*copy_);
  }
  return *copy_;
}

void DatabaseEdit::Commit() {
  target();
  if (in_place_) {
    source_transaction_.Commit();
    return;
  }
  copy_transaction_->Commit();
  copy_transaction_.reset();
  copy_.reset();
  file_->Commit();
}

}  // namespace vgtw
