// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_undo.h"

#include "scene/error.h"

#include <limits>
#include <map>
#include <string>

namespace vgtw {
namespace {

// Tells accidental changes, nothing more. Below 2^62, so that SQL can add a configuration to it.
int64_t Fingerprint(BlobBytes bytes) {
  constexpr uint64_t kMultiplier = 0x9e3779b97f4a7c15;
  uint64_t hash = bytes.size();
  const auto mix = [&](uint64_t word) {
    hash = (hash ^ word) * kMultiplier;
    hash ^= hash >> 32;
  };
  size_t i = 0;
  for (; i + sizeof(uint64_t) <= bytes.size(); i += sizeof(uint64_t)) {
    uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof(word));
    mix(word);
  }
  for (; i < bytes.size(); ++i) mix(static_cast<uint64_t>(bytes[i]));
  return static_cast<int64_t>(hash >> 2);
}

// Entries whose row is gone or has other content than the last run left.
std::vector<int64_t> FindChangedEntries(SqliteConnection& connection, const MaskedTable& table) {
  std::vector<int64_t> undo_ids;
  SqliteQuery query(
      connection,
      MaskedTableSql("SELECT u.undo_id, u.applied_hash, {config}, t.data, t.{row_id} "
                     "FROM vgtw_mask_undo AS u LEFT JOIN {table} AS t ON t.{row_id} = u.row_id "
                     "WHERE u.table_name = '{table}' AND u.applied_hash IS NOT NULL",
                     table));
  while (query.Next()) {
    const int64_t applied_hash = query.Int(1);
    const bool is_gone = query.IsNull(4);
    if (is_gone || Fingerprint(query.Blob(3)) + query.Int(2) != applied_hash) {
      undo_ids.push_back(query.Int(0));
    }
  }
  return undo_ids;
}

using FirstRenumbered = std::map<ImageId, uint32_t>;

// Per image that lost keypoints, the first index that names another keypoint than in the original.
FirstRenumbered FindFirstRenumbered(SqliteConnection& connection) {
  FirstRenumbered first_renumbered;
  SqliteQuery query(connection,
                    "SELECT t.image_id, u.data, t.rows, t.cols, t.data FROM vgtw_mask_undo AS u "
                    "JOIN keypoints AS t ON t.image_id = u.row_id "
                    "WHERE u.table_name = 'keypoints'");
  while (query.Next()) {
    const ImageId image_id = CheckedId(query, 0, "image");
    const BlobBytes original = query.Blob(1);
    const MatrixBlob now = ReadKeypointsBlob(query, 2, image_id);
    const size_t row_bytes = now.cols * sizeof(float);
    uint32_t idx = 0;
    while (idx < now.rows && (idx + 1) * row_bytes <= original.size() &&
           std::memcmp(&original[idx * row_bytes], &now.bytes[idx * row_bytes], row_bytes) == 0) {
      ++idx;
    }
    first_renumbered[image_id] = idx;
  }
  return first_renumbered;
}

// Rows of pairs without an entry are as they were when masks were applied, or newer. Those that
// name a renumbered keypoint are newer: all that were there then have an entry.
std::vector<int64_t> FindNewerPairs(SqliteConnection& connection,
                                    const MaskedTable& table,
                                    const FirstRenumbered& first_renumbered) {
  std::vector<int64_t> pair_ids;
  const auto is_renumbered = [&](ImageId image_id, uint32_t idx) {
    const auto found = first_renumbered.find(image_id);
    return found != first_renumbered.end() && idx >= found->second;
  };
  SqliteQuery query(
      connection,
      MaskedTableSql("SELECT pair_id, rows, cols, data FROM {table} AS t WHERE NOT EXISTS "
                     "(SELECT 1 FROM vgtw_mask_undo "
                     "WHERE table_name = '{table}' AND row_id = t.pair_id)",
                     table));
  while (query.Next()) {
    const auto [image_id1, image_id2] = CheckedImageIds(query, query.Int(0));
    for (const auto& [idx1, idx2] : ReadMatchesBlob(query, 1, table.row_label)) {
      if (!is_renumbered(image_id1, idx1) && !is_renumbered(image_id2, idx2)) continue;
      pair_ids.push_back(query.Int(0));
      break;
    }
  }
  return pair_ids;
}

// The indices in half of their bytes; empty if one does not fit.
std::vector<uint16_t> PackIndices(BlobBytes indices) {
  std::vector<uint16_t> packed(indices.size() / sizeof(uint32_t));
  uint32_t all_bits = 0;
  for (size_t i = 0; i < packed.size(); ++i) {
    uint32_t index = 0;
    std::memcpy(&index, indices.data() + i * sizeof(index), sizeof(index));
    all_bits |= index;
    packed[i] = static_cast<uint16_t>(index);
  }
  if (all_bits > std::numeric_limits<uint16_t>::max()) packed.clear();
  return packed;
}

void CreateTable(SqliteConnection& connection) {
  connection.Execute(
      "CREATE TABLE vgtw_mask_undo (undo_id INTEGER PRIMARY KEY NOT NULL, "
      "table_name TEXT NOT NULL, row_id INTEGER NOT NULL, rows INTEGER NOT NULL, config INTEGER, "
      "applied_hash INTEGER, data BLOB, UNIQUE (table_name, row_id))");
}

}  // namespace

