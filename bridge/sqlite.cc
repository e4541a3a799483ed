// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/sqlite.h"

#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr int kBusyTimeoutMs = 1000;
constexpr const char* kExpected = "a COLMAP database";

fs::path Sibling(const fs::path& path, const char* suffix) {
  fs::path sibling = path;
  sibling += suffix;
  return sibling;
}

// Bytes of SQLite's file header that tell its journal mode.
constexpr size_t kWriteVersionByte = 18;
constexpr size_t kReadVersionByte = 19;
constexpr char kRollbackMode = 1;
constexpr char kWalMode = 2;

// Refuses what SQLite would silently take for an empty database, and says whether the file is in
// WAL mode.
bool CheckHeader(const fs::path& path) {
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (!fs::exists(status)) Fail(path, "does not exist", kExpected);
  if (!fs::is_regular_file(status)) Fail(path, "is not a file", kExpected);
  std::array<char, 100> header = {};
  std::ifstream file(path, std::ios::binary);
  if (!file.is_open()) FailErrno(path, "cannot be read");
  file.read(header.data(), header.size());
  if (file.gcount() == 0) {
    Fail(path, "is empty", kExpected, "make one with: colmap database_creator --database_path");
  }
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  if (static_cast<size_t>(file.gcount()) < header.size() ||
      std::string_view(header.data(), kMagic.size()) != kMagic) {
    Fail(path, "is not an SQLite file", kExpected);
  }
  return header[kWriteVersionByte] == kWalMode || header[kReadVersionByte] == kWalMode;
}

// SQLite's URI of a file; the characters that mean something in a URI are escaped.
std::string ImmutableUri(const fs::path& path) {
  std::string uri = "file://";
  for (const char c : fs::absolute(path).string()) {
    if (c == '%' || c == '?' || c == '#') {
      constexpr const char* kDigits = "0123456789ABCDEF";
      uri += {'%', kDigits[(c >> 4) & 15], kDigits[c & 15]};
    } else {
      uri += c;
    }
  }
  return uri + "?immutable=1";
}

bool IsNonEmptyFile(const fs::path& path) {
  std::error_code code;
  const uintmax_t size = fs::file_size(path, code);
  return !code && size > 0;
}

bool Sync(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool synced = ::fsync(descriptor) == 0;
  ::close(descriptor);
  return synced;
}

[[noreturn]] void ThrowSqlite(const fs::path& path, sqlite3* handle, int code) {
  const std::string detail =
      Printable(handle != nullptr ? sqlite3_errmsg(handle) : sqlite3_errstr(code));
  switch (code & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      Fail(path,
           "is locked by another process",
           "a database that nobody writes to",
           "close COLMAP and try again");
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
      Fail(path, "is damaged or truncated (" + detail + ")", kExpected, "restore it from a copy");
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
      Fail(path, "cannot be opened (" + detail + ")", "a file and folder with write permission");
    case SQLITE_FULL:
    case SQLITE_IOERR: {
      const int system_error = handle != nullptr ? sqlite3_system_errno(handle) : 0;
      Fail(path,
           "cannot be read or written (" + detail +
               (system_error != 0 ? ": " + std::string(std::strerror(system_error)) : "") + ")",
           "enough space on a working disk");
    }
    default:
      Fail(path, "is refused by SQLite (" + detail + ")", kExpected);
  }
}

}  // namespace

SqliteConnection::SqliteConnection(const fs::path& path, Mode mode, fs::path origin)
    : path_(path), mode_(mode), origin_(std::move(origin)) {
  try {
    Open();
  } catch (...) {
    sqlite3_close(handle_);
    throw;
  }
}

