// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_restore.h"

#include "bridge/database_edit.h"
#include "bridge/mask_undo.h"
#include "scene/error.h"

#include <optional>
#include <string>

namespace vgtw {
namespace {

// An entry of the table, without the content that it keeps.
struct Entry {
  int64_t undo_id = 0;
  std::string table_name;
  int64_t row_id = 0;
  bool is_foreign = false;
  bool is_newer = false;
};

std::optional<Entry> ReadNextEntry(SqliteConnection& connection, int64_t previous_undo_id) {
  SqliteQuery query(connection,
                    "SELECT undo_id, table_name, row_id, applied_hash IS NULL, data IS NULL "
                    "FROM vgtw_mask_undo WHERE undo_id > ? ORDER BY undo_id LIMIT 1",
                    previous_undo_id);
  if (!query.Next()) return std::nullopt;
  return Entry{query.Int(0), query.Text(1), query.Int(2), query.Int(3) != 0, query.Int(4) != 0};
}

const MaskedTable& FindTable(const std::filesystem::path& path, const Entry& entry) {
  for (const MaskedTable& table : kMaskedTables) {
    if (entry.table_name == table.name) return table;
  }
  Fail(path,
       "keeps a row of the table '" + Printable(entry.table_name) + "'",
       "one that masks change",
       "restore it from a copy");
}

int64_t Count(SqliteConnection& connection, std::string_view condition) {
  SqliteQuery query(connection,
                    "SELECT count(*) FROM vgtw_mask_undo WHERE " + std::string(condition));
  return query.Next() ? query.Int(0) : 0;
}

void RequireUnchanged(SqliteConnection& connection, const std::filesystem::path& database_path) {
  const int64_t num_foreign = Count(connection, "applied_hash IS NULL");
  if (num_foreign == 0) return;
  Fail(database_path,
       "has " + std::to_string(num_foreign) + " rows written since masks were applied",
       "the rows that mask apply left",
       "--force gives them up");
}

// Returns whether the row still existed.
bool RestoreRow(SqliteConnection& connection, const MaskedTable& table, const Entry& entry) {
  if (entry.is_newer) {
    connection.Execute(MaskedTableSql("DELETE FROM {table} WHERE {row_id} = ?", table),
                       entry.row_id);
    return connection.NumChangedRows() > 0;
  }
  SqliteQuery query(connection,
                    MaskedTableSql("SELECT u.rows, u.config, u.data, t.cols "
                                   "FROM vgtw_mask_undo AS u JOIN {table} AS t "
                                   "ON t.{row_id} = u.row_id WHERE undo_id = ?",
                                   table),
                    entry.undo_id);
  if (!query.Next()) return false;
  std::vector<uint32_t> buffer;
  const MaskedRow original = ReadOriginal(query, table, entry.row_id, buffer);
  connection.Execute(table.update_sql, original.rows, original.data, original.config, entry.row_id);
  return true;
}

void CountRestored(const MaskedTable& table, RestoreMasksSummary& summary) {
  const std::string_view name = table.name;
  summary.num_images += name == kKeypointsTable.name;
  summary.num_matches += name == kMatchesTable.name;
  summary.num_geometries += name == kTwoViewTable.name;
}

RestoreMasksSummary RestoreRows(SqliteConnection& connection, const ProgressCallback& progress) {
  RestoreMasksSummary summary;
  const int64_t num_entries = Count(connection, "TRUE");
  int64_t num_done = 0;
  Entry previous;
  while (const auto entry = ReadNextEntry(connection, previous.undo_id)) {
    previous = *entry;
    const MaskedTable& table = FindTable(connection.path(), *entry);
    if (!RestoreRow(connection, table, *entry)) {
      ++summary.num_missing;
    } else {
      summary.num_given_up += entry->is_foreign;
      if (!entry->is_newer) CountRestored(table, summary);
    }
    if (progress) progress(++num_done, num_entries);
  }
  return summary;
}

}  // namespace

RestoreMasksSummary RestoreMasks(const std::filesystem::path& database_path,
                                 const std::filesystem::path& output_path,
                                 const RestoreMasksOptions& options,
                                 const ProgressCallback& progress) {
  DatabaseEdit edit(database_path, output_path, options.in_place, options.overwrite);
  if (!HasMaskUndo(edit.source())) {
    Fail(database_path,
         "keeps no originals",
         "a database that vgtw mask apply changed without --undo 0");
  }
  SqliteConnection& connection = edit.target();
  MarkForeignRows(connection);
  if (!options.force) RequireUnchanged(connection, database_path);
  const RestoreMasksSummary summary = RestoreRows(connection, progress);
  connection.Execute("DROP TABLE vgtw_mask_undo");
  edit.Commit();
  return summary;
}

}  // namespace vgtw
