// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint.h"

#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/bridge/mask_lint_fixture.h"
#include "tests/support/bytes.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST_F(MaskLint, GoodMasksAreClean) {
  for (const std::string version : {"3.8", "3.11.1", "3.12", "3.13", "4.2.1"}) {
    const LintReport report = Lint(version);
    EXPECT_THAT(report.findings, IsEmpty()) << version;
    EXPECT_EQ(Image(report, "sub/c.png").effect, MaskEffect::kApplied);
    EXPECT_DOUBLE_EQ(Image(report, "sub/c.png").excluded_share, 6.0 / kWidth);
  }
  // A mask of 0 and 1 works as well, and so does one of one bit.
  GrayImage zero_one = ColumnMask(5);
  for (uint8_t& value : zero_one.data()) value /= 255;
  WriteImage(Mask("b.jpg"), zero_one);
  EXPECT_THAT(Lint().findings, IsEmpty());
}

TEST_F(MaskLint, TableHasOneRowPerCode) {
  std::set<std::string_view> codes;
  for (const LintRule& rule : LintRules()) {
    EXPECT_TRUE(codes.insert(rule.code).second) << rule.code;
    EXPECT_FALSE(rule.meaning.empty() || rule.advice.empty()) << rule.code;
  }
}

TEST_F(MaskLint, MissingMasksAreUnusedOrDropThePhoto) {
  fs::remove(Mask("b.jpg"));
  const LintReport old = Lint("3.11");
  EXPECT_THAT(Codes(old), ElementsAre("missing-mask b.jpg"));
  EXPECT_EQ(old.Count(LintSeverity::kError), 0U);
  EXPECT_EQ(Image(old, "b.jpg").effect, MaskEffect::kUnused);
  EXPECT_EQ(Image(old, "b.jpg").excluded_share, 0.0);
  const LintReport recent = Lint("3.12");
  EXPECT_THAT(Codes(recent), ElementsAre("missing-mask-drops b.jpg"));
  EXPECT_EQ(recent.Count(LintSeverity::kError), 1U);
  EXPECT_EQ(Image(recent, "b.jpg").effect, MaskEffect::kPhotoDropped);
  EXPECT_EQ(Fix(recent, "b.jpg").what, "there was none: all-white");
  EXPECT_EQ(Fixed("b.jpg"), StaticMask(kWidth, kHeight, 255));
}

TEST_F(MaskLint, NamesThatOnlyNewerVersionsAccept) {
  fs::rename(Mask("b.jpg"), folder_ / "masks/b.png");
  fs::rename(Mask("sub/c.png"), folder_ / "masks/sub/c.png");
  EXPECT_THAT(Codes(Lint("3.11")),
              ElementsAre("name-without-extension b.jpg", "name-without-extension sub/c.png"));
  EXPECT_EQ(Image(Lint("3.11"), "b.jpg").effect, MaskEffect::kUnused);
  EXPECT_THAT(Codes(Lint("3.12")),
              ElementsAre("name-without-extension b.jpg", "name-needs-newer sub/c.png"));
  EXPECT_EQ(Image(Lint("3.12"), "b.jpg").effect, MaskEffect::kPhotoDropped);
  EXPECT_THAT(Codes(Lint("3.13")),
              ElementsAre("name-needs-newer b.jpg", "name-needs-newer sub/c.png"));
  EXPECT_EQ(Image(Lint("3.13"), "b.jpg").effect, MaskEffect::kApplied);
  EXPECT_EQ(Fix(Lint(), "b.jpg").what, "renamed from b.png");
  EXPECT_EQ(Fixed("b.jpg"), ColumnMask(5));
  EXPECT_EQ(Fixed("sub/c.png"), ColumnMask(6));
}

TEST_F(MaskLint, NamesThatDifferInCaseFolderOrExtension) {
  fs::rename(Mask("a.jpg"), folder_ / "masks/A.JPG.PNG");
  fs::rename(Mask("sub/c.png"), Mask("c.png"));
  WriteImage(folder_ / "masks/d.png", ColumnMask(9));
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report),
              ElementsAre("misnamed-mask a.jpg", "misnamed-mask sub/c.png", "orphan-mask d.png"));
  Fix(report, "a.jpg");
  EXPECT_EQ(Fixed("a.jpg"), ColumnMask(4));
  EXPECT_EQ(Fixed("sub/c.png"), ColumnMask(6));
  EXPECT_FALSE(fs::exists(folder_ / "fixed/d.png"));
}

