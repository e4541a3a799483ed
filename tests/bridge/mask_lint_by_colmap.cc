// SPDX-License-Identifier: BSD-3-Clause
// What lint says that COLMAP does with masks is what COLMAP does.
#include "bridge/colmap_database.h"
#include "bridge/mask_files.h"
#include "bridge/mask_lint.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/scene/raw_png.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <map>
#include <optional>
#include <random>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 240;
constexpr int kHeight = 160;

std::string VersionOf(const fs::path& executable) {
  const std::string help = RunColmap({"-h"}, executable).output;
  const size_t begin = help.find("COLMAP ") + 7;
  return help.substr(begin, help.find_first_of(" \n", begin) - begin);
}

// Blocks of random gray, full of corners.
GrayImage MakeTexture() {
  std::mt19937 random(7);
  constexpr int kBlock = 8;
  GrayImage blocks(kWidth / kBlock, kHeight / kBlock, 0);
  for (uint8_t& value : blocks.data()) value = static_cast<uint8_t>(random() % 256);
  GrayImage image(kWidth, kHeight, 0);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) image(x, y) = blocks(x / kBlock, y / kBlock);
  }
  return image;
}

// Excludes the left half.
StaticMask MakeMask(int width, int height) {
  StaticMask static_mask(width, height, 255);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width / 2; ++x) static_mask(x, y) = 0;
  }
  return static_mask;
}

// The same in colours, or with an alpha channel of these values.
std::string MakeWidePng(int bit_depth,
                        int colour_type,
                        const std::string& excluded,
                        const std::string& kept) {
  std::string rows;
  for (int y = 0; y < kHeight; ++y) {
    rows += '\0';
    for (int x = 0; x < kWidth; ++x) rows += x < kWidth / 2 ? excluded : kept;
  }
  return MakePng(kWidth, kHeight, bit_depth, colour_type, rows);
}

// One photo per way to write its mask.
void WritePhotosAndMasks(const TemporaryFolder& folder) {
  const GrayImage texture = MakeTexture();
  for (const std::string name : {"right.png",
                                 "no_extension.jpg",
                                 "own_name.png",
                                 "missing.png",
                                 "half_size.png",
                                 "across.png",
                                 "soft.png",
                                 "zero_one.png",
                                 "sixteen_colour.png",
                                 "sixteen_gray.png",
                                 "alpha_black.png",
                                 "alpha_white.png",
                                 "darkest_blue.png",
                                 "broken.png"}) {
    WriteImage(folder / "photos" / name, texture);
  }
  const fs::path masks = folder / "masks";
  const StaticMask full = MakeMask(kWidth, kHeight);
  WriteImage(MaskPath(masks, "right.png"), full);
  WriteImage(masks / "no_extension.png", full);
  WriteImage(masks / "own_name.png", full);
  WriteImage(MaskPath(masks, "half_size.png"), MakeMask(kWidth / 2, kHeight / 2));
  WriteImage(MaskPath(masks, "across.png"), MakeMask(kHeight, kWidth));
  GrayImage soft = full;
  for (int x = 0; x < kWidth / 2; ++x) soft(x, 80) = 1;
  for (int y = 20; y < 60; ++y) {
    for (int x = 20; x < 60; ++x) soft(x, y) = 5;
  }
  WriteImage(MaskPath(masks, "soft.png"), soft);
  GrayImage zero_one = full;
  for (uint8_t& value : zero_one.data()) value /= 255;
  WriteImage(MaskPath(masks, "zero_one.png"), zero_one);
  const auto write = [&](const std::string& name, const std::string& bytes) {
    WriteFileAtomically(MaskPath(masks, name), bytes);
  };
  write("sixteen_colour.png", MakeWidePng(16, 2, std::string(6, '\0'), std::string(6, '\xff')));
  write("sixteen_gray.png", MakeWidePng(16, 0, std::string(2, '\0'), std::string("\x03\xe8", 2)));
  write("alpha_black.png", MakeWidePng(8, 6, std::string(4, '\0'), std::string("\0\0\0\xff", 4)));
  write("alpha_white.png", MakeWidePng(8, 4, std::string("\xff\0", 2), std::string("\xff\xff", 2)));
  write("darkest_blue.png", MakeWidePng(8, 2, std::string(3, '\0'), std::string("\0\0\1", 3)));
  write("broken.png", "hello");
}

// Keypoints per photo that COLMAP wrote; no entry if it dropped the photo.
std::map<std::string, uint64_t> Extract(const TemporaryFolder& folder,
                                        const fs::path& executable,
                                        const std::string& database_name,
                                        std::vector<std::string> options) {
  const std::string database_path = (folder / database_name).string();
  options.insert(options.begin(),
                 {"feature_extractor",
                  "--database_path",
                  database_path,
                  "--image_path",
                  (folder / "photos").string(),
                  UseGpuFlag("feature_extractor", executable),
                  "0"});
  const ColmapRun run = RunColmap(options, executable);
  EXPECT_EQ(run.exit_code, 0) << run.output;
  const ColmapDatabase database(database_path, ColmapDatabase::Mode::kReadOnly);
  std::map<std::string, uint64_t> counts;
  for (const DatabaseImage& image : database.ReadImages()) {
    const auto keypoints = database.ReadKeypoints(image.image_id);
    counts[image.name] = keypoints ? keypoints->rows : 0;
  }
  return counts;
}

void ExpectColmapDoesAsTold(const fs::path& executable) {
  const TemporaryFolder folder;
  WritePhotosAndMasks(folder);
  const auto without_masks = Extract(folder, executable, "without.db", {});
  ASSERT_EQ(without_masks.size(), 14U);
  const LintReport report =
      LintMasks(folder / "photos",
                folder / "masks",
                {.database_path = folder / "without.db", .colmap_version = VersionOf(executable)});
  std::map<std::string, uint64_t> told;
  for (const LintImage& image : report.images) {
    if (image.effect == MaskEffect::kPhotoDropped) continue;
    told[image.name] = image.num_keypoints - image.num_excluded_keypoints;
  }
  const auto with_masks = Extract(
      folder, executable, "with.db", {"--ImageReader.mask_path", (folder / "masks").string()});
  EXPECT_EQ(told, with_masks);
  // The masks must be told apart by what they leave.
  const uint64_t num_all = without_masks.at("right.png");
  EXPECT_GT(num_all, 200U);
  EXPECT_LT(with_masks.at("right.png"), num_all * 2 / 3);
  EXPECT_LT(with_masks.at("half_size.png"), with_masks.at("right.png") / 2);
  EXPECT_GT(with_masks.at("soft.png"), with_masks.at("right.png"));
  EXPECT_FALSE(with_masks.contains("broken.png"));
}

TEST(MaskLintByColmap, DoesWhatLintSays) {
  VGTW_NEED_COLMAP();
  ExpectColmapDoesAsTold(ColmapExecutable());
}

TEST(MaskLintByColmap, AnotherVersionDoesWhatLintSays) {
  VGTW_NEED_OTHER_COLMAP();
  ExpectColmapDoesAsTold(OtherColmapExecutable());
}

}  // namespace
}  // namespace vgtw
