// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/colmap_rows.h"
#include "bridge/sqlite.h"
#include "scene/error.h"

#include <bit>

namespace vgtw {

// Blobs are copied as they stand in memory; COLMAP's are little-endian on every machine it runs on.
static_assert(std::endian::native == std::endian::little);

struct ColmapDatabase::Impl {
  SqliteConnection connection;
  DatabaseSchema schema;

  // For the first line of every function that writes.
  SqliteConnection& Writable() {
    VGTW_CHECK(!connection.is_read_only(), "the database was opened for reading only");
    VGTW_CHECK(connection.InTransaction(), "writes need a ColmapDatabase::Transaction");
    return connection;
  }
};

// COLMAP's order of a pose in blobs.
inline std::array<double, 4> ToWxyz(const Eigen::Quaterniond& rotation) {
  return {rotation.w(), rotation.x(), rotation.y(), rotation.z()};
}

}  // namespace vgtw
