// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_schema.h"

#include "tests/bridge/sample_databases.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;
using Mode = SqliteConnection::Mode;

TEST(DatabaseSchema, EveryVersionIsRecognisedByItsColumns) {
  const TemporaryFolder folder;
  for (const VersionTables& tables : kVersions) {
    const auto path = folder / (std::string(tables.version) + ".db");
    RunSql(path, SchemaSql(tables) + "PRAGMA user_version = 7;");
    SqliteConnection connection(path, Mode::kReadOnly);
    const DatabaseSchema schema = RecogniseSchema(connection);
    EXPECT_EQ(schema.Describe(), std::string(tables.version) + " (user_version 7)");
    EXPECT_EQ(schema.has_rigs, tables.has_rigs) << tables.version;
    EXPECT_EQ(schema.has_descriptor_type, *tables.descriptor_type != '\0') << tables.version;
    EXPECT_EQ(schema.has_image_priors, *tables.image_columns != '\0') << tables.version;
    EXPECT_TRUE(schema.has_two_view_poses) << tables.version;
  }
}

TEST(DatabaseSchema, TheUniversalOneHasWhatEachVersionNeeds) {
  const TemporaryFolder folder;
  SqliteConnection connection(folder / "a.db", Mode::kPrivate);
  CreateUniversalSchema(connection);
  const DatabaseSchema schema = RecogniseSchema(connection);
  EXPECT_EQ(schema.Describe(), "schema for COLMAP 3.8-4.2 (user_version 3900)");
  EXPECT_TRUE(schema.has_image_priors);
  EXPECT_TRUE(schema.has_pose_prior_covariance);
  EXPECT_FALSE(schema.has_pose_prior_data_ids);
  EXPECT_TRUE(schema.has_rigs);
  EXPECT_TRUE(schema.has_descriptor_type);
  EXPECT_FALSE(schema.has_two_view_cameras);
}

TEST(DatabaseSchema, AMissingTableOrColumnIsNamed) {
  const TemporaryFolder folder;
  const auto error_after = [&](const std::string& sql) {
    std::filesystem::remove(folder / "a.db");
    RunSql(folder / "a.db", SchemaSql(kVersions[3]) + sql);
    SqliteConnection connection(folder / "a.db", Mode::kReadOnly);
    return ErrorOf([&] { RecogniseSchema(connection); });
  };
  EXPECT_THAT(error_after("DROP TABLE matches;"), HasSubstr("has no table 'matches'"));
  EXPECT_THAT(error_after("ALTER TABLE cameras DROP COLUMN params;"),
              HasSubstr("has no column 'params' in table 'cameras'"));
  EXPECT_THAT(error_after("DROP TABLE frame_data;"), HasSubstr("has no table 'frame_data'"));
}

}  // namespace
}  // namespace vgtw