TEST_F(MaskLint, SecondMaskOfAPhotoIsNotTaken) {
  WriteImage(folder_ / "masks/a.png", ColumnMask(9));
  EXPECT_THAT(Codes(Lint()), ElementsAre("unused-mask a.png"));
}

// Where a file could be of two photos, neither gets it.
TEST_F(MaskLint, AmbiguousNamesAreNobodys) {
  AddPhoto("other/b.jpg");
  fs::remove(Mask("b.jpg"));
  WriteImage(folder_ / "masks/deep/b.jpg.png", ColumnMask(5));
  EXPECT_THAT(
      Codes(Lint()),
      ElementsAre("missing-mask b.jpg", "missing-mask other/b.jpg", "orphan-mask deep/b.jpg.png"));
}

// instant-ngp's names say its polarity, too: not 0 is excluded.
TEST_F(MaskLint, NamesOfAnotherToolAreReadAsItDoes) {
  fs::remove_all(folder_ / "masks");
  int num_columns = 4;
  for (const std::string name : {"a", "b", "sub/c"}) {
    StaticMask marks = ColumnMask(num_columns++);
    for (uint8_t& value : marks.data()) value = static_cast<uint8_t>(255 - value);
    const fs::path path(name);
    WriteImage(folder_ / "masks" / path.parent_path() /
                   ("dynamic_mask_" + path.filename().string() + ".png"),
               marks);
  }
  const LintReport report = Lint();
  EXPECT_THAT(
      Codes(report),
      ElementsAre(
          "other-convention a.jpg", "other-convention b.jpg", "other-convention sub/c.png"));
  EXPECT_EQ(Image(report, "a.jpg").convention, &GetMaskConvention("instant-ngp"));
  EXPECT_THAT(report.findings[0].detail, HasSubstr("--from instant-ngp"));
  EXPECT_EQ(Fix(report, "a.jpg").what, "read as instant-ngp does");
  EXPECT_EQ(Fixed("sub/c.png"), ColumnMask(6));
}

TEST_F(MaskLint, DamagedMasksDropThePhotoAndAreNotMendedSilently) {
  WriteFileAtomically(Mask("a.jpg"), "hello");
  const std::string bytes = ReadFile(Mask("b.jpg"));
  WriteFileAtomically(Mask("b.jpg"), std::string_view(bytes).substr(0, bytes.size() - 5));
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), ElementsAre("unreadable-mask a.jpg", "truncated-mask b.jpg"));
  EXPECT_EQ(Image(report, "a.jpg").effect, MaskEffect::kPhotoDropped);
  EXPECT_EQ(Image(report, "b.jpg").effect, MaskEffect::kPhotoDropped);
  EXPECT_TRUE(std::isnan(Image(report, "b.jpg").excluded_share));
  EXPECT_EQ(Image(Lint("4.2.1"), "b.jpg").effect, MaskEffect::kApplied);
  for (const std::string name : {"a.jpg", "b.jpg"}) {
    const MaskFix fix = Fix(report, name);
    EXPECT_FALSE(fix.is_mended);
    EXPECT_THAT(fix.what, HasSubstr("all-white instead"));
    EXPECT_EQ(Fixed(name), StaticMask(kWidth, kHeight, 255));
  }
}

// Half of the size: a quarter of the photo is covered; of its 20 columns 10 are excluded.
TEST_F(MaskLint, ScaledMasksCoverACorner) {
  WriteImage(Mask("a.jpg"), ColumnMask(10, kWidth / 2, kHeight / 2));
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), ElementsAre("scaled-mask a.jpg"));
  EXPECT_EQ(report.findings[0].detail, "20 x 10, the photo 40 x 20");
  EXPECT_DOUBLE_EQ(Image(report, "a.jpg").excluded_share, 7.0 / 8.0);
  EXPECT_EQ(Fix(report, "a.jpg").what, "resized to the photo");
  EXPECT_EQ(Fixed("a.jpg"), ColumnMask(20));
}

// Orientation 6 turns the stored photo by 90 deg clockwise: its left columns become the upper rows.
TEST_F(MaskLint, RotatedMasksAreTurnedBackByExifOnly) {
  AddTurnedPhoto("a.jpg", 6);
  StaticMask upright(kHeight, kWidth, 255);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < kHeight; ++x) upright(x, y) = 0;
  }
  WriteImage(Mask("a.jpg"), upright);
  WriteImage(Mask("b.jpg"), upright);
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report),
              ElementsAre("rotated-mask a.jpg", "rotated-mask b.jpg", "same-mask a.jpg"));
  EXPECT_THAT(report.findings[0].detail, HasSubstr("EXIF orientation 6"));
  const MaskFix of_a = Fix(report, "a.jpg");
  EXPECT_EQ(of_a.what, "turned back as the photo is stored");
  EXPECT_TRUE(of_a.is_mended);
  EXPECT_EQ(Fixed("a.jpg"), ColumnMask(4));
  EXPECT_FALSE(Fix(report, "b.jpg").is_mended);
}

