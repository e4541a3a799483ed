// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/training_folders.h"

#include "bridge/mask_files.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/scene/raw_png.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSubsetOf;

constexpr int kWidth = 40;
constexpr int kHeight = 20;

// Distractor in the columns [begin, end).
StaticMask ColumnMask(int begin, int end, int width = kWidth, int height = kHeight) {
  StaticMask static_mask(width, height, 255);
  for (int y = 0; y < height; ++y) {
    for (int x = begin; x < end; ++x) static_mask(x, y) = 0;
  }
  return static_mask;
}

class TrainingFolders : public testing::Test {
 protected:
  // Two scenes of three photos, of which the last has no distractor.
  TrainingFolders() {
    for (const std::string scene : {"hall", "patio"}) {
      for (int i = 0; i < 3; ++i) {
        const std::string name = scene + "/" + std::to_string(i) + ".jpg";
        AddPhoto(name);
        AddMask(name, ColumnMask(5, i == 2 ? 5 : 9 + i));
      }
    }
  }

  fs::path Photos() const { return folder_ / "photos"; }
  fs::path Masks() const { return folder_ / "masks"; }
  void AddPhoto(const std::string& name, int width = kWidth, int height = kHeight) const {
    WriteImage(Photos() / name, GrayImage(width, height, 90));
  }
  void AddMask(const std::string& name, const StaticMask& static_mask) const {
    WriteImage(MaskPath(Masks(), name), static_mask);
  }
  std::vector<TrainingScene> Scenes() const { return FindTrainingScenes(Photos(), Masks()); }

  // "scene code name" of each finding that is no note.
  std::vector<std::string> Findings() const {
    std::vector<std::string> texts;
    for (const SceneCheck& check : Check()) {
      for (const LintFinding& finding : check.findings) {
        if (finding.rule->severity == LintSeverity::kNote) continue;
        texts.push_back(check.scene.name + " " + std::string(finding.rule->code) + " " +
                        finding.name);
      }
    }
    return texts;
  }
  std::vector<SceneCheck> Check() const {
    return CheckTrainingScenes(Scenes(), {.width = 28, .height = 14, .num_threads = 2});
  }
  TrainingFolderStats Stats() const {
    return ComputeTrainingStats(Scenes(), {.width = 28, .height = 28, .num_threads = 2});
  }
  CorruptedMasks Corrupt(const std::string& output, CorruptMasksOptions options) const {
    if (options.num_threads == 0) options.num_threads = 2;
    return CorruptMasks(Photos(), Masks(), folder_ / output, options);
  }

  const TemporaryFolder folder_;
};

TEST_F(TrainingFolders, ScenesAreFoldersUnlessPhotosLieRightIn) {
  WriteFileAtomically(Photos() / "README.txt", "no photo");
  fs::create_directories(Photos() / ".cache");
  const std::vector<TrainingScene> scenes = Scenes();
  ASSERT_EQ(scenes.size(), 2);
  EXPECT_EQ(scenes[0].name, "hall");
  EXPECT_EQ(scenes[1].image_path, Photos() / "patio");
  EXPECT_EQ(scenes[1].mask_path, Masks() / "patio");
  AddPhoto("a.jpg");
  const std::vector<TrainingScene> one = Scenes();
  ASSERT_EQ(one.size(), 1);
  EXPECT_EQ(one[0].name, "");
  EXPECT_EQ(one[0].image_path, Photos());
  EXPECT_EQ(one[0].mask_path, Masks());
}

TEST_F(TrainingFolders, LinkedFoldersAreScenes) {
  fs::create_directories(folder_ / "linked");
  fs::create_directory_symlink(Photos() / "hall", folder_ / "linked/a");
  const auto scenes = FindTrainingScenes(folder_ / "linked", Masks());
  ASSERT_EQ(scenes.size(), 1);
  EXPECT_EQ(scenes[0].name, "a");
}

TEST_F(TrainingFolders, NothingToFindIsAnError) {
  fs::create_directories(folder_ / "empty");
  EXPECT_THAT(ErrorOf([&] { FindTrainingScenes(folder_ / "empty", Masks()); }),
              HasSubstr("holds neither photos nor folders, expected photos"));
  EXPECT_THAT(ErrorOf([&] { FindTrainingScenes(folder_ / "none", Masks()); }),
              HasSubstr("is not a folder"));
}

TEST_F(TrainingFolders, GoodDataHasNoFindings) {
  EXPECT_THAT(Findings(), IsEmpty());
  const SceneCheck hall = Check().front();
  EXPECT_EQ(hall.num_photos, 3);
  EXPECT_EQ(hall.num_masks, 3);
  EXPECT_DOUBLE_EQ(hall.distractor_share, (4 + 5 + 0) / 120.0);
}

