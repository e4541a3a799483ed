// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_convert.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/scene/exif_jpeg.h"
#include "tests/support/bytes.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

StaticMask RandomMask(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  StaticMask static_mask(width, height, 0);
  for (uint8_t& value : static_mask.data()) value = random() % 2 == 0 ? 0 : 255;
  return static_mask;
}

// A JPEG whose EXIF says how it is turned.
void WriteTurnedPhoto(const fs::path& path, int width, int height, uint32_t orientation) {
  WriteImage(path, GrayImage(width, height, 90));
  WriteFileAtomically(path, InsertExif(ReadFile(path), MakeExif({.orientation = orientation})));
}

// Photos of several sizes, one per name, and a COLMAP mask with noise for each.
void WritePhotosAndMasks(const TemporaryFolder& folder, const std::vector<std::string>& names) {
  int width = 13;
  for (const std::string& name : names) {
    WriteImage(folder / "photos" / name, GrayImage(width, 9, 90));
    WriteImage(folder / "masks" / (name + ".png"),
               RandomMask(width, 9, static_cast<unsigned>(width)));
    ++width;
  }
}

std::vector<MaskSummary> Convert(const TemporaryFolder& folder,
                                 const std::string& mask_folder,
                                 const std::string& from,
                                 const std::string& to,
                                 const std::string& output_folder) {
  return ConvertMasks(folder / "photos",
                      folder / mask_folder,
                      folder / output_folder,
                      {.from = from, .to = to, .num_threads = 2});
}

std::string ErrorOfConvert(const TemporaryFolder& folder,
                           const std::string& from,
                           const std::string& to) {
  const std::string error = ErrorOf([&] { Convert(folder, "masks", from, to, "out"); });
  EXPECT_FALSE(fs::exists(folder / "out"));
  return error;
}

TEST(ConvertMasks, ThereAndBackEveryByteIsTheSame) {
  const TemporaryFolder with_spaces;
  const TemporaryFolder without_spaces;
  for (const TemporaryFolder* folder : {&with_spaces, &without_spaces}) {
    const std::string space = folder == &with_spaces ? " " : "_";
    WritePhotosAndMasks(*folder,
                        {"IMG" + space + "1.2.JPG", "day" + space + "1/b.jpeg", "d/e/c..x.PNG"});
    for (const uint32_t orientation : {3, 6, 8}) {
      const std::string name = "turned_" + std::to_string(orientation) + ".jpg";
      WriteTurnedPhoto(*folder / "photos" / name, 11, 6, orientation);
      WriteImage(*folder / "masks" / (name + ".png"), RandomMask(11, 6, orientation));
    }
  }
  for (const MaskConvention& convention : MaskConventions()) {
    if (!convention.writable) continue;
    const std::string id(convention.id);
    const TemporaryFolder& folder = convention.allows_spaces ? with_spaces : without_spaces;
    Convert(folder, "masks", "colmap", id, id + "_there");
    Convert(folder, id + "_there", id, "colmap", id + "_back");
    EXPECT_EQ(Snapshot(folder / (id + "_back")), Snapshot(folder / "masks")) << id;

    const std::vector<std::string> written = MaskNames(convention, ListImages(folder / "photos"));
    std::set<std::string> found;
    for (const auto& [name, bytes] : Snapshot(folder / (id + "_there"))) {
      found.insert(name);
      EXPECT_TRUE(bytes.starts_with("\x89PNG")) << name;
    }
    EXPECT_EQ(found, std::set<std::string>(written.begin(), written.end())) << id;
  }
}

// The value of an excluded pixel in the tool's file; a kept one has the other.
TEST(ConvertMasks, WritesThePolarityOfTheTool) {
  const TemporaryFolder folder;
  WriteImage(folder / "photos/a.jpg", GrayImage(2, 1, 90));
  StaticMask static_mask(2, 1, 255);
  static_mask(0, 0) = 0;
  WriteImage(folder / "masks/a.jpg.png", static_mask);
  for (const MaskConvention& convention : MaskConventions()) {
    if (!convention.writable) continue;
    const std::string id(convention.id);
    const uint8_t excluded = id == "vggsfm" || id == "instant-ngp" ? 255 : 0;
    Convert(folder, "masks", "colmap", id, id);
    const auto files = FindMasks(convention, folder / id, {"a.jpg"});
    ASSERT_EQ(files[0].size(), 1u) << id;
    const RgbImage pixels = ReadRgbImage(files[0][0]);
    EXPECT_EQ(pixels(0, 0)[0], excluded) << id;
    EXPECT_EQ(pixels(1, 0)[0], 255 - excluded) << id;
  }
}

