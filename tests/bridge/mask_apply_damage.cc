// SPDX-License-Identifier: BSD-3-Clause
// Damaged databases and masks: a one-line Error that says what is wrong, and no changed byte.
#include "bridge/mask_apply.h"
#include "scene/files.h"
#include "tests/bridge/sample_databases.h"
#include "tests/bridge/sample_masks.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

struct Damage {
  const char* name;
  // Spoils what lies in the folder: a.db and masks/.
  std::function<void(const fs::path& folder)> spoil;
  const char* error;
};
void PrintTo(const Damage& damage, std::ostream* stream) { *stream << damage.name; }

std::function<void(const fs::path&)> Sql(const char* sql) {
  return [sql](const fs::path& folder) { RunSql(folder / "a.db", sql); };
}

std::function<void(const fs::path&)> Truncate(const char* name, uint64_t size) {
  return [name, size](const fs::path& folder) { fs::resize_file(folder / name, size); };
}

std::function<void(const fs::path&)> Bytes(const char* name, std::string bytes) {
  return [name, bytes](const fs::path& folder) { WriteFileAtomically(folder / name, bytes); };
}

const Damage kDamages[] = {
    {"NoDatabase", [](const fs::path& folder) { fs::remove(folder / "a.db"); }, "does not exist"},
    {"EmptyFile", Truncate("a.db", 0), "a.db: is empty"},
    {"NotADatabase", Bytes("a.db", std::string(5000, 'x')), "a.db: is not an SQLite file"},
    {"HeaderOnly", Truncate("a.db", 60), "a.db: is not an SQLite file"},
    {"Truncated", Truncate("a.db", 20480), "a.db: is damaged or truncated"},
    {"PagesOverwritten",
     [](const fs::path& folder) {
       std::string bytes = ReadFile(folder / "a.db");
       std::fill(bytes.begin() + 100, bytes.end(), '\xff');
       WriteFileAtomically(folder / "a.db", bytes);
     },
     "a.db: is damaged or truncated"},
    {"AFolder",
     [](const fs::path& folder) {
       fs::remove(folder / "a.db");
       fs::create_directory(folder / "a.db");
     },
     "a.db: is not a file"},
    {"NoTable", Sql("DROP TABLE two_view_geometries"), "has no table 'two_view_geometries'"},
    {"NoColumn", Sql("ALTER TABLE matches RENAME COLUMN data TO d"), "has no column 'data'"},
    {"KeypointBlobTooShort",
     Sql("UPDATE keypoints SET rows = 5 WHERE image_id = 1"),
     "keypoints of image 1 has 5 rows, 2 columns and 32 bytes"},
    {"KeypointCountsOverflow",
     Sql("UPDATE keypoints SET rows = 4611686018427387912, cols = 4 WHERE image_id = 1"),
     "keypoints of image 1 has 4611686018427387912 rows"},
    {"KeypointColumns",
     Sql("UPDATE keypoints SET rows = 8, cols = 1 WHERE image_id = 1"),
     "keypoints of image 1 have 1 columns"},
    {"MatchBlobMissing",
     Sql("UPDATE matches SET data = NULL WHERE pair_id = 2147483649"),
     "matches of images 1 and 2 has 5 rows, 2 columns and 0 bytes"},
    {"MatchIndexTooLarge",
     Sql("UPDATE matches SET rows = 1, data = x'0000000004000000' WHERE pair_id = 2147483650"),
     "matches of images 1 and 3: keypoint 4 of 'c d.jpg', expected less than its 4 keypoints"},
    {"InlierIndexTooLarge",
     Sql("UPDATE two_view_geometries SET rows = 1, data = x'FFFFFFFF00000000' "
         "WHERE pair_id = 2147483649"),
     "two-view geometry of images 1 and 2: keypoint 4294967295 of 'a.jpg'"},
    {"PairOfNoImage",
     Sql("UPDATE matches SET pair_id = 2147483656 WHERE pair_id = 2147483650"),
     "matches of images 1 and 9: no image 9"},
    {"PairIdOfNothing",
     Sql("UPDATE matches SET pair_id = -7 WHERE pair_id = 2147483650"),
     "holds pair id -7"},
    {"ImageWithoutCamera",
     Sql("UPDATE images SET camera_id = 77 WHERE image_id = 3"),
     "has an image without a camera: c d.jpg"},
    {"ImageNameLeavesTheFolder",
     Sql("UPDATE images SET name = '../../x.jpg' WHERE image_id = 3"),
     "names an image '../../x.jpg'"},
    {"NoMaskFolder",
     [](const fs::path& folder) { fs::remove_all(folder / "masks"); },
     "masks: is not a folder"},
    {"MaskMissing",
     [](const fs::path& folder) { fs::remove(folder / "masks/sub/b.png.png"); },
     "sub/b.png.png: is missing"},
    {"MaskHalfSize",
     [](const fs::path& folder) {
       WriteImage(folder / "masks/a.jpg.png", StaticMask(50, 40, 255));
     },
     "a.jpg.png: has 50 x 40 pixels, expected 100 x 80 pixels"},
    {"MaskTruncated", Truncate("masks/a.jpg.png", 60), "a.jpg.png: "},
    {"MaskNoImage", Bytes("masks/a.jpg.png", "<html>404</html>"), "a.jpg.png: "},
};

