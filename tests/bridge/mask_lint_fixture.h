// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/mask_files.h"
#include "bridge/mask_lint.h"
#include "scene/distractor_mask.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/scene/exif_jpeg.h"
#include "tests/scene/raw_png.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {

// Photos of 40 x 20 pixels and masks that exclude a few columns, of each photo others.
inline constexpr int kWidth = 40;
inline constexpr int kHeight = 20;

inline StaticMask ColumnMask(int num_columns, int width = kWidth, int height = kHeight) {
  StaticMask static_mask(width, height, 255);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < num_columns; ++x) static_mask(x, y) = 0;
  }
  return static_mask;
}

class MaskLint : public testing::Test {
 protected:
  MaskLint() {
    for (const std::string name : {"a.jpg", "b.jpg", "sub/c.png"}) AddPhoto(name);
    int num_columns = 4;
    for (const std::string name : {"a.jpg", "b.jpg", "sub/c.png"}) {
      WriteImage(Mask(name), ColumnMask(num_columns++));
    }
  }

  std::filesystem::path Mask(const std::string& name) const {
    return MaskPath(folder_ / "masks", name);
  }

  void AddPhoto(const std::string& name) const {
    WriteImage(folder_ / "photos" / name, GrayImage(kWidth, kHeight, 90));
  }

  void AddTurnedPhoto(const std::string& name, uint32_t orientation) const {
    AddPhoto(name);
    const std::filesystem::path path = folder_ / "photos" / name;
    WriteFileAtomically(path, InsertExif(ReadFile(path), MakeExif({.orientation = orientation})));
  }

  // A PNG of kWidth x kHeight with the same bytes in the excluded columns x < 5 of each row, and
  // others behind them.
  static std::string MakeColumnPng(int bit_depth,
                                   int colour_type,
                                   const std::string& excluded,
                                   const std::string& kept,
                                   const std::string& chunks = {}) {
    std::string rows;
    for (int y = 0; y < kHeight; ++y) {
      rows += '\0';
      for (int x = 0; x < kWidth; ++x) rows += x < 5 ? excluded : kept;
    }
    return MakePng(kWidth, kHeight, bit_depth, colour_type, rows, chunks);
  }

  LintReport Lint(const std::string& version = "3.8", const std::string& masks = "masks") const {
    return LintMasks(
        folder_ / "photos",
        folder_ / masks,
        {.database_path = database_path_, .colmap_version = version, .num_threads = 2});
  }

  // "code name" of all findings.
  static std::vector<std::string> Codes(const LintReport& report) {
    std::vector<std::string> codes;
    for (const LintFinding& finding : report.findings) {
      codes.push_back(std::string(finding.rule->code) + " " + finding.name);
    }
    return codes;
  }

  static const LintImage& Image(const LintReport& report, const std::string& name) {
    for (const LintImage& image : report.images) {
      if (image.name == name) return image;
    }
    throw std::out_of_range(name);
  }

  // Writes the corrected folder, of which every version must read every mask. Returns what was
  // done to `name`.
  MaskFix Fix(const LintReport& report,
              const std::string& name,
              const FixMasksOptions& options = {}) const {
    FixMasksOptions with_overwrite = options;
    with_overwrite.overwrite = true;
    const std::vector<MaskFix> fixes =
        FixMasks(folder_ / "photos", folder_ / "masks", report, folder_ / "fixed", with_overwrite);
    MaskFix wanted;
    for (const MaskFix& fix : fixes) {
      if (fix.image_name == name) wanted = fix;
    }
    for (const std::string version : {"3.8", "3.12", "4.2"}) {
      const LintReport fixed =
          LintMasks(folder_ / "photos", folder_ / "fixed", {.colmap_version = version});
      EXPECT_EQ(fixed.Count(LintSeverity::kError), 0U);
      for (const LintImage& image : fixed.images) {
        EXPECT_EQ(image.effect, MaskEffect::kApplied) << image.name;
      }
    }
    return wanted;
  }

  StaticMask Fixed(const std::string& name) const {
    return ReadStaticMask(MaskPath(folder_ / "fixed", name));
  }

  const TemporaryFolder folder_;
  std::filesystem::path database_path_ = {};  // "" = none
};

}  // namespace vgtw