TEST_F(TrainingFolders, WhatTheTrainerStopsAtIsAnError) {
  fs::remove(MaskPath(Masks(), "hall/0.jpg"));
  AddMask("hall/1.jpg", ColumnMask(0, 3, 20, 10));
  fs::resize_file(Photos() / "hall/2.jpg", 100);
  fs::remove(Photos() / "patio/0.jpg");
  fs::remove(Photos() / "patio/1.jpg");
  WriteFileAtomically(MaskPath(Masks(), "patio/2.jpg"), "no picture");
  fs::create_directories(Photos() / "void");
  const std::vector<std::string> findings = Findings();
  for (const std::string expected : {"hall missing-mask 0.jpg",
                                     "hall scaled-mask 1.jpg",
                                     "hall unreadable-photo 2.jpg",
                                     "patio few-photos ",
                                     "patio unreadable-mask 2.jpg",
                                     "void unusable-scene "}) {
    EXPECT_THAT(findings, testing::Contains(expected));
  }
  for (const SceneCheck& check : Check()) {
    EXPECT_GT(check.Count(LintSeverity::kError), 0) << check.scene.name;
    EXPECT_TRUE(std::isnan(check.distractor_share)) << check.scene.name;
  }
}

// Its head is whole, so that only decoding tells.
TEST_F(TrainingFolders, PhotoThatBreaksOffIsFound) {
  const fs::path path = Photos() / "hall/1.jpg";
  fs::resize_file(path, fs::file_size(path) - 20);
  EXPECT_EQ(ReadImageSize(path), (ImageSize{kWidth, kHeight}));
  EXPECT_THAT(Findings(), ElementsAre("hall unreadable-photo 1.jpg"));
}

TEST_F(TrainingFolders, MasksWithSixteenBitsStopTheTrainer) {
  std::string rows;
  for (int y = 0; y < kHeight; ++y) rows += '\0' + std::string(2 * kWidth, y < 3 ? '\0' : '\xff');
  WriteFileAtomically(MaskPath(Masks(), "hall/1.jpg"), MakePng(kWidth, kHeight, 16, 0, rows));
  EXPECT_THROW(ReadStaticMask(MaskPath(Masks(), "hall/1.jpg")), Error);
  EXPECT_THAT(Findings(), ElementsAre("hall sixteen-bit-gray 1.jpg"));
}

TEST_F(TrainingFolders, WhatIsLearntBadlyIsAWarning) {
  GrayImage soft = ColumnMask(5, 9);
  soft(20, 3) = 77;
  AddMask("hall/0.jpg", soft);
  AddMask("hall/9.jpg", ColumnMask(0, 1));
  AddPhoto("hall/2.jpg", 26, 20);
  AddMask("hall/2.jpg", ColumnMask(1, 3, 26));
  for (int i = 0; i < 3; ++i) AddMask("patio/" + std::to_string(i) + ".jpg", ColumnMask(5, 9));
  EXPECT_THAT(Findings(),
              ElementsAre("hall soft-mask 0.jpg",
                          "hall orphan-mask 9.jpg.png",
                          "hall small-photo 2.jpg",
                          "patio same-mask 0.jpg"));
  EXPECT_THAT(Check()[1].findings.front().detail, HasSubstr("1.jpg and 1 more"));
  EXPECT_EQ(Check()[0].Count(LintSeverity::kError), 0);
}

TEST_F(TrainingFolders, ScenesOfOneKindOfPixelAreWarnedOf) {
  for (int i = 0; i < 3; ++i) {
    const std::string name = std::to_string(i) + ".jpg";
    AddMask("hall/" + name, ColumnMask(0, 0));
    AddMask("patio/" + name, ColumnMask(0, i == 0 ? 39 : 40));
  }
  EXPECT_THAT(Findings(),
              ElementsAre("hall no-mask-excludes ",
                          "patio maybe-inverted ",
                          "patio nearly-all-distractor ",
                          "patio all-excluded 1.jpg",
                          "patio all-excluded 2.jpg"));
}

TEST_F(TrainingFolders, InvertedMasksAreSuspected) {
  for (int i = 0; i < 3; ++i) {
    AddMask("hall/" + std::to_string(i) + ".jpg", ColumnMask(4 + i, 40));
  }
  EXPECT_THAT(Findings(), ElementsAre("hall maybe-inverted "));
}

TEST_F(TrainingFolders, EveryRuleIsOneOfLintOrOfTraining) {
  for (const LintRule& rule : TrainingRules()) {
    const auto lint = LintRules();
    const bool is_of_lint = std::any_of(
        lint.begin(), lint.end(), [&](const LintRule& other) { return other.code == rule.code; });
    const bool is_own = rule.code == "unusable-scene" || rule.code == "few-photos" ||
                        rule.code == "nearly-all-distractor" || rule.code == "small-photo";
    EXPECT_NE(is_of_lint, is_own) << rule.code;
  }
}

