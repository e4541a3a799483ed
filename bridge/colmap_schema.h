// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"

namespace vgtw {

class SqliteConnection;

// Reads the schema from the tables and their columns. Throws Error if a table or column is missing
// that all of COLMAP's versions have, or if only some of the four rig tables are there.
DatabaseSchema RecogniseSchema(SqliteConnection& connection);

// Makes the tables of ColmapDatabase::Create in an empty file.
void CreateUniversalSchema(SqliteConnection& connection);

}  // namespace vgtw