class DamagedInput : public testing::TestWithParam<Damage> {};

TEST_P(DamagedInput, GivesOneLineAndChangesNothing) {
  const TemporaryFolder folder;
  MakeSampleDatabase(folder / "a.db");
  WriteSampleMasks(folder / "masks");
  GetParam().spoil(folder.path());
  const auto before = Snapshot(folder.path());
  const std::string copy_error =
      ErrorOf([&] { ApplyMasks(folder / "a.db", folder / "masks", folder / "b.db", {}); });
  EXPECT_THAT(copy_error, HasSubstr(GetParam().error));
  EXPECT_THAT(copy_error, Not(HasSubstr(".tmp-")));  // names what the user has
  EXPECT_TRUE(Snapshot(folder.path()) == before);
  const std::string in_place_error =
      ErrorOf([&] { ApplyMasks(folder / "a.db", folder / "masks", "", {.in_place = true}); });
  EXPECT_THAT(in_place_error, HasSubstr(GetParam().error));
  EXPECT_TRUE(Snapshot(folder.path()) == before);
}
INSTANTIATE_TEST_SUITE_P(All, DamagedInput, testing::ValuesIn(kDamages), [](const auto& info) {
  return std::string(info.param.name);
});

// Reads of ColmapDatabase that ApplyMasks does not make.
TEST(DamagedDatabase, ReadsNameTheRow) {
  const TemporaryFolder folder;
  MakeSampleDatabase(folder / "a.db");
  const auto error_of = [&](const char* sql, const auto& read) {
    RunSql(folder / "a.db", sql);
    const ColmapDatabase database(folder / "a.db", ColmapDatabase::Mode::kReadOnly);
    return ErrorOf([&] { read(database); });
  };
  EXPECT_THAT(error_of("UPDATE cameras SET model = 11", [](const auto& db) { db.ReadCameras(); }),
              HasSubstr("camera 1 has model id 11"));
  EXPECT_THAT(error_of("UPDATE cameras SET model = 1, params = zeroblob(9)",
                       [](const auto& db) { db.ReadCameras(); }),
              HasSubstr("camera 1 has parameters of 9 bytes"));
  EXPECT_THAT(error_of("UPDATE cameras SET params = zeroblob(24)",
                       [](const auto& db) { db.ReadCameras(); }),
              HasSubstr("camera 1: "));
  EXPECT_THAT(
      error_of("UPDATE descriptors SET cols = 3", [](const auto& db) { db.ReadDescriptors(1); }),
      HasSubstr("descriptors of image 1 has 4 rows, 3 columns and 8 bytes"));
  EXPECT_THAT(error_of("UPDATE two_view_geometries SET F = zeroblob(71)",
                       [](const auto& db) { db.ReadTwoViewGeometry(1, 2); }),
              HasSubstr("two-view geometry of images 1 and 2 has a blob of 71 bytes"));
  EXPECT_THAT(error_of("INSERT INTO pose_priors VALUES (1, zeroblob(8), 1, NULL)",
                       [](const auto& db) { db.ReadPosePriors(); }),
              HasSubstr("pose prior of image 1 has a blob of 8 bytes"));
  EXPECT_THAT(error_of("INSERT INTO rig_sensors VALUES (1, 5, 0, zeroblob(56))",
                       [](const auto& db) { db.ReadRigs(); }),
              HasSubstr("rig 1 has an invalid pose"));
  EXPECT_THAT(error_of("INSERT INTO frame_data VALUES (99, 1, 1, 1)",
                       [](const auto& db) { db.ReadFrames(); }),
              HasSubstr("frame_data names id 99"));
}

}  // namespace
}  // namespace vgtw
