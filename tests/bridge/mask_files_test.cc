// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_files.h"

#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// A view of 56 x 28 pixels whose network saw it at half that size.
ViewPrediction MakeView(const std::string& name) {
  ViewPrediction prediction;
  prediction.view.name = name;
  prediction.view.camera = MakePinhole(56, 28, 50.0, 50.0);
  prediction.view.network_width = 28;
  prediction.view.network_height = 14;
  prediction.view.original_from_network << 2, 0, 0, 0, 2, 0;
  return prediction;
}

// Distractors in the left half of "a.jpg"; "sub/b.jpg" was not predicted.
void WriteSamplePredictions(const std::filesystem::path& folder) {
  ViewPrediction a = MakeView("a.jpg");
  a.distractor = DistractorMask(28, 14, 0.0f);
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 14; ++x) a.distractor(x, y) = 1.0f;
  }
  WritePrediction({"test", "", {a, MakeView("sub/b.jpg")}}, folder, /*overwrite=*/false);
}

TEST(MaskPath, AppendsPngToTheWholeName) {
  EXPECT_EQ(MaskPath("masks", "sub/b.jpg"), "masks/sub/b.jpg.png");
}

TEST(WriteMasks, OneMaskPerViewAtOriginalSize) {
  const TemporaryFolder folder;
  WriteSamplePredictions(folder / "predictions");
  const PredictionReader predictions(folder / "predictions");
  const StaticMaskOptions options{.dilate_px = 0};
  const auto summaries = WriteMasks(predictions, folder / "masks", options, false);
  EXPECT_EQ(Snapshot(folder / "masks").size(), 2u);
  const StaticMask a = ReadStaticMask(folder / "masks/a.jpg.png");
  ASSERT_EQ(a.width(), 56);
  ASSERT_EQ(a.height(), 28);
  for (int x = 0; x < 56; ++x) EXPECT_EQ(a(x, 14), x < 28 ? 0 : 255) << x;
  EXPECT_EQ(ReadStaticMask(folder / "masks/sub/b.jpg.png"), StaticMask(56, 28, 255));
  ASSERT_EQ(summaries.size(), 2u);
  EXPECT_EQ(summaries[0].image_name, "a.jpg");
  EXPECT_EQ(summaries[0].excluded_share, 0.5);
  EXPECT_FALSE(summaries[0].was_missing);
  EXPECT_EQ(summaries[1].excluded_share, 0.0);
  EXPECT_TRUE(summaries[1].was_missing);
}

TEST(WriteMasks, AreTheSameForAnyNumberOfThreads) {
  const TemporaryFolder folder;
  WriteSamplePredictions(folder / "predictions");
  const PredictionReader predictions(folder / "predictions");
  WriteMasks(predictions, folder / "one", {}, false, 1);
  WriteMasks(predictions, folder / "four", {}, false, 4);
  EXPECT_EQ(Snapshot(folder / "one"), Snapshot(folder / "four"));
}

TEST(WriteMasks, AFailureLeavesNoFolderAndAnOldOneAsItWas) {
  const TemporaryFolder folder;
  WriteSamplePredictions(folder / "predictions");
  const PredictionReader predictions(folder / "predictions");
  WriteMasks(predictions, folder / "masks", {}, false);
  EXPECT_THAT(ErrorOf([&] { WriteMasks(predictions, folder / "masks", {}, false); }),
              HasSubstr("masks: exists"));
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(folder / "predictions/views")) {
    if (entry.is_regular_file()) std::filesystem::resize_file(entry.path(), 5);
  }
  const auto before = Snapshot(folder.path());
  EXPECT_NE(ErrorOf([&] { WriteMasks(predictions, folder / "masks", {}, true); }), "");
  EXPECT_NE(ErrorOf([&] { WriteMasks(predictions, folder / "new", {}, false); }), "");
  EXPECT_EQ(Snapshot(folder.path()), before);
  EXPECT_FALSE(std::filesystem::exists(folder / "new"));
}

TEST(CopyMasks, EveryPhotoGetsABinaryMaskOfItsSize) {
  const TemporaryFolder folder;
  const std::vector<std::string> names = {"a.png", "sub/b.png"};
  for (const std::string& name : names) WriteImage(folder / "photos" / name, GrayImage(8, 4, 90));
  StaticMask soft(8, 4, 255);
  soft(0, 0) = 0;
  soft(1, 0) = 1;  // COLMAP keeps any value but 0
  WriteImage(folder / "from/a.png.png", soft);
  const auto summaries = CopyMasks(folder / "from", folder / "photos", names, folder / "to", false);
  StaticMask expected(8, 4, 255);
  expected(0, 0) = 0;
  EXPECT_EQ(ReadStaticMask(folder / "to/a.png.png"), expected);
  EXPECT_EQ(ReadStaticMask(folder / "to/sub/b.png.png"), StaticMask(8, 4, 255));
  EXPECT_FALSE(summaries[0].was_missing);
  EXPECT_EQ(summaries[0].excluded_share, 1.0 / 32.0);
  EXPECT_TRUE(summaries[1].was_missing);
}

TEST(CopyMasks, AMaskOfAnotherSizeIsAnError) {
  const TemporaryFolder folder;
  WriteImage(folder / "photos/a.png", GrayImage(8, 4, 90));
  WriteImage(folder / "from/a.png.png", StaticMask(4, 2, 255));
  const std::string error = ErrorOf(
      [&] { CopyMasks(folder / "from", folder / "photos", {"a.png"}, folder / "to", false); });
  EXPECT_THAT(error, HasSubstr("a.png.png: has 4 x 2 pixels, expected 8 x 4 pixels"));
  EXPECT_FALSE(std::filesystem::exists(folder / "to"));
}

}  // namespace
}  // namespace vgtw