TEST(ConvertMasks, TurnsMasksUprightForToolsThatDo) {
  const TemporaryFolder folder;
  WriteTurnedPhoto(folder / "photos/a.jpg", 4, 2, 6);  // seen turned by 90 deg clockwise
  StaticMask static_mask(4, 2, 255);
  static_mask(3, 0) = 0;  // top right, so bottom right when seen
  WriteImage(folder / "masks/a.jpg.png", static_mask);
  Convert(folder, "masks", "colmap", "opensfm", "opensfm");
  StaticMask upright(2, 4, 255);
  upright(1, 3) = 0;
  EXPECT_EQ(ReadStaticMask(folder / "opensfm/a.jpg.png"), upright);
  Convert(folder, "masks", "colmap", "nerfstudio", "nerfstudio");
  EXPECT_EQ(ReadStaticMask(folder / "nerfstudio/a.png"), static_mask);
}

TEST(ConvertMasks, APhotoWithoutAMaskIsKept) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"a.jpg", "b.jpg"});
  fs::remove(folder / "masks/b.jpg.png");
  const auto summaries = Convert(folder, "masks", "colmap", "instant-ngp", "out");
  ASSERT_EQ(summaries.size(), 2u);
  EXPECT_FALSE(summaries[0].was_missing);
  EXPECT_EQ(summaries[0].excluded_share, ExcludedShare(RandomMask(13, 9, 13)));
  EXPECT_TRUE(summaries[1].was_missing);
  EXPECT_EQ(ReadStaticMask(folder / "out/dynamic_mask_b.png"), StaticMask(14, 9, 0));
}

TEST(ConvertMasks, AMissingMaskIsAnErrorWhereTheToolNeedsAll) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"a.jpg", "b.jpg"});
  Convert(folder, "masks", "colmap", "nerfstudio", "nerfstudio");
  fs::remove_all(folder / "masks");
  fs::rename(folder / "nerfstudio", folder / "masks");
  fs::remove(folder / "masks/b.png");
  EXPECT_THAT(ErrorOfConvert(folder, "nerfstudio", "colmap"),
              HasSubstr("masks/b.png: is missing, expected a mask for every photo"));
}

TEST(ConvertMasks, TheWrongConventionIsNamedWithTheRightOne) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"a.jpg"});
  const std::string error = ErrorOfConvert(folder, "openmvs", "colmap");
  EXPECT_THAT(error, HasSubstr("holds no mask of these photos in the convention openmvs"));
  EXPECT_THAT(error, HasSubstr("expected a.mask.png; its names look like --from colmap"));
}

TEST(ConvertMasks, TwoPhotosCannotShareAMask) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"a.jpg", "a.png", "sub/b.jpg"});
  EXPECT_THAT(ErrorOfConvert(folder, "colmap", "3dgrut"),
              HasSubstr("mask a_mask.png in the convention 3dgrut would be that of two photos, "
                        "a.jpg and a.png"));
  Convert(folder, "masks", "colmap", "realitycapture", "realitycapture");  // whole names differ

  const TemporaryFolder flat;
  WritePhotosAndMasks(flat, {"b.jpg", "sub/b.jpg"});
  EXPECT_THAT(ErrorOfConvert(flat, "colmap", "opensfm"), HasSubstr("b.jpg and sub/b.jpg"));
  Convert(flat, "masks", "colmap", "instant-ngp", "instant-ngp");  // sub-folders stay
}

TEST(ConvertMasks, RefusesNamesThatTheToolDoesNotFind) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"my photo.jpg"});
  EXPECT_THAT(ErrorOfConvert(folder, "colmap", "odm"),
              HasSubstr("mask my photo_mask.png in the convention odm has a space"));

  const TemporaryFolder beside;
  WritePhotosAndMasks(beside, {"a.jpg", "a_mask.png"});
  EXPECT_THAT(ErrorOfConvert(beside, "colmap", "3dgrut"), HasSubstr("has the name of a photo"));
}