void SqliteConnection::Open() {
  std::string name = path_.string();
  int flags = SQLITE_OPEN_READWRITE;
  if (mode_ == Mode::kPrivate) {
    flags |= SQLITE_OPEN_CREATE;
  } else {
    const bool is_wal = CheckHeader(path_);
    if (mode_ == Mode::kReadOnly && is_wal && !fs::exists(Sibling(path_, "-wal"))) {
      name = ImmutableUri(path_);
      flags = SQLITE_OPEN_READONLY | SQLITE_OPEN_URI;
    } else if (mode_ == Mode::kReadOnly && !IsNonEmptyFile(Sibling(path_, "-journal"))) {
      flags = SQLITE_OPEN_READONLY;
    }
  }
  const int code = sqlite3_open_v2(name.c_str(), &handle_, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  if (code != SQLITE_OK) Throw(code);
  sqlite3_extended_result_codes(handle_, 1);
  sqlite3_busy_timeout(handle_, kBusyTimeoutMs);
  // A database from elsewhere may hold triggers and views; none of them is COLMAP's.
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  ExecuteScript("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON;");
  if (mode_ == Mode::kReadOnly) ExecuteScript("PRAGMA query_only = ON;");
  if (mode_ == Mode::kPrivate)
    ExecuteScript("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;");
  if (mode_ == Mode::kReadWrite && sqlite3_db_readonly(handle_, "main") == 1) {
    Fail(path_, "is write-protected", "a file that may be written");
  }
  ExecuteScript("SELECT count(*) FROM sqlite_master;");  // reads the first pages: is it sound?
}

SqliteConnection::~SqliteConnection() {
  for (const auto& [sql, statement] : idle_statements_) sqlite3_finalize(statement);
  sqlite3_close(handle_);
}

void SqliteConnection::Throw(int code) const {
  const bool is_damaged = (code & 0xff) == SQLITE_CORRUPT;
  ThrowSqlite(is_damaged ? path() : path_, handle_, code);
}

bool SqliteConnection::InTransaction() const { return sqlite3_get_autocommit(handle_) == 0; }

void SqliteConnection::Rollback() noexcept {
  // SQLite has already rolled back after some failures, for instance a full disk.
  if (InTransaction()) sqlite3_exec(handle_, "ROLLBACK", nullptr, nullptr, nullptr);
}

void SqliteConnection::ExecuteScript(const std::string& sql) {
  const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) Throw(code);
}

int64_t SqliteConnection::NumChangedRows() const { return sqlite3_changes64(handle_); }

void SqliteConnection::CopyTo(const fs::path& target_path) {
  VGTW_CHECK(InTransaction(), "a copy needs a transaction that holds writers off");
  ExecuteScript("SELECT count(*) FROM sqlite_master;");  // BEGIN alone takes no lock yet
  if (fs::exists(Sibling(path_, "-wal"))) {
    CopyPages(target_path);
  } else {
    CopyBytes(target_path);
  }
}

void SqliteConnection::CopyPages(const fs::path& target_path) const {
  SqliteConnection target(target_path, Mode::kPrivate);
  sqlite3_backup* backup = sqlite3_backup_init(target.handle_, "main", handle_, "main");
  if (backup == nullptr) target.Throw(sqlite3_errcode(target.handle_));
  const int step_code = sqlite3_backup_step(backup, -1);
  const int code = sqlite3_backup_finish(backup);
  if (code != SQLITE_OK) target.Throw(code);
  if (step_code != SQLITE_DONE) ThrowSqlite(path_, nullptr, step_code);
  target.ExecuteScript("PRAGMA journal_mode = DELETE;");  // the page copy is in WAL mode
}

// Several times faster than page by page. SQLite's own file is read, because closing another
// descriptor of the same file would drop the lock.
void SqliteConnection::CopyBytes(const fs::path& target_path) const {
  sqlite3_file* file = nullptr;
  sqlite3_file_control(handle_, "main", SQLITE_FCNTL_FILE_POINTER, &file);
  sqlite3_int64 size = 0;
  int code = file->pMethods->xFileSize(file, &size);
  if (code != SQLITE_OK) Throw(code);
  std::ofstream target(target_path, std::ios::binary | std::ios::trunc);
  // Larger blocks make large folios on ext4, which then slow down every write of a single page.
  std::vector<char> block(size_t{1} << 16);
  for (sqlite3_int64 offset = 0; offset < size; offset += std::ssize(block)) {
    block.resize(static_cast<size_t>(std::min<sqlite3_int64>(std::ssize(block), size - offset)));
    code = file->pMethods->xRead(file, block.data(), static_cast<int>(block.size()), offset);
    if (code != SQLITE_OK) Throw(code);
    if (offset == 0) block[kWriteVersionByte] = block[kReadVersionByte] = kRollbackMode;
    if (!target.write(block.data(), std::ssize(block)).flush()) {
      FailErrno(target_path, "cannot be written");
    }
  }
}