std::string MaskedTableSql(std::string text, const MaskedTable& table) {
  const auto replace = [&](std::string_view from, std::string_view to) {
    for (size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
      text.replace(at, from.size(), to);
    }
  };
  replace("{table}", table.name);
  replace("{row_id}", table.row_id);
  replace("{config}", table.has_config ? "t.config" : "0");
  return text;
}

bool HasMaskUndo(SqliteConnection& connection) {
  SqliteQuery query(connection, "SELECT 1 FROM sqlite_master WHERE name = 'vgtw_mask_undo'");
  return query.Next();
}

void MarkForeignRows(SqliteConnection& connection) {
  for (const MaskedTable& table : kMaskedTables) {
    for (const int64_t undo_id : FindChangedEntries(connection, table)) {
      connection.Execute("UPDATE vgtw_mask_undo SET applied_hash = NULL WHERE undo_id = ?",
                         undo_id);
    }
  }
  const FirstRenumbered first_renumbered = FindFirstRenumbered(connection);
  if (first_renumbered.empty()) return;
  for (const MaskedTable& table : {kMatchesTable, kTwoViewTable}) {
    for (const int64_t pair_id : FindNewerPairs(connection, table, first_renumbered)) {
      connection.Execute("INSERT INTO vgtw_mask_undo (table_name, row_id, rows) VALUES (?, ?, 0)",
                         std::string_view(table.name),
                         pair_id);
    }
  }
}

MaskedRow ReadOriginal(const SqliteQuery& query,
                       const MaskedTable& table,
                       int64_t row_id,
                       std::vector<uint32_t>& buffer) {
  const int64_t rows = query.Int(0);
  const BlobBytes data = query.Blob(2);
  MaskedRow original = {static_cast<size_t>(rows), data, query.Int(1)};
  const double num_values = static_cast<double>(rows) * static_cast<double>(query.Int(3));
  const auto num_bytes = static_cast<double>(data.size());
  if (num_bytes == num_values * static_cast<double>(table.bytes_per_value)) return original;
  if (!table.holds_indices || num_bytes != num_values * sizeof(uint16_t)) {
    Fail(query.path(),
         std::string("keeps ") + std::to_string(data.size()) + " bytes for " + table.row_label +
             " " + std::to_string(row_id),
         std::to_string(rows) + " rows",
         "restore it from a copy");
  }
  buffer.resize(data.size() / sizeof(uint16_t));
  for (size_t i = 0; i < buffer.size(); ++i) {
    uint16_t index = 0;
    std::memcpy(&index, data.data() + i * sizeof(index), sizeof(index));
    buffer[i] = index;
  }
  original.data = AsBlob(buffer);
  return original;
}

MaskUndo::MaskUndo(SqliteConnection& connection, bool keep)
    : connection_(connection), keep_(keep), has_table_(HasMaskUndo(connection)) {
  if (!has_table_) return;
  if (keep) {
    MarkForeignRows(connection);
  } else {
    connection.Execute("DROP TABLE vgtw_mask_undo");
  }
}

void MaskUndo::Keep(const MaskedTable& table,
                    int64_t row_id,
                    const MaskedRow& original,
                    int64_t applied_hash) {
  if (!has_table_) CreateTable(connection_);
  has_table_ = true;
  const std::vector<uint16_t> packed =
      table.holds_indices ? PackIndices(original.data) : std::vector<uint16_t>();
  connection_.Execute(
      "INSERT INTO vgtw_mask_undo (table_name, row_id, rows, config, applied_hash, data) "
      "VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (table_name, row_id) DO UPDATE "
      "SET applied_hash = excluded.applied_hash WHERE applied_hash IS NOT NULL",
      std::string_view(table.name),
      row_id,
      original.rows,
      original.config,
      applied_hash,
      packed.empty() ? original.data : AsBlob(packed));
}

void MaskUndo::Rewrite(const MaskedTable& table,
                       int64_t row_id,
                       const MaskedRow& original,
                       size_t rows,
                       BlobBytes data) {
  const int64_t config = rows == 0 ? 0 : original.config;
  connection_.Execute(table.update_sql, rows, data, config, row_id);
  if (keep_) Keep(table, row_id, original, Fingerprint(data) + config);
}

}  // namespace vgtw