TEST(ConvertMasks, NeverReplacesWhatItReads) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"a.jpg"});
  const auto before = Snapshot(folder.path());
  for (const char* output : {"photos", "masks", ""}) {
    const ConvertMasksOptions options = {.to = "3dgrut", .overwrite = true};
    EXPECT_THAT(ErrorOf([&] {
                  ConvertMasks(folder / "photos", folder / "masks", folder / output, options);
                }),
                HasSubstr("which is read"))
        << output;
  }
  EXPECT_EQ(Snapshot(folder.path()), before);
}

TEST(ConvertMasks, MasksBesidePhotosAreNoPhotos) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"a.jpg", "sub/b.jpg"});
  for (const char* convention : {"3dgrut", "openmvs", "realitycapture", "instant-ngp"}) {
    const std::string id(convention);
    Convert(folder, "masks", "colmap", id, id);
    const TemporaryFolder photos;
    fs::copy(folder / "photos", photos.path(), fs::copy_options::recursive);
    fs::copy(folder / id, photos.path(), fs::copy_options::recursive);
    ConvertMasks(photos.path(), photos.path(), folder / (id + "_back"), {.from = id});
    EXPECT_EQ(Snapshot(folder / (id + "_back")), Snapshot(folder / "masks")) << id;
  }
  fs::rename(folder / "masks", folder / "photos/masks");
  ConvertMasks(folder / "photos", folder / "photos/masks", folder / "inside", {});
  EXPECT_EQ(Snapshot(folder / "inside"), Snapshot(folder / "photos/masks"));
}

TEST(ConvertMasks, AMaskOfAnotherSizeIsAnErrorUnlessTheToolResizes) {
  const TemporaryFolder folder;
  WriteImage(folder / "photos/a.jpg", GrayImage(6, 4, 90));
  StaticMask half(3, 2, 255);
  half(2, 0) = 0;
  WriteImage(folder / "masks/a.jpg.png", half);
  EXPECT_THAT(
      ErrorOfConvert(folder, "colmap", "openmvs"),
      HasSubstr("a.jpg.png: has 3 x 2 pixels, expected 6 x 4 pixels, the size of its photo; "
                "COLMAP does not resize masks"));
  Convert(folder, "masks", "opensfm", "colmap", "out");  // the same name
  StaticMask expected(6, 4, 255);
  for (const int x : {4, 5}) expected(x, 0) = expected(x, 1) = 0;
  EXPECT_EQ(ReadStaticMask(folder / "out/a.jpg.png"), expected);
  fs::remove_all(folder / "out");
  WriteImage(folder / "masks/a.jpg.png", StaticMask(2, 3, 0));  // another shape: turned
  EXPECT_THAT(ErrorOfConvert(folder, "opensfm", "colmap"), HasSubstr("has 2 x 3 pixels"));
}

TEST(ConvertMasks, SoftMasksAreReadAsTheToolReadsThem) {
  const TemporaryFolder folder;
  WriteImage(folder / "photos/a.jpg", GrayImage(4, 1, 90));
  GrayImage soft(4, 1);
  soft.data() = {0, 1, 127, 128};
  WriteImage(folder / "masks/a.jpg.png", soft);
  WriteImage(folder / "masks/a_mask.png", soft);
  Convert(folder, "masks", "colmap", "colmap", "colmap");
  EXPECT_EQ(ReadStaticMask(folder / "colmap/a.jpg.png").data(),
            (std::vector<uint8_t>{0, 255, 255, 255}));
  Convert(folder, "masks", "3dgrut", "colmap", "3dgrut");
  EXPECT_EQ(ReadStaticMask(folder / "3dgrut/a.jpg.png").data(),
            (std::vector<uint8_t>{0, 0, 0, 255}));
}

