// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/new_database.h"

#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

void AddCamera(ColmapDatabase& database, CameraId camera_id) {
  ColmapDatabase::Transaction transaction(database);
  Camera camera = MakePinhole(64, 48, 50.0, 50.0);
  camera.camera_id = camera_id;
  database.WriteCamera(camera);
  transaction.Commit();
}

size_t NumCameras(const fs::path& path) {
  return ColmapDatabase(path, ColmapDatabase::Mode::kReadOnly).ReadCameras().size();
}

size_t NumFiles(const fs::path& folder) {
  return static_cast<size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(NewDatabase, AppearsWhenItIsComplete) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "new.db";
  NewDatabase target(path, /*overwrite=*/false);
  AddCamera(target.database(), 1);
  EXPECT_FALSE(fs::exists(path));
  target.Commit();
  EXPECT_EQ(NumCameras(path), 1u);
  EXPECT_EQ(NumFiles(folder.path()), 1u);
}

TEST(NewDatabase, WithoutCommitNothingIsLeft) {
  const TemporaryFolder folder;
  {
    NewDatabase target(folder.path() / "new.db", /*overwrite=*/false);
    AddCamera(target.database(), 1);
  }
  EXPECT_EQ(NumFiles(folder.path()), 0u);
}

TEST(NewDatabase, CopyLeavesItsSourceAsItIs) {
  const TemporaryFolder folder;
  const fs::path source_path = folder.path() / "source.db";
  {
    ColmapDatabase source = ColmapDatabase::Create(source_path);
    AddCamera(source, 1);
  }
  NewDatabase copy(folder.path() / "copy.db", /*overwrite=*/false, source_path);
  AddCamera(copy.database(), 2);
  copy.Commit();
  EXPECT_EQ(NumCameras(source_path), 1u);
  EXPECT_EQ(NumCameras(folder.path() / "copy.db"), 2u);
}

TEST(NewDatabase, RefusesWhatIsThereAndWhatIsNone) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "a.db";
  AddCamera(*std::make_unique<ColmapDatabase>(ColmapDatabase::Create(path)), 1);
  EXPECT_THAT(ErrorOf([&] { NewDatabase(path, false); }), testing::HasSubstr("exists"));
  EXPECT_THAT(ErrorOf([&] { NewDatabase(path, true, path); }),
              testing::HasSubstr("is the database to be read"));
  const fs::path text = folder.path() / "text.db";
  std::ofstream(text) << "no database";
  EXPECT_THAT(ErrorOf([&] { NewDatabase(folder.path() / "b.db", false, text); }),
              testing::HasSubstr("text.db"));
  EXPECT_EQ(NumCameras(path), 1u);
  EXPECT_EQ(NumFiles(folder.path()), 2u);
}

}  // namespace
}  // namespace vgtw