TEST_F(MaskLint, WrongSizesAreNotGuessed) {
  WriteImage(Mask("a.jpg"), ColumnMask(4, kWidth, kHeight - 4));
  AddTurnedPhoto("b.jpg", 3);
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), ElementsAre("wrong-size a.jpg", "turned-photo b.jpg"));
  EXPECT_FALSE(Fix(report, "a.jpg").is_mended);
}

TEST_F(MaskLint, SoftMasksKeepWhatIsNotZero) {
  GrayImage soft = ColumnMask(4);
  for (int y = 0; y < kHeight; ++y) {
    soft(4, y) = 1;
    soft(5, y) = 127;
    soft(6, y) = 128;
  }
  WriteImage(Mask("a.jpg"), soft);
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), ElementsAre("soft-mask a.jpg"));
  EXPECT_EQ(report.findings[0].detail,
            "60 pixels (7.50 %) lie between, of which 40 below 128 are kept all the same");
  EXPECT_DOUBLE_EQ(Image(report, "a.jpg").excluded_share, 4.0 / kWidth);
  EXPECT_EQ(Fix(report, "a.jpg").what, "cut at 128");
  EXPECT_EQ(Fixed("a.jpg"), ColumnMask(6));
  // Labels stay what COLMAP takes them for.
  GrayImage labels = ColumnMask(4);
  for (uint8_t& value : labels.data()) value = value == 0 ? 0 : 1;
  labels(30, 3) = 2;
  WriteImage(Mask("a.jpg"), labels);
  Fix(Lint(), "a.jpg");
  EXPECT_EQ(Fixed("a.jpg"), ColumnMask(4));
}

TEST_F(MaskLint, SixteenBits) {
  const std::string zeros(6, '\0');
  const std::string ones(6, '\xff');
  WriteFileAtomically(Mask("a.jpg"), MakeColumnPng(16, 2, zeros, ones));
  WriteFileAtomically(Mask("b.jpg"), MakeColumnPng(16, 0, zeros.substr(0, 2), ones.substr(0, 2)));
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), ElementsAre("sixteen-bit-colour a.jpg", "sixteen-bit-gray b.jpg"));
  EXPECT_EQ(Image(report, "a.jpg").effect, MaskEffect::kPhotoDropped);
  EXPECT_EQ(Image(report, "b.jpg").effect, MaskEffect::kApplied);
  EXPECT_EQ(Image(Lint("4.0"), "a.jpg").effect, MaskEffect::kApplied);
  EXPECT_TRUE(Fix(report, "a.jpg").is_mended);
  EXPECT_EQ(Fixed("a.jpg"), ColumnMask(5));
  EXPECT_EQ(Fixed("b.jpg"), ColumnMask(5));
}

TEST_F(MaskLint, AlphaIsNotRead) {
  WriteFileAtomically(Mask("a.jpg"),
                      MakeColumnPng(8, 6, std::string(4, '\0'), std::string("\0\0\0\xff", 4)));
  WriteFileAtomically(Mask("b.jpg"),
                      MakeColumnPng(8, 4, std::string("\xff\0", 2), std::string("\xff\xff", 2)));
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), AllOf(Contains("alpha-only a.jpg"), Contains("alpha-only b.jpg")));
  EXPECT_EQ(Image(report, "a.jpg").excluded_share, 1.0);
  EXPECT_EQ(Image(report, "b.jpg").excluded_share, 0.0);
  EXPECT_EQ(Fix(report, "a.jpg").what, "taken from alpha");
  EXPECT_EQ(Fixed("a.jpg"), ColumnMask(5));
  EXPECT_EQ(Fixed("b.jpg"), ColumnMask(5));
}