// Any object of a label image is a distractor, also one whose colour COLMAP would take for black.
TEST(ConvertMasks, EveryLabelOfASegmenterIsADistractor) {
  const TemporaryFolder folder;
  WriteImage(folder / "photos/a.jpg", GrayImage(3, 1, 90));
  RgbImage labels(3, 1);
  labels(1, 0) = {0, 0, 1};
  labels(2, 0) = {128, 0, 0};
  WriteImage(folder / "sam2/a.png", labels);
  Convert(folder, "sam2", "sam2", "colmap", "out");
  EXPECT_EQ(ReadStaticMask(folder / "out/a.jpg.png").data(), (std::vector<uint8_t>{255, 0, 0}));

  GrayImage object(3, 1);
  object(0, 0) = 1;
  WriteImage(folder / "objects/001/a.png", object);
  object(0, 0) = 0;
  object(2, 0) = 1;
  WriteImage(folder / "objects/002/a.png", object);
  Convert(folder, "objects", "sam2_objects", "colmap", "united");
  EXPECT_EQ(ReadStaticMask(folder / "united/a.jpg.png").data(), (std::vector<uint8_t>{0, 255, 0}));
}

// 600 x 400 becomes 512 x 341 and, cut to multiples of 16 around its centre, 512 x 336 from row 2.
// Row r of the photo lies at (r + 0.5) * 341 / 400 - 2 of the mask, whose rows from 168 are marked:
// 199 is the first with 168.07, 395 the last with 335.16, and what lies below was cut off.
TEST(ConvertMasks, UndoesTheCropOfDust3r) {
  const TemporaryFolder folder;
  WriteImage(folder / "photos/a.jpg", GrayImage(600, 400, 90));
  WriteTurnedPhoto(folder / "photos/b.jpg", 400, 600, 6);  // seen as 600 x 400
  StaticMask marks(512, 336, 0);
  for (int y = 168; y < 336; ++y) {
    for (int x = 0; x < 512; ++x) marks(x, y) = 255;
  }
  WriteImage(folder / "masks/dynamic_mask_0.png", marks);
  WriteImage(folder / "masks/dynamic_mask_1.png", marks);
  for (const char* id : {"monst3r", "easi3r"}) {
    Convert(folder, "masks", id, "colmap", id);
    const StaticMask a = ReadStaticMask(folder / id / "a.jpg.png");
    const StaticMask b = ReadStaticMask(folder / id / "b.jpg.png");
    ASSERT_EQ(a.height(), 400);
    ASSERT_EQ(b.height(), 600);
    for (int row = 0; row < 400; ++row) {
      const int expected = row >= 199 && row <= 395 ? 0 : 255;
      EXPECT_EQ(a(300, row), expected) << row;
      EXPECT_EQ(b(row, 300), expected) << row;  // its columns are seen as rows
    }
  }
}

TEST(ConvertMasks, FramesMustBeThosePhotos) {
  const TemporaryFolder folder;
  WriteImage(folder / "photos/a.jpg", GrayImage(64, 48, 90));
  WriteImage(folder / "masks/dynamic_mask_0.png", StaticMask(512, 384, 0));
  Convert(folder, "masks", "monst3r", "colmap", "fits");
  WriteImage(folder / "masks/dynamic_mask_0.png", StaticMask(512, 288, 0));
  EXPECT_THAT(ErrorOfConvert(folder, "monst3r", "colmap"), HasSubstr("has 512 x 288 pixels"));
  WriteImage(folder / "photos/b.jpg", GrayImage(64, 48, 90));
  EXPECT_THAT(ErrorOfConvert(folder, "monst3r", "colmap"),
              HasSubstr("dynamic_mask_1.png: is missing"));
}

TEST(ConvertMasks, SegmentersAreOnlyRead) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder, {"a.jpg"});
  EXPECT_THAT(ErrorOfConvert(folder, "colmap", "sam2"), HasSubstr("cannot be written as sam2"));
}

TEST(ConvertMasks, MasksOfARealDatasetOfOpenSfm) {
  VGTW_NEED_SHARED_DATA();
  const TemporaryFolder folder;
  const fs::path dataset = SharedData() / "opensfm_berlin";
  ConvertMasks(dataset / "images", dataset / "masks", folder / "there", {"opensfm", "vggsfm"});
  ConvertMasks(dataset / "images", folder / "there", folder / "back", {"vggsfm", "colmap"});
  for (const char* name : {"01.jpg.png", "02.jpg.png", "03.jpg.png"}) {
    const StaticMask back = ReadStaticMask(folder / "back" / name);
    EXPECT_EQ(back, ReadStaticMask(dataset / "masks" / name)) << name;
    EXPECT_GT(ExcludedShare(back), 0.0) << name;
    EXPECT_LT(ExcludedShare(back), 0.5) << name;
  }
}

}  // namespace
}  // namespace vgtw
