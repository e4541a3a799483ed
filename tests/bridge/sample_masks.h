// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/mask_files.h"
#include "bridge/sqlite.h"
#include "scene/image_io.h"

#include <filesystem>
#include <string>

namespace vgtw {

// Three images of 100 x 80 pixels with the keypoints 0 (10.5, 10.5), 1 (99.9, 79.9), 2 (50, 40),
// 3 (20.25, 70.75); image 2 has a fifth one outside of its frame. Matches and geometries between
// them: before the masks below 12 and 4 rows, after them 4 and 1.
inline void MakeSampleDatabase(const std::filesystem::path& path) {
  Camera camera = MakePinhole(100, 80, 90.0, 90.0);
  camera.camera_id = 1;
  ColmapDatabase database = ColmapDatabase::Create(path);
  ColmapDatabase::Transaction transaction(database);
  database.WriteCamera(camera);
  database.WriteImage({1, "a.jpg", 1});
  database.WriteImage({2, "sub/b.png", 1});
  database.WriteImage({3, "c d.jpg", 1});
  database.WriteKeypoints(1, {4, 2, {10.5f, 10.5f, 99.9f, 79.9f, 50.0f, 40.0f, 20.25f, 70.75f}});
  database.WriteKeypoints(
      2, {5, 2, {10.5f, 10.5f, 99.9f, 79.9f, 50.0f, 40.0f, 20.25f, 70.75f, 150.0f, 10.0f}});
  database.WriteKeypoints(
      3,
      {4, 4, {10.5f, 10.5f, 1, 0, 99.9f, 79.9f, 1, 0, 50.0f, 40.0f, 1, 0, 20.25f, 70.75f, 1, 0}});
  database.WriteDescriptors(1, {4, 2, 0, {1, 2, 3, 4, 5, 6, 7, 8}});
  database.WriteMatches(1, 2, {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {1, 1}});
  database.WriteMatches(1, 3, {{0, 0}, {1, 1}, {2, 2}, {1, 0}});
  database.WriteMatches(2, 3, {{0, 1}, {0, 2}, {4, 0}});
  TwoViewGeometry geometry{.config = 2, .inlier_matches = {{1, 1}, {3, 3}}};
  geometry.F = Eigen::Matrix3d{{1, 2, 3}, {4, 5, 6}, {7, 8, 10}};
  database.WriteTwoViewGeometry(1, 2, geometry);
  geometry.inlier_matches = {{0, 1}, {4, 0}};
  database.WriteTwoViewGeometry(2, 3, geometry);
  database.WriteTrivialRigsAndFrames();
  transaction.Commit();
}

// Excludes the columns x < 50 of a.jpg, nothing of sub/b.png, the rows y >= 40 of "c d.jpg".
inline void WriteSampleMasks(const std::filesystem::path& mask_folder) {
  StaticMask left(100, 80, 255);
  StaticMask lower(100, 80, 255);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 100; ++x) {
      if (x < 50) left(x, y) = 0;
      if (y >= 40) lower(x, y) = 0;
    }
  }
  WriteImage(MaskPath(mask_folder, "a.jpg"), left);
  WriteImage(MaskPath(mask_folder, "sub/b.png"), StaticMask(100, 80, 255));
  WriteImage(MaskPath(mask_folder, "c d.jpg"), lower);
}

// Every row of every table as text: two databases with the same text hold the same.
inline std::string DumpRows(const std::filesystem::path& path) {
  SqliteConnection connection(path, SqliteConnection::Mode::kReadOnly);
  std::string dump;
  SqliteQuery tables(connection,
                     "SELECT m.name, group_concat('quote(' || c.name || ')', ' || '' '' || ') "
                     "FROM sqlite_master AS m JOIN pragma_table_info(m.name) AS c "
                     "WHERE m.type = 'table' GROUP BY m.name ORDER BY m.name");
  while (tables.Next()) {
    const std::string name = tables.Text(0);
    SqliteQuery rows(connection, "SELECT " + tables.Text(1) + " FROM " + name + " ORDER BY 1");
    while (rows.Next()) dump += name + ": " + rows.Text(0) + "\n";
  }
  return dump;
}

}  // namespace vgtw