// The cut is the middle 20 x 20 pixels, x from 10 to 30, of which a patch is 10 x 10.
TEST_F(TrainingFolders, StatsByHand) {
  AddMask("hall/0.jpg", ColumnMask(0, 15));   // left patches: exactly half, mixed; right: static
  AddMask("hall/1.jpg", ColumnMask(0, 16));   // left: 0.6, distractor; right: static
  AddMask("hall/2.jpg", ColumnMask(29, 40));  // left: static; right: exactly a tenth, mixed
  fs::remove(MaskPath(Masks(), "patio/0.jpg"));
  AddMask("patio/1.jpg", ColumnMask(0, 0));
  AddPhoto("patio/2.jpg", 20, 30);
  AddMask("patio/2.jpg", ColumnMask(0, 0, 20, 30));
  const TrainingFolderStats stats = Stats();
  const TrainingStats& hall = stats.scenes[0].stats;
  EXPECT_EQ(hall.num_views, 3);
  EXPECT_DOUBLE_EQ(hall.mean_share, (15 + 16 + 11) / 120.0);
  EXPECT_DOUBLE_EQ(hall.min_share, 11 / 40.0);
  EXPECT_DOUBLE_EQ(hall.max_share, 16 / 40.0);
  EXPECT_EQ(hall.num_without_distractor, 0);
  EXPECT_EQ(hall.num_distractor_patches, 2);
  EXPECT_EQ(hall.num_static_patches, 6);
  EXPECT_EQ(hall.num_mixed_patches, 4);
  const TrainingStats& patio = stats.scenes[1].stats;
  EXPECT_EQ(patio.num_photos, 3);
  EXPECT_EQ(patio.num_views, 2);
  EXPECT_EQ(patio.num_without_distractor, 2);
  EXPECT_EQ(patio.num_static_patches, 8);
  EXPECT_EQ(stats.total.num_photos, 6);
  EXPECT_EQ(stats.total.num_views, 5);
  EXPECT_DOUBLE_EQ(stats.total.mean_share, (15 + 16 + 11) / 200.0);
  ASSERT_EQ(stats.total.sizes.size(), 2);
  EXPECT_EQ(stats.total.sizes[0], (std::pair<ImageSize, size_t>{{kWidth, kHeight}, 4}));
  EXPECT_EQ(stats.total.sizes[1].second, 1);
}

// Patches of 2/3 pixel: one pixel lies in several of them.
TEST_F(TrainingFolders, PatchesMayBeSmallerThanPixels) {
  fs::remove_all(Photos() / "patio");
  fs::remove_all(Photos() / "hall");
  AddPhoto("tiny/a.png", 2, 2);
  AddMask("tiny/a.png", ColumnMask(0, 1, 2, 2));
  const TrainingFolderStats stats =
      ComputeTrainingStats(Scenes(), {.width = 42, .height = 42, .num_threads = 1});
  EXPECT_EQ(stats.total.num_distractor_patches, 3);
  EXPECT_EQ(stats.total.num_mixed_patches, 3);  // half of the middle ones is
  EXPECT_EQ(stats.total.num_static_patches, 3);
}

TEST_F(TrainingFolders, NetworkSizesAreMultiplesOfPatches) {
  EXPECT_THROW(ComputeTrainingStats(Scenes(), {.width = 100}), std::invalid_argument);
  EXPECT_THROW(CheckTrainingScenes(Scenes(), {.height = 0}), std::invalid_argument);
  EXPECT_NO_THROW(TrainingFolderOptions().Check());
}

class CorruptMasksTest : public TrainingFolders {
 protected:
  // 12 masks hold a distractor, 8 none.
  CorruptMasksTest() {
    fs::remove_all(Photos());
    fs::remove_all(Masks());
    for (int i = 0; i < 20; ++i) {
      const std::string name = (i % 2 == 0 ? "hall/" : "patio/") + std::to_string(100 + i) + ".jpg";
      AddPhoto(name);
      AddMask(name, ColumnMask(0, i < 12 ? 1 + i : 0));
    }
    AddMask("hall/orphan.jpg", ColumnMask(0, 7));
    WriteFileAtomically(Masks() / "notes.txt", "mine");
  }
};

