// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_schema.h"

#include "bridge/sqlite.h"
#include "scene/error.h"

#include <algorithm>
#include <initializer_list>
#include <set>

namespace vgtw {
namespace {

// What every version from 3.8 to 4.2.1 reads: the tables of 3.8 with its columns first, because up
// to 3.13 COLMAP reads some of them by position, then what later versions need. pose_priors has
// the layout of 3.11, which 4.x migrates; user_version 3900 makes it do so.
constexpr const char* kUniversalSchema = R"sql(
CREATE TABLE cameras (
  camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
  model INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL,
  params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (
  image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL
    CHECK (image_id >= 0 AND image_id < 2147483647),
  name TEXT NOT NULL UNIQUE,
  camera_id INTEGER NOT NULL REFERENCES cameras (camera_id),
  prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL,
  prior_tx REAL, prior_ty REAL, prior_tz REAL);
CREATE UNIQUE INDEX index_name ON images (name);
CREATE TABLE keypoints (
  image_id INTEGER PRIMARY KEY NOT NULL REFERENCES images (image_id) ON DELETE CASCADE,
  rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE descriptors (
  image_id INTEGER PRIMARY KEY NOT NULL REFERENCES images (image_id) ON DELETE CASCADE,
  rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, type INTEGER NOT NULL DEFAULT 0);
CREATE TABLE matches (
  pair_id INTEGER PRIMARY KEY NOT NULL,
  rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (
  pair_id INTEGER PRIMARY KEY NOT NULL,
  rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL,
  F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
CREATE TABLE pose_priors (
  image_id INTEGER PRIMARY KEY NOT NULL REFERENCES images (image_id) ON DELETE CASCADE,
  position BLOB, coordinate_system INTEGER NOT NULL, position_covariance BLOB);
CREATE TABLE rigs (
  rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
  ref_sensor_id INTEGER NOT NULL, ref_sensor_type INTEGER NOT NULL);
CREATE UNIQUE INDEX rig_ref_sensor_assignment ON rigs (ref_sensor_id, ref_sensor_type);
CREATE TABLE rig_sensors (
  rig_id INTEGER NOT NULL REFERENCES rigs (rig_id) ON DELETE CASCADE,
  sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL, sensor_from_rig BLOB);
CREATE UNIQUE INDEX rig_sensor_assignment ON rig_sensors (sensor_id, sensor_type);
CREATE TABLE frames (
  frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
  rig_id INTEGER NOT NULL REFERENCES rigs (rig_id) ON DELETE CASCADE);
CREATE TABLE frame_data (
  frame_id INTEGER NOT NULL REFERENCES frames (frame_id) ON DELETE CASCADE,
  data_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL);
CREATE UNIQUE INDEX frame_sensor_assignment ON frame_data (data_id, sensor_type);
PRAGMA user_version = 3900;
)sql";

struct RequiredTable {
  const char* name;
  std::initializer_list<const char*> columns;
};
constexpr RequiredTable kRequiredTables[] = {
    {"cameras", {"camera_id", "model", "width", "height", "params", "prior_focal_length"}},
    {"images", {"image_id", "name", "camera_id"}},
    {"keypoints", {"image_id", "rows", "cols", "data"}},
    {"descriptors", {"image_id", "rows", "cols", "data"}},
    {"matches", {"pair_id", "rows", "cols", "data"}},
    {"two_view_geometries", {"pair_id", "rows", "cols", "data", "config", "F", "E", "H"}},
};
constexpr RequiredTable kRigTables[] = {
    {"rigs", {"rig_id", "ref_sensor_id", "ref_sensor_type"}},
    {"rig_sensors", {"rig_id", "sensor_id", "sensor_type", "sensor_from_rig"}},
    {"frames", {"frame_id", "rig_id"}},
    {"frame_data", {"frame_id", "data_id", "sensor_id", "sensor_type"}},
};

std::set<std::string> ColumnsOf(SqliteConnection& connection, std::string_view table) {
  std::set<std::string> columns;
  SqliteQuery query(connection, "SELECT name FROM pragma_table_info(?)", table);
  while (query.Next()) columns.insert(query.Text(0));
  return columns;
}

void RequireTable(SqliteConnection& connection, const RequiredTable& table) {
  const std::set<std::string> columns = ColumnsOf(connection, table.name);
  const std::string expected = "a database of COLMAP 3.8 to 4.2";
  if (columns.empty()) {
    Fail(connection.path(), std::string("has no table '") + table.name + "'", expected);
  }
  for (const char* column : table.columns) {
    if (columns.contains(column)) continue;
    Fail(connection.path(),
         std::string("has no column '") + column + "' in table '" + table.name + "'",
         expected);
  }
}

bool HasRigTables(SqliteConnection& connection) {
  const auto exists = [&](const RequiredTable& table) {
    return !ColumnsOf(connection, table.name).empty();
  };
  if (std::none_of(std::begin(kRigTables), std::end(kRigTables), exists)) return false;
  for (const RequiredTable& table : kRigTables) RequireTable(connection, table);
  return true;
}

int UserVersion(SqliteConnection& connection) {
  SqliteQuery query(connection, "PRAGMA user_version");
  return query.Next() ? static_cast<int>(query.Int(0)) : 0;
}

const char* VersionName(const DatabaseSchema& schema) {
  if (schema.has_two_view_cameras) return "COLMAP 4.2";
  if (schema.has_pose_prior_data_ids) return "COLMAP 4.0-4.1";
  if (schema.has_image_priors && schema.has_rigs) return "schema for COLMAP 3.8-4.2";
  if (schema.has_rigs) return "COLMAP 3.12-3.13";
  if (schema.has_pose_prior_covariance) return "COLMAP 3.11";
  if (schema.has_pose_priors) return "COLMAP 3.10";
  if (schema.has_image_priors) return "COLMAP 3.8-3.9";
  return "COLMAP of unknown version";
}

}  // namespace

std::string DatabaseSchema::Describe() const {
  return std::string(VersionName(*this)) + " (user_version " + std::to_string(user_version) + ")";
}

DatabaseSchema RecogniseSchema(SqliteConnection& connection) {
  for (const RequiredTable& table : kRequiredTables) RequireTable(connection, table);
  const auto has = [&](const char* table, std::initializer_list<const char*> names) {
    const std::set<std::string> columns = ColumnsOf(connection, table);
    return std::all_of(
        names.begin(), names.end(), [&](const char* name) { return columns.contains(name); });
  };
  DatabaseSchema schema;
  schema.user_version = UserVersion(connection);
  schema.has_image_priors =
      has("images",
          {"prior_qw", "prior_qx", "prior_qy", "prior_qz", "prior_tx", "prior_ty", "prior_tz"});
  schema.has_pose_priors = has("pose_priors", {"position", "coordinate_system"});
  schema.has_pose_prior_covariance = has("pose_priors", {"position_covariance"});
  schema.has_pose_prior_data_ids =
      has("pose_priors", {"corr_data_id", "corr_sensor_id", "corr_sensor_type", "gravity"});
  schema.has_rigs = HasRigTables(connection);
  schema.has_descriptor_type = has("descriptors", {"type"});
  schema.has_two_view_cameras = has("two_view_geometries", {"camera1", "camera2"});
  schema.has_two_view_poses = has("two_view_geometries", {"qvec", "tvec"});
  return schema;
}

void CreateUniversalSchema(SqliteConnection& connection) {
  connection.ExecuteScript(kUniversalSchema);
}

}  // namespace vgtw
