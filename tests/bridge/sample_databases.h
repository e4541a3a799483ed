// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/sqlite.h"

#include <filesystem>
#include <string>

namespace vgtw {

// The tables of one version of COLMAP: what differs between versions is a member.
struct VersionTables {
  const char* version;  // as in DatabaseSchema::Describe()
  int user_version;
  const char* image_columns;
  const char* pose_priors;
  bool has_rigs;
  const char* descriptor_type;
  const char* two_view_columns;
};

inline constexpr const char* kPriorColumns =
    ", prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL"
    ", prior_tx REAL, prior_ty REAL, prior_tz REAL";
inline constexpr const char* kPosePriors310 =
    "CREATE TABLE pose_priors (image_id INTEGER PRIMARY KEY NOT NULL, position BLOB,"
    " coordinate_system INTEGER NOT NULL);";
inline constexpr const char* kPosePriors311 =
    "CREATE TABLE pose_priors (image_id INTEGER PRIMARY KEY NOT NULL, position BLOB,"
    " coordinate_system INTEGER NOT NULL, position_covariance BLOB);";
inline constexpr const char* kPosePriors40 =
    "CREATE TABLE pose_priors (pose_prior_id INTEGER PRIMARY KEY NOT NULL,"
    " corr_data_id INTEGER NOT NULL, corr_sensor_id INTEGER NOT NULL,"
    " corr_sensor_type INTEGER NOT NULL, position BLOB, position_covariance BLOB, gravity BLOB,"
    " coordinate_system INTEGER NOT NULL);"
    "CREATE UNIQUE INDEX pose_prior_data_assignment ON"
    " pose_priors (corr_data_id, corr_sensor_id, corr_sensor_type);";

inline constexpr VersionTables kVersions[] = {
    {"COLMAP 3.8-3.9", 3800, kPriorColumns, "", false, "", ""},
    {"COLMAP 3.10", 3900, "", kPosePriors310, false, "", ""},
    {"COLMAP 3.11", 3900, "", kPosePriors311, false, "", ""},
    {"COLMAP 3.12-3.13", 3900, "", kPosePriors311, true, "", ""},
    {"COLMAP 4.0-4.1", 4000000, "", kPosePriors40, true, "type INTEGER NOT NULL, ", ""},
    {"COLMAP 4.2",
     4020100,
     "",
     kPosePriors40,
     true,
     "type INTEGER NOT NULL, ",
     ", camera1 BLOB, camera2 BLOB"},
};

inline std::string SchemaSql(const VersionTables& tables) {
  std::string sql =
      "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
      " model INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB,"
      " prior_focal_length INTEGER NOT NULL);"
      "CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
      " name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL" +
      std::string(tables.image_columns) +
      ");"
      "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,"
      " cols INTEGER NOT NULL, data BLOB);"
      "CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, " +
      tables.descriptor_type +
      "rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);"
      "CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,"
      " cols INTEGER NOT NULL, data BLOB);"
      "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL,"
      " rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL,"
      " F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB" +
      tables.two_view_columns + ");" + tables.pose_priors;
  if (tables.has_rigs) {
    sql +=
        "CREATE TABLE rigs (rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
        " ref_sensor_id INTEGER NOT NULL, ref_sensor_type INTEGER NOT NULL);"
        "CREATE TABLE rig_sensors (rig_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL,"
        " sensor_type INTEGER NOT NULL, sensor_from_rig BLOB);"
        "CREATE TABLE frames (frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
        " rig_id INTEGER NOT NULL);"
        "CREATE TABLE frame_data (frame_id INTEGER NOT NULL, data_id INTEGER NOT NULL,"
        " sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL);";
  }
  return sql + "PRAGMA user_version = " + std::to_string(tables.user_version) + ";";
}

inline void RunSql(const std::filesystem::path& path, const std::string& sql) {
  SqliteConnection(path, SqliteConnection::Mode::kPrivate).ExecuteScript(sql);
}

}  // namespace vgtw
