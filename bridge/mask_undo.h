// SPDX-License-Identifier: BSD-3-Clause
// The original content of rows that masks changed, kept inside the database in a table that COLMAP
// never reads:
//   vgtw_mask_undo (undo_id, table_name, row_id, rows, config, applied_hash, data)
// one row per changed row of keypoints, descriptors (row_id = image_id), matches and
// two_view_geometries (row_id = pair_id; config is theirs alone). rows, config and data are the
// original, from before the first ApplyMasks; data of matches whose indices all fit takes 16 bits
// for each in place of 32, which its size tells: about what the masks freed, so that the file
// hardly grows. applied_hash is that of the content that the last ApplyMasks left. NULL there marks
// a row that somebody else wrote to since; NULL in data one that did not exist then, but would be
// wrong afterwards, since it names renumbered keypoints.
#pragma once

#include "bridge/colmap_rows.h"
#include "bridge/sqlite.h"

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace vgtw {

// A table of COLMAP whose rows masks change.
struct MaskedTable {
  const char* name;        // as in the database
  const char* row_id;      // its primary key
  const char* row_label;   // in messages
  const char* update_sql;  // rows, data, configuration, row id
  size_t bytes_per_value;
  bool has_config;
  bool holds_indices;  // of keypoints: uint32
};
inline constexpr MaskedTable kKeypointsTable = {
    "keypoints",
    "image_id",
    "keypoints",
    "UPDATE keypoints SET rows = ?1, data = ?2 WHERE image_id = ?4",
    4,
    false,
    false};
inline constexpr MaskedTable kDescriptorsTable = {
    "descriptors",
    "image_id",
    "descriptors",
    "UPDATE descriptors SET rows = ?1, data = ?2 WHERE image_id = ?4",
    1,
    false,
    false};
inline constexpr MaskedTable kMatchesTable = {
    "matches",
    "pair_id",
    "matches",
    "UPDATE matches SET rows = ?1, data = ?2 WHERE pair_id = ?4",
    4,
    false,
    true};
inline constexpr MaskedTable kTwoViewTable = {
    "two_view_geometries",
    "pair_id",
    "two-view geometry",
    "UPDATE two_view_geometries SET rows = ?1, data = ?2, config = ?3 WHERE pair_id = ?4",
    4,
    true,
    true};
inline constexpr std::array kMaskedTables = {
    kKeypointsTable, kDescriptorsTable, kMatchesTable, kTwoViewTable};

// What a row of such a table holds of what masks change.
struct MaskedRow {
  size_t rows = 0;
  BlobBytes data;
  int64_t config = 0;  // of a two-view geometry
};

// `text` with the names of a table in place of {table}, {row_id}, and {config}: the column of the
// table `t`, or 0 where it has none.
std::string MaskedTableSql(std::string text, const MaskedTable& table);

// Writes to rows of a database inside of its transaction, keeping their original if asked to.
class MaskUndo {
 public:
  // Without `keep` an existing table is dropped; with it, rows that others wrote to since the last
  // run are marked first.
  MaskUndo(SqliteConnection& connection, bool keep);

  // Replaces `original`, which is what the row holds, by `rows` rows of `data`; a two-view geometry
  // without rows gets configuration 0.
  void Rewrite(const MaskedTable& table,
               int64_t row_id,
               const MaskedRow& original,
               size_t rows,
               BlobBytes data);

 private:
  void Keep(const MaskedTable& table,
            int64_t row_id,
            const MaskedRow& original,
            int64_t applied_hash);

  SqliteConnection& connection_;
  bool keep_;
  bool has_table_;
};

bool HasMaskUndo(SqliteConnection& connection);

// The original that the current row of `query` tells of: rows, config and data of the undo table,
// then cols of the row `row_id`. Its data is in `buffer` where it was packed, else the query's.
// Throws Error if the size of the data is that of no such row.
MaskedRow ReadOriginal(const SqliteQuery& query,
                       const MaskedTable& table,
                       int64_t row_id,
                       std::vector<uint32_t>& buffer);

// Marks, in the table, rows that others wrote to since masks were applied.
void MarkForeignRows(SqliteConnection& connection);

}  // namespace vgtw
