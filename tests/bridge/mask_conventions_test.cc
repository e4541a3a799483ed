// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_conventions.h"

#include "scene/files.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

void Touch(const std::filesystem::path& path) {
  std::filesystem::create_directories(path.parent_path());
  WriteFileAtomically(path, "");
}

// Of a photo with a sub-folder, a space, two dots and a capital extension, as each tool's code or
// manual builds it. It is frame 1, because base names are compared: "A" comes before "b".
TEST(MaskNames, AreThoseThatTheToolsLookFor) {
  const std::map<std::string_view, std::string> expected = {
      {"colmap", "day 1/b.x.JPG.png"},
      {"vggsfm", "day 1/b.x.JPG"},
      {"nerfstudio", "day 1/b.x.png"},
      {"3dgrut", "day 1/b.x_mask.png"},
      {"openmvs", "day 1/b.x.mask.png"},
      {"realitycapture", "day 1/b.x.JPG.mask.png"},
      {"realitycapture_folder", "day 1/.mask/b.x.png"},
      {"odm", "b.x_mask.png"},
      {"instant-ngp", "day 1/dynamic_mask_b.x.png"},
      {"opensfm", "b.x.JPG.png"},
      {"openmvg", "b.x_mask.png"},
      {"metashape", "b.x_mask.png"},
      {"meshroom", "b.x.png"},
      {"sam2", "day 1/b.x.png"},
      {"sam2_objects", "*/b.x.png"},
      {"monst3r", "dynamic_mask_1.png"},
      {"easi3r", "dynamic_mask_1.png"}};
  ASSERT_EQ(MaskConventions().size(), expected.size());
  for (const MaskConvention& convention : MaskConventions()) {
    EXPECT_EQ(MaskNames(convention, {"day 1/b.x.JPG", "z/A.jpg"}).front(),
              expected.at(convention.id))
        << convention.id;
  }
}

TEST(MaskConventions, EveryRowIsComplete) {
  std::set<std::string_view> ids;
  for (const MaskConvention& convention : MaskConventions()) {
    EXPECT_TRUE(ids.insert(convention.id).second) << convention.id;
    EXPECT_FALSE(convention.tool.empty()) << convention.id;
    EXPECT_FALSE(convention.source.empty()) << convention.id;
    EXPECT_EQ(convention.setting.empty(), !convention.writable) << convention.id;
    EXPECT_EQ(&GetMaskConvention(convention.id), &convention);
  }
}

TEST(GetMaskConvention, NamesTheKnownOnes) {
  const std::string error = ErrorOf([] { GetMaskConvention("colmpa"); });
  EXPECT_THAT(error, HasSubstr("unknown mask convention 'colmpa'"));
  EXPECT_THAT(error, HasSubstr("colmap, vggsfm, nerfstudio"));
}

TEST(FindMasks, TakesTheFirstNameThatIsThere) {
  const TemporaryFolder folder;
  for (const char* name : {"a.jpg.png", "a.png", "sub/b.png"}) Touch(folder / name);
  const auto files =
      FindMasks(GetMaskConvention("colmap"), folder.path(), {"a.jpg", "c.jpg", "sub/b.jpg"});
  ASSERT_EQ(files.size(), 3u);
  EXPECT_THAT(files[0], ElementsAre(folder / "a.jpg.png"));
  EXPECT_TRUE(files[1].empty());
  EXPECT_THAT(files[2], ElementsAre(folder / "sub/b.png"));
}

TEST(FindMasks, GathersTheFoldersOfObjects) {
  const TemporaryFolder folder;
  for (const char* name : {"001/a.png", "002/a.png", "002/b.png", "a.png"}) Touch(folder / name);
  const auto files =
      FindMasks(GetMaskConvention("sam2_objects"), folder.path(), {"a.jpg", "b.jpg"});
  EXPECT_THAT(files[0], ElementsAre(folder / "001/a.png", folder / "002/a.png"));
  EXPECT_THAT(files[1], ElementsAre(folder / "002/b.png"));
}

TEST(FindMasks, OneFileForTwoPhotosIsAnError) {
  const TemporaryFolder folder;
  Touch(folder / "a.png");
  const std::string error = ErrorOf([&] {
    FindMasks(GetMaskConvention("nerfstudio"), folder.path(), {"a.jpg", "a.png"});
  });
  EXPECT_THAT(error, HasSubstr("a.png: is the mask of two photos, a.jpg and a.png"));
}

TEST(FindMasks, TheFolderMustExist) {
  EXPECT_THAT(ErrorOf([] { FindMasks(GetMaskConvention("colmap"), "/none", {"a.jpg"}); }),
              HasSubstr("/none: is not a folder"));
}

TEST(GuessConvention, IsTheOneThatFindsMost) {
  const std::vector<std::string> names = {"a.jpg", "b.jpg", "sub/c.jpg"};
  for (const char* id : {"colmap",
                         "vggsfm",
                         "nerfstudio",
                         "3dgrut",
                         "openmvs",
                         "realitycapture",
                         "realitycapture_folder",
                         "instant-ngp",
                         "sam2_objects",
                         "monst3r"}) {
    const TemporaryFolder folder;
    const MaskConvention& convention = GetMaskConvention(id);
    for (const std::string& name : MaskNames(convention, names)) {
      Touch(folder / (name.starts_with("*") ? "001" + name.substr(1) : name));
    }
    const auto guess = GuessConvention(folder.path(), names);
    ASSERT_TRUE(guess) << id;
    EXPECT_EQ(guess->num_found, 3u) << id;
    // COLMAP also takes names without the photo's extension, and comes first.
    EXPECT_EQ(guess->convention->id, std::string_view(id) == "nerfstudio" ? "colmap" : id);
  }
}

TEST(GuessConvention, IsNothingWhereNoneFindsAny) {
  const TemporaryFolder folder;
  Touch(folder / "other.png");
  EXPECT_FALSE(GuessConvention(folder.path(), {"a.jpg"}));
  for (const MaskCount& count : CountMasks(folder.path(), {"a.jpg"})) {
    EXPECT_EQ(count.num_found, 0u) << count.convention->id;
  }
}

}  // namespace
}  // namespace vgtw
