// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/new_database.h"

#include "bridge/sqlite.h"
#include "scene/error.h"

#include <optional>

namespace vgtw {

namespace fs = std::filesystem;

struct NewDatabase::Impl {
  Impl(const fs::path& final_path, bool overwrite) : file(final_path, overwrite) {}

  AtomicDatabase file;
  std::optional<ColmapDatabase> database;
};

NewDatabase::NewDatabase(const fs::path& final_path, bool overwrite)
    : impl_(std::make_unique<Impl>(final_path, overwrite)) {
  fs::remove(impl_->file.path());  // an empty file, which only proved that it can be written
  impl_->database.emplace(ColmapDatabase::Create(impl_->file.path()));
}

NewDatabase::NewDatabase(const fs::path& final_path, bool overwrite, const fs::path& source_path)
    : impl_(std::make_unique<Impl>(final_path, overwrite)) {
  std::error_code code;
  if (fs::equivalent(final_path, source_path, code) && !code) {
    Fail(final_path, "is the database to be read", "another file");
  }
  {
    SqliteConnection source(source_path, SqliteConnection::Mode::kReadOnly);
    const SqliteTransaction snapshot(source);
    source.CopyTo(impl_->file.path());
  }
  impl_->database.emplace(impl_->file.path(), ColmapDatabase::Mode::kReadWrite);
}

NewDatabase::~NewDatabase() = default;

ColmapDatabase& NewDatabase::database() { return *impl_->database; }

void NewDatabase::Commit() {
  impl_->database.reset();
  impl_->file.Commit();
}

}  // namespace vgtw
