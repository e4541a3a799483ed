// SPDX-License-Identifier: BSD-3-Clause
// SQLite with exceptions: what the bridge's database code shares. Not a door.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>

struct sqlite3;
struct sqlite3_stmt;

namespace vgtw {

using BlobBytes = std::span<const std::byte>;

template <typename Container>
BlobBytes AsBlob(const Container& values) {
  return std::as_bytes(std::span(values));
}

// One connection, used by one thread. Every failure is an Error that names the file: locked, not a
// database, damaged, disk full, write-protected.
class SqliteConnection {
 public:
  enum class Mode {
    // Does not change a byte of the file. One in WAL mode without a -wal file is read as immutable:
    // nobody has it open then, and nothing is created beside it. A transaction that a crash left in
    // a -journal is rolled back first, as by any reader.
    kReadOnly,
    kReadWrite,
    // A new or unfinished file that no other process knows: neither journal nor syncs.
    kPrivate
  };
  // `origin`, if any, is the file that this one was copied from: faults of the content are told as
  // faults of it.
  SqliteConnection(const std::filesystem::path& path, Mode mode, std::filesystem::path origin = {});
  ~SqliteConnection();
  SqliteConnection(const SqliteConnection&) = delete;
  SqliteConnection& operator=(const SqliteConnection&) = delete;

  // In messages about what was read.
  const std::filesystem::path& path() const { return origin_.empty() ? path_ : origin_; }
  bool is_read_only() const { return mode_ == Mode::kReadOnly; }
  bool InTransaction() const;
  void Rollback() noexcept;  // no effect outside of a transaction

  // Runs one statement to its end; `args` replace its question marks.
  template <typename... Args>
  void Execute(std::string_view sql, const Args&... args);
  // Runs several statements separated by semicolons, without arguments.
  void ExecuteScript(const std::string& sql);
  int64_t NumChangedRows() const;  // by the last Execute

  // Copies all content, including what a -wal file holds, into one file at `target_path`, in
  // rollback mode. Needs a transaction (see SqliteTransaction).
  void CopyTo(const std::filesystem::path& target_path);

 private:
  friend class SqliteQuery;
  void Open();
  void CopyPages(const std::filesystem::path& target_path) const;
  void CopyBytes(const std::filesystem::path& target_path) const;
  [[noreturn]] void Throw(int code) const;
  sqlite3_stmt* TakeStatement(std::string_view sql);
  void GiveBack(const std::string& sql, sqlite3_stmt* statement) noexcept;

  std::filesystem::path path_;
  Mode mode_;
  std::filesystem::path origin_;
  sqlite3* handle_ = nullptr;
  std::unordered_map<std::string, sqlite3_stmt*> idle_statements_;
};

// The rows of a statement: while (query.Next()) query.Int(0). Statements are prepared once per
// connection. Text and blobs that were bound must live as long as the query; those that were read
// live until the next row.
class SqliteQuery {
 public:
  template <typename... Args>
  SqliteQuery(SqliteConnection& connection, std::string_view sql, const Args&... args)
      : connection_(connection), sql_(sql), statement_(connection.TakeStatement(sql)) {
    int index = 0;
    (Bind(++index, args), ...);
  }
  ~SqliteQuery() { connection_.GiveBack(sql_, statement_); }
  SqliteQuery(const SqliteQuery&) = delete;
  SqliteQuery& operator=(const SqliteQuery&) = delete;

  bool Next();  // false after the last row

  const std::filesystem::path& path() const { return connection_.path(); }
  bool IsNull(int column) const;
  int64_t Int(int column) const;
  std::string Text(int column) const;
  BlobBytes Blob(int column) const;  // empty for NULL

 private:
  void Bind(int index, std::integral auto value) { BindInt(index, static_cast<int64_t>(value)); }
  void Bind(int index, std::string_view text);
  void Bind(int index, BlobBytes bytes);
  void Bind(int, std::nullopt_t) {}  // unbound is NULL
  void Bind(int index, const std::optional<BlobBytes>& bytes) {
    if (bytes) Bind(index, *bytes);
  }
  void BindInt(int index, int64_t value);

  SqliteConnection& connection_;
  std::string sql_;
  sqlite3_stmt* statement_;
};

template <typename... Args>
void SqliteConnection::Execute(std::string_view sql, const Args&... args) {
  SqliteQuery query(*this, sql, args...);
  while (query.Next()) continue;
}

// Rolls back unless Commit() was called. On a read-only connection: one consistent snapshot.
class SqliteTransaction {
 public:
  explicit SqliteTransaction(SqliteConnection& connection) : connection_(connection) {
    connection_.Execute(connection_.is_read_only() ? "BEGIN" : "BEGIN IMMEDIATE");
  }
  ~SqliteTransaction() { connection_.Rollback(); }
  SqliteTransaction(const SqliteTransaction&) = delete;
  SqliteTransaction& operator=(const SqliteTransaction&) = delete;
  void Commit() { connection_.Execute("COMMIT"); }

 private:
  SqliteConnection& connection_;
};

// A database that appears under its final name only when it is complete: fill the file at path(),
// close it, then Commit(). Law: without `overwrite` nothing may be at `final_path`. Throws Error
// otherwise, and if a -wal or -journal file lies beside `final_path`: SQLite would apply the pages
// of another database to the new one.
class AtomicDatabase {
 public:
  AtomicDatabase(std::filesystem::path final_path, bool overwrite);
  ~AtomicDatabase();
  AtomicDatabase(const AtomicDatabase&) = delete;
  AtomicDatabase& operator=(const AtomicDatabase&) = delete;

  const std::filesystem::path& path() const { return temporary_path_; }
  void Commit();

 private:
  std::filesystem::path final_path_;
  std::filesystem::path temporary_path_;
};

}  // namespace vgtw