TEST_F(CorruptMasksTest, ChangesTheShareOfMasksThatHoldADistractorAndCopiesTheRest) {
  const auto photos = Snapshot(Photos());
  const auto before = Snapshot(Masks());
  for (const double share : {0.0, 0.1, 0.3, 1.0}) {
    const CorruptedMasks corrupted = Corrupt("dirty", {.share = share, .overwrite = true});
    EXPECT_EQ(corrupted.num_masks, 20);
    EXPECT_EQ(corrupted.num_with_distractor, 12);
    EXPECT_EQ(corrupted.names.size(), std::llround(12 * share));
    auto after = Snapshot(folder_ / "dirty");
    const auto record = nlohmann::json::parse(after.at("corrupted.json"));
    EXPECT_EQ(record.at("corrupted"), corrupted.names);
    EXPECT_EQ(record.at("share"), share);
    EXPECT_EQ(record.at("seed"), 0);
    for (const std::string& name : corrupted.names) {
      EXPECT_GT(ExcludedShare(ReadStaticMask(Masks() / name)), 0.0) << name;
      const GrayImage values = ReadMaskValues(folder_ / "dirty" / name);
      EXPECT_EQ(values, GrayImage(kWidth, kHeight, 255)) << name;
      after[name] = before.at(name);
    }
    after.erase("corrupted.json");
    EXPECT_TRUE(after == before);
  }
  EXPECT_TRUE(Snapshot(Masks()) == before);
  EXPECT_TRUE(Snapshot(Photos()) == photos);
}

TEST_F(CorruptMasksTest, ChoiceIsAFunctionOfNamesSeedAndShare) {
  const auto names = Corrupt("a", {.share = 0.5, .seed = 7, .num_threads = 1}).names;
  EXPECT_EQ(Corrupt("b", {.share = 0.5, .seed = 7, .num_threads = 4}).names, names);
  EXPECT_TRUE(Snapshot(folder_ / "a") == Snapshot(folder_ / "b"));
  EXPECT_TRUE(std::is_sorted(names.begin(), names.end()));
  EXPECT_NE(Corrupt("c", {.share = 0.5, .seed = 8}).names, names);
  EXPECT_THAT(Corrupt("d", {.share = 0.25, .seed = 7}).names, IsSubsetOf(names));
  // Other pixels in the same masks change nothing.
  for (int i = 0; i < 12; ++i) {
    AddMask((i % 2 == 0 ? "hall/" : "patio/") + std::to_string(100 + i) + ".jpg",
            ColumnMask(20, 30));
  }
  EXPECT_EQ(Corrupt("e", {.share = 0.5, .seed = 7}).names, names);
}

TEST_F(CorruptMasksTest, LinkedScenesBecomeFiles) {
  Corrupt("expected", {});
  fs::rename(Masks() / "hall", folder_ / "elsewhere");
  fs::create_directory_symlink("../elsewhere", Masks() / "hall");
  Corrupt("dirty", {});
  EXPECT_FALSE(fs::is_symlink(folder_ / "dirty/hall"));
  EXPECT_TRUE(Snapshot(folder_ / "dirty") == Snapshot(folder_ / "expected"));
}

TEST_F(CorruptMasksTest, OneSceneAlone) {
  const CorruptedMasks corrupted =
      CorruptMasks(Photos() / "hall", Masks() / "hall", folder_ / "dirty", {.share = 0.5});
  EXPECT_EQ(corrupted.num_with_distractor, 6);
  ASSERT_EQ(corrupted.names.size(), 3);
  EXPECT_TRUE(fs::exists(folder_ / "dirty" / corrupted.names.front()));
}

TEST_F(CorruptMasksTest, LeavesNothingWhereItFails) {
  fs::remove(MaskPath(Masks(), "hall/104.jpg"));
  EXPECT_THAT(ErrorOf([&] { Corrupt("dirty", {}); }), HasSubstr("is missing (1 of 10"));
  AddMask("hall/104.jpg", ColumnMask(0, 1, 10, 10));
  EXPECT_THAT(ErrorOf([&] { Corrupt("dirty", {}); }), HasSubstr("has 10 x 10 pixels, expected"));
  AddMask("hall/104.jpg", ColumnMask(0, 1));
  EXPECT_THROW(Corrupt("dirty", {.share = 1.5}), std::invalid_argument);
  for (const auto& entry : fs::directory_iterator(folder_.path())) {
    EXPECT_TRUE(entry.path() == Photos() || entry.path() == Masks()) << entry.path();
  }
}

TEST_F(CorruptMasksTest, InputIsNeverWrittenTo) {
  const auto before = Snapshot(folder_.path());
  for (const std::string output : {"", "masks", "masks/dirty", "photos/dirty"}) {
    EXPECT_THAT(ErrorOf([&] { Corrupt(output, {.overwrite = true}); }), HasSubstr("which is read"))
        << output;
  }
  EXPECT_TRUE(Snapshot(folder_.path()) == before);
  Corrupt("dirty", {});
  EXPECT_THAT(ErrorOf([&] { Corrupt("dirty", {}); }), HasSubstr("add --overwrite"));
  EXPECT_THAT(ErrorOf([&] { CorruptMasks(Photos(), folder_ / "dirty", folder_ / "twice", {}); }),
              HasSubstr("is a corrupted copy already"));
}

}  // namespace
}  // namespace vgtw