TEST_F(MaskLint, ColoursAreReadAsBrightness) {
  const std::string palette = PngChunk("PLTE", std::string("\0\0\0\x80\0\0", 6));
  WriteFileAtomically(Mask("a.jpg"),
                      MakeColumnPng(8, 3, std::string(1, '\0'), std::string(1, '\1'), palette));
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), Contains("colour-mask a.jpg"));
  EXPECT_DOUBLE_EQ(Image(report, "a.jpg").excluded_share, 5.0 / kWidth);
  // Blue of 1 has a brightness of 0.07.
  WriteFileAtomically(Mask("a.jpg"),
                      MakeColumnPng(8, 2, std::string(3, '\0'), std::string("\0\0\1", 3)));
  EXPECT_THAT(Codes(Lint()), Contains("all-excluded a.jpg"));
}

TEST_F(MaskLint, CoverageOfTheFolder) {
  WriteImage(Mask("a.jpg"), StaticMask(kWidth, kHeight, 0));
  WriteImage(Mask("b.jpg"), StaticMask(kWidth, kHeight, 255));
  EXPECT_THAT(Codes(Lint()), ElementsAre("all-excluded a.jpg", "nothing-excluded b.jpg"));
  WriteImage(Mask("a.jpg"), ColumnMask(30));
  WriteImage(Mask("b.jpg"), ColumnMask(3));
  EXPECT_THAT(Codes(Lint()), ElementsAre("mostly-excluded a.jpg"));
  for (const std::string name : {"a.jpg", "b.jpg", "sub/c.png"}) {
    WriteImage(Mask(name), StaticMask(kWidth, kHeight, 255));
  }
  EXPECT_THAT(Codes(Lint()), Contains("no-mask-excludes "));
}

TEST_F(MaskLint, OneMaskForTwoPhotosIsSuspicious) {
  WriteImage(Mask("b.jpg"), ColumnMask(4));
  const LintReport report = Lint();
  EXPECT_THAT(Codes(report), ElementsAre("same-mask a.jpg"));
  EXPECT_EQ(report.findings[0].detail, "and b.jpg");
}

TEST_F(MaskLint, MasksBelowThePhotosBecomePhotos) {
  fs::rename(folder_ / "masks", folder_ / "photos/masks");
  const LintReport report = Lint("3.8", "photos/masks");
  EXPECT_THAT(Codes(report), ElementsAre("masks-among-photos "));
  EXPECT_EQ(report.findings[0].detail, "3 of 6 \"photos\" are masks");
  EXPECT_EQ(report.images.size(), 3U);
  EXPECT_THAT(ErrorOf([&] { Lint("3.8", "photos"); }), HasSubstr("also the folder of photos"));
}

TEST_F(MaskLint, DamagedPhotosAreFindings) {
  WriteFileAtomically(folder_ / "photos/b.jpg", "hello");
  EXPECT_THAT(Codes(Lint()), ElementsAre("unreadable-photo b.jpg"));
}

TEST_F(MaskLint, VersionsAreChecked) {
  for (const std::string version : {"", "3", "2.9", "3.7", "new"}) {
    EXPECT_THAT(ErrorOf([&] { Lint(version); }), HasSubstr("expected 3.8 or newer")) << version;
  }
}

TEST_F(MaskLint, FixDoesNotWriteOverWhatItReads) {
  const LintReport report = Lint();
  const auto before = Snapshot(folder_.path());
  for (const std::string output : {"masks", "photos", ""}) {
    EXPECT_THAT(ErrorOf([&] {
                  FixMasks(folder_ / "photos",
                           folder_ / "masks",
                           report,
                           folder_.path() / output,
                           {.overwrite = true});
                }),
                HasSubstr("which is read"));
  }
  EXPECT_EQ(Snapshot(folder_.path()), before);
}

// Hand-made masks of people, a robot and figures.
TEST(MaskLintOfRealPhotos, HandMadeMasksAreCleanAndInvertedOnesAreSuspected) {
  VGTW_NEED_SHARED_DATA();
  for (const std::string set : {"android", "corner"}) {
    const fs::path images = SharedData() / "wild" / set / "images";
    const fs::path masks = SharedData() / "wild" / set / "masks";
    const LintReport report = LintMasks(images, masks, {});
    EXPECT_EQ(report.Count(LintSeverity::kError) + report.Count(LintSeverity::kWarning), 0U) << set;
    const TemporaryFolder folder;
    FixMasks(images, masks, report, folder / "inverted", {.invert = true});
    const LintReport inverted = LintMasks(images, folder / "inverted", {});
    EXPECT_EQ(inverted.Count(LintSeverity::kWarning), 1U) << set;
    EXPECT_TRUE(std::any_of(
        inverted.findings.begin(), inverted.findings.end(), [](const LintFinding& finding) {
          return finding.rule->code == "maybe-inverted";
        }));
  }
}

}  // namespace
}  // namespace vgtw