sqlite3_stmt* SqliteConnection::TakeStatement(std::string_view sql) {
  const auto found = idle_statements_.find(std::string(sql));
  if (found != idle_statements_.end()) {
    sqlite3_stmt* statement = found->second;
    idle_statements_.erase(found);
    return statement;
  }
  sqlite3_stmt* statement = nullptr;
  const int code =
      sqlite3_prepare_v2(handle_, sql.data(), static_cast<int>(sql.size()), &statement, nullptr);
  if (code != SQLITE_OK) Throw(code);
  return statement;
}

void SqliteConnection::GiveBack(const std::string& sql, sqlite3_stmt* statement) noexcept {
  sqlite3_reset(statement);
  sqlite3_clear_bindings(statement);
  if (!idle_statements_.emplace(sql, statement).second) sqlite3_finalize(statement);
}

bool SqliteQuery::Next() {
  const int code = sqlite3_step(statement_);
  if (code != SQLITE_ROW && code != SQLITE_DONE) connection_.Throw(code);
  return code == SQLITE_ROW;
}

bool SqliteQuery::IsNull(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}

int64_t SqliteQuery::Int(int column) const { return sqlite3_column_int64(statement_, column); }

std::string SqliteQuery::Text(int column) const {
  const unsigned char* text = sqlite3_column_text(statement_, column);
  if (text == nullptr) return {};
  return {reinterpret_cast<const char*>(text),
          static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}

BlobBytes SqliteQuery::Blob(int column) const {
  const void* data = sqlite3_column_blob(statement_, column);
  const int size = sqlite3_column_bytes(statement_, column);
  return {static_cast<const std::byte*>(data), static_cast<size_t>(data == nullptr ? 0 : size)};
}

void SqliteQuery::BindInt(int index, int64_t value) {
  sqlite3_bind_int64(statement_, index, value);
}

void SqliteQuery::Bind(int index, std::string_view text) {
  sqlite3_bind_text64(statement_, index, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8);
}

void SqliteQuery::Bind(int index, BlobBytes bytes) {
  // A null pointer would bind NULL where an empty blob is meant.
  const void* data = bytes.empty() ? "" : static_cast<const void*>(bytes.data());
  const int code = sqlite3_bind_blob64(statement_, index, data, bytes.size(), SQLITE_STATIC);
  if (code != SQLITE_OK) connection_.Throw(code);
}

AtomicDatabase::AtomicDatabase(fs::path final_path, bool overwrite)
    : final_path_(std::move(final_path)) {
  if (fs::is_directory(final_path_)) Fail(final_path_, "is a folder", "a file name to write");
  if (!overwrite && fs::exists(final_path_)) {
    Fail(final_path_, "exists", "a new file", "name another or add --overwrite");
  }
  for (const char* suffix : {"-wal", "-journal"}) {
    const fs::path sibling = Sibling(final_path_, suffix);
    if (!fs::exists(sibling)) continue;
    Fail(sibling,
         "lies beside the database to be written",
         "no such file",
         "close COLMAP, or remove it if it is left from a crash");
  }
  temporary_path_ = final_path_.parent_path() /
                    ("." + final_path_.filename().string() + ".tmp-" + std::to_string(::getpid()));
  const int descriptor =
      ::open(temporary_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor < 0) FailErrno(final_path_, "cannot be written");
  ::close(descriptor);
}

AtomicDatabase::~AtomicDatabase() {
  std::error_code ignored;
  fs::remove(temporary_path_, ignored);
}

void AtomicDatabase::Commit() {
  if (!Sync(temporary_path_) || ::rename(temporary_path_.c_str(), final_path_.c_str()) != 0) {
    FailErrno(final_path_, "cannot be written");
  }
  Sync(final_path_.has_parent_path() ? final_path_.parent_path() : ".");
}

}  // namespace vgtw
