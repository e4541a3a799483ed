// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/sqlite.h"

#include "scene/files.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <array>
#include <fstream>
#include <sys/wait.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace vgtw {
namespace {

using Mode = SqliteConnection::Mode;
using testing::HasSubstr;

void MakeDatabase(const std::filesystem::path& path) {
  SqliteConnection(path, Mode::kPrivate)
      .ExecuteScript("CREATE TABLE t (a INTEGER); INSERT INTO t VALUES (1);");
}

int64_t SumOfRows(SqliteConnection& connection) {
  SqliteQuery query(connection, "SELECT sum(a) FROM t");
  EXPECT_TRUE(query.Next());
  return query.Int(0);
}

// Leaves a database as a killed COLMAP does: WAL mode, the second row only in the -wal file.
void MakeDatabaseWithWal(const std::filesystem::path& path) {
  MakeDatabase(path);
  const pid_t child = ::fork();
  if (child == 0) {
    SqliteConnection connection(path, Mode::kReadWrite);
    connection.ExecuteScript("PRAGMA journal_mode = WAL; INSERT INTO t VALUES (10);");
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
  ASSERT_TRUE(std::filesystem::exists(path.string() + "-wal"));
}

void CopyDatabase(const std::filesystem::path& from, const std::filesystem::path& to) {
  SqliteConnection source(from, Mode::kReadOnly);
  const SqliteTransaction snapshot(source);
  source.CopyTo(to);
}

TEST(SqliteQuery, ValuesComeBackAsBound) {
  const TemporaryFolder folder;
  SqliteConnection connection(folder / "a.db", Mode::kPrivate);
  connection.Execute("CREATE TABLE v (i INTEGER, t TEXT, b BLOB, e BLOB, n BLOB)");
  const std::array<uint8_t, 3> bytes = {0, 1, 255};
  connection.Execute("INSERT INTO v VALUES (?, ?, ?, ?, ?)",
                     int64_t{-5000000000},
                     std::string_view("na\xc3\xafve 'name'"),
                     AsBlob(bytes),
                     BlobBytes(),
                     std::nullopt);
  SqliteQuery query(connection, "SELECT i, t, b, e, n FROM v");
  ASSERT_TRUE(query.Next());
  EXPECT_EQ(query.Int(0), -5000000000);
  EXPECT_EQ(query.Text(1), "na\xc3\xafve 'name'");
  EXPECT_TRUE(std::ranges::equal(query.Blob(2), AsBlob(bytes)));
  EXPECT_FALSE(query.IsNull(3));  // an empty blob is not NULL
  EXPECT_TRUE(query.Blob(3).empty());
  EXPECT_TRUE(query.IsNull(4));
  EXPECT_FALSE(query.Next());
}

TEST(SqliteQuery, TheSameSqlMayBeNested) {
  const TemporaryFolder folder;
  SqliteConnection connection(folder / "a.db", Mode::kPrivate);
  connection.ExecuteScript("CREATE TABLE t (a INTEGER); INSERT INTO t VALUES (1), (2), (3);");
  int num_pairs = 0;
  SqliteQuery outer(connection, "SELECT a FROM t");
  while (outer.Next()) {
    SqliteQuery inner(connection, "SELECT a FROM t");
    while (inner.Next()) ++num_pairs;
  }
  EXPECT_EQ(num_pairs, 9);
}

TEST(SqliteTransaction, RollsBackUnlessCommitted) {
  const TemporaryFolder folder;
  MakeDatabase(folder / "a.db");
  SqliteConnection connection(folder / "a.db", Mode::kReadWrite);
  {
    const SqliteTransaction transaction(connection);
    connection.Execute("INSERT INTO t VALUES (10)");
    EXPECT_EQ(SumOfRows(connection), 11);
  }
  EXPECT_EQ(SumOfRows(connection), 1);
  SqliteTransaction transaction(connection);
  connection.Execute("INSERT INTO t VALUES (100)");
  transaction.Commit();
  EXPECT_EQ(SumOfRows(connection), 101);
}

TEST(SqliteConnection, ReadOnlyTouchesNothing) {
  const TemporaryFolder folder;
  const std::string names[] = {"delete.db", "wal.db", "a%20b?c#d.db"};  // the last as a URI trap
  for (const std::string& name : names) MakeDatabase(folder / name);
  for (const std::string& name : {names[1], names[2]}) {
    SqliteConnection(folder / name, Mode::kReadWrite).ExecuteScript("PRAGMA journal_mode = WAL;");
  }
  const auto before = Snapshot(folder.path());
  EXPECT_EQ(before.size(), 3u);
  for (const std::string& name : names) {
    SqliteConnection connection(folder / name, Mode::kReadOnly);
    EXPECT_EQ(SumOfRows(connection), 1) << name;
    EXPECT_EQ(Snapshot(folder.path()), before) << name;
    EXPECT_THROW(connection.Execute("INSERT INTO t VALUES (2)"), Error) << name;
  }
  EXPECT_EQ(Snapshot(folder.path()), before);
}

TEST(SqliteConnection, ReadOnlySeesWhatLiesInTheWal) {
  const TemporaryFolder folder;
  MakeDatabaseWithWal(folder / "a.db");
  const std::string main_before = ReadFile(folder / "a.db");
  const std::string wal_before = ReadFile(folder / "a.db-wal");
  {
    SqliteConnection connection(folder / "a.db", Mode::kReadOnly);
    EXPECT_EQ(SumOfRows(connection), 11);
  }
  EXPECT_TRUE(ReadFile(folder / "a.db") == main_before);
  EXPECT_TRUE(ReadFile(folder / "a.db-wal") == wal_before);
}

TEST(SqliteConnection, CopyHoldsWhatLiesInTheWalInOneFile) {
  const TemporaryFolder folder;
  MakeDatabaseWithWal(folder / "a.db");
  CopyDatabase(folder / "a.db", folder / "b.db");
  SqliteConnection copy(folder / "b.db", Mode::kReadWrite);
  EXPECT_EQ(SumOfRows(copy), 11);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.db-wal"));
}

TEST(SqliteConnection, CopyOfAClosedDatabaseIsInRollbackMode) {
  const TemporaryFolder folder;
  MakeDatabase(folder / "delete.db");
  MakeDatabase(folder / "wal.db");
  SqliteConnection(folder / "wal.db", Mode::kReadWrite).ExecuteScript("PRAGMA journal_mode = WAL;");
  CopyDatabase(folder / "delete.db", folder / "delete copy.db");
  CopyDatabase(folder / "wal.db", folder / "wal copy.db");
  EXPECT_TRUE(ReadFile(folder / "delete copy.db") == ReadFile(folder / "delete.db"));
  SqliteConnection copy(folder / "wal copy.db", Mode::kReadWrite);
  EXPECT_EQ(SumOfRows(copy), 1);
  EXPECT_FALSE(std::filesystem::exists(folder / "wal copy.db-wal"));
}

TEST(SqliteConnection, CopyHoldsWritersOff) {
  const TemporaryFolder folder;
  MakeDatabase(folder / "a.db");
  SqliteConnection source(folder / "a.db", Mode::kReadOnly);
  EXPECT_THROW(source.CopyTo(folder / "b.db"), std::invalid_argument);
  const SqliteTransaction snapshot(source);
  source.CopyTo(folder / "b.db");
  SqliteConnection writer(folder / "a.db", Mode::kReadWrite);
  EXPECT_THAT(ErrorOf([&] { writer.Execute("INSERT INTO t VALUES (2)"); }), HasSubstr("is locked"));
}

TEST(SqliteConnection, LockedDatabaseIsNamed) {
  const TemporaryFolder folder;
  MakeDatabase(folder / "a.db");
  SqliteConnection other(folder / "a.db", Mode::kReadWrite);
  other.Execute("BEGIN EXCLUSIVE");
  for (const Mode mode : {Mode::kReadOnly, Mode::kReadWrite}) {
    const std::string error = ErrorOf([&] { SqliteConnection(folder / "a.db", mode); });
    EXPECT_THAT(error, HasSubstr("a.db: is locked by another process"));
  }
}

TEST(SqliteConnection, TriggersOfAForeignDatabaseDoNotFire) {
  const TemporaryFolder folder;
  MakeDatabase(folder / "a.db");
  SqliteConnection connection(folder / "a.db", Mode::kReadWrite);
  connection.ExecuteScript(
      "CREATE TRIGGER trap AFTER INSERT ON t BEGIN DELETE FROM t; END; INSERT INTO t VALUES (10);");
  EXPECT_EQ(SumOfRows(connection), 11);
}

TEST(AtomicDatabase, AppearsAtCommitOnly) {
  const TemporaryFolder folder;
  { const AtomicDatabase file(folder / "a.db", /*overwrite=*/false); }
  EXPECT_TRUE(Snapshot(folder.path()).empty());
  AtomicDatabase file(folder / "a.db", /*overwrite=*/false);
  MakeDatabase(file.path());
  EXPECT_FALSE(std::filesystem::exists(folder / "a.db"));
  file.Commit();
  SqliteConnection connection(folder / "a.db", Mode::kReadOnly);
  EXPECT_EQ(SumOfRows(connection), 1);
  EXPECT_EQ(Snapshot(folder.path()).size(), 1u);
}

TEST(AtomicDatabase, RefusesToReplaceAndToInheritAJournal) {
  const TemporaryFolder folder;
  MakeDatabase(folder / "a.db");
  EXPECT_THAT(ErrorOf([&] { AtomicDatabase(folder / "a.db", /*overwrite=*/false); }),
              HasSubstr("a.db: exists, expected a new file"));
  for (const std::string suffix : {"-wal", "-journal"}) {
    std::ofstream(folder / ("b.db" + suffix)) << "pages of another database";
    EXPECT_THAT(ErrorOf([&] { AtomicDatabase(folder / "b.db", /*overwrite=*/true); }),
                HasSubstr("b.db" + suffix + ": lies beside the database to be written"));
    std::filesystem::remove(folder / ("b.db" + suffix));
  }
}

}  // namespace
}  // namespace vgtw
