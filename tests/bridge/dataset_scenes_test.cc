// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/dataset_scenes.h"

#include "scene/error.h"
#include "tests/support/temporary_folder.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class ScanDatasetTest : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text = "") const {
    const std::filesystem::path path = folder_ / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << text;
  }
  void WriteAll(const std::string& folder, const std::vector<std::string>& names) const {
    for (const std::string& name : names) Write(folder + "/" + name);
  }
  std::string ErrorOf(DatasetKind kind, const std::string& image_folder = "") const {
    try {
      ScanDataset(kind, folder_.path(), image_folder);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  // transforms.json with the frames in this order.
  static std::string Transforms(const std::vector<std::string>& names) {
    std::string text = "{\"frames\": [";
    for (const std::string& name : names) {
      text += text.ends_with('[') ? "" : ",";
      text += "{\"file_path\": \"images/" + name +
              "\", \"transform_matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}";
    }
    return text + "]}";
  }

  const TemporaryFolder folder_;
};

TEST_F(ScanDatasetTest, RobustNerfGoesByTheNamesOfPhotos) {
  WriteAll("yoda/images", {"0clean001.JPG", "1extra000.JPG", "2clutter007.JPG"});
  WriteAll("crab (1)/images", {"clean0.jpg", "clutter1.jpg"});
  WriteAll("crab2-undistorted/images_8", {"0clean0.png", "2clutter1.png"});
  WriteAll("statue/images", {"0clean0.png"});
  const DatasetScan scan = ScanDataset(DatasetKind::kRobustNerf, folder_.path());
  ASSERT_EQ(scan.scenes.size(), 3u);
  EXPECT_EQ(scan.scenes[0].name, "crab1");
  EXPECT_EQ(scan.scenes[0].image_path, "crab (1)/images");
  EXPECT_EQ(scan.scenes[1].name, "crab2");
  EXPECT_EQ(scan.scenes[1].image_path, "crab2-undistorted/images_8");
  EXPECT_EQ(scan.scenes[2].title, "Yoda");
  EXPECT_THAT(scan.scenes[2].clean, ElementsAre("0clean001.JPG", "1extra000.JPG"));
  EXPECT_THAT(scan.scenes[2].clutter, ElementsAre("2clutter007.JPG"));
  EXPECT_THAT(scan.missing, ElementsAre("android"));
  EXPECT_THAT(scan.left_out, ElementsAre("statue"));
}

TEST_F(ScanDatasetTest, RobustNerfRefusesAPhotoThatDoesNotTell) {
  WriteAll("android/images", {"0clean0.png", "IMG_0001.png"});
  EXPECT_THAT(ErrorOf(DatasetKind::kRobustNerf), HasSubstr("IMG_0001.png"));
  EXPECT_THAT(ErrorOf(DatasetKind::kRobustNerf, "images_8"), HasSubstr("images_8"));
}

TEST_F(ScanDatasetTest, OnTheGoCountsSortedNamesOfTransforms) {
  // Frames are not sorted in the file, and one photo of the folder is none of them.
  Write("patio-high/transforms.json", Transforms({"d.JPG", "b.JPG", "a.JPG", "c.JPG"}));
  Write("patio-high/split.json", R"({"clutter": [0, 3], "extra": [2], "clean": [1]})");
  WriteAll("patio-high/images_4", {"a.png", "aa.png", "b.png", "c.png", "d.png"});
  const DatasetScan scan = ScanDataset(DatasetKind::kOnTheGo, folder_.path());
  ASSERT_EQ(scan.scenes.size(), 1u);
  const DatasetScene& scene = scan.scenes[0];
  EXPECT_EQ(scene.name, "patio_high");
  EXPECT_EQ(scene.title, "Patio-High");
  EXPECT_EQ(scene.group, "High occlusion");
  EXPECT_EQ(scene.pose_path, "patio-high/transforms.json");
  EXPECT_THAT(scene.clean, ElementsAre("b.png", "c.png"));
  EXPECT_THAT(scene.clutter, ElementsAre("a.png", "d.png"));
  EXPECT_EQ(scan.missing.size(), 5u);
}

TEST_F(ScanDatasetTest, OnTheGoScenesComeInTheOrderOfThePaper) {
  for (const char* name : {"spot", "patio", "mountain", "corner", "patio_high", "fountain"}) {
    WriteAll(std::string(name) + "/images", {"1extra000.JPG", "2clutter008.JPG"});
  }
  std::vector<std::string> names;
  for (const DatasetScene& scene : ScanDataset(DatasetKind::kOnTheGo, folder_.path()).scenes) {
    names.push_back(scene.name);
  }
  EXPECT_THAT(names, ElementsAre("mountain", "fountain", "corner", "patio", "spot", "patio_high"));
}

TEST_F(ScanDatasetTest, OnTheGoRefusesASplitOfOtherPhotos) {
  Write("spot/transforms.json", Transforms({"a.JPG", "b.JPG"}));
  Write("spot/split.json", R"({"clutter": [0], "extra": [1]})");
  WriteAll("spot/images", {"a.JPG", "c.JPG"});
  EXPECT_THAT(ErrorOf(DatasetKind::kOnTheGo), HasSubstr("has no b"));
}

TEST_F(ScanDatasetTest, DavisHasMasksAndNoCleanPhotos) {
  WriteAll("JPEGImages/480p/camel", {"00000.jpg", "00001.jpg"});
  WriteAll("JPEGImages/Full-Resolution/camel", {"00000.jpg"});
  WriteAll("Annotations/480p/camel", {"00000.png"});
  const DatasetScan scan = ScanDataset(DatasetKind::kDavis, folder_.path());
  ASSERT_EQ(scan.scenes.size(), 1u);
  EXPECT_EQ(scan.scenes[0].image_path, "JPEGImages/480p/camel");
  EXPECT_EQ(scan.scenes[0].mask_path, "Annotations/480p/camel");
  EXPECT_EQ(scan.scenes[0].mask_convention, "sam2");
  EXPECT_EQ(scan.scenes[0].clutter.size(), 2u);
  EXPECT_THAT(scan.scenes[0].clean, IsEmpty());
}

TEST_F(ScanDatasetTest, DtuTakesItsScans) {
  WriteAll("scan24/images", {"0.jpg", "1.jpg"});
  WriteAll("scan1/image", {"0.png"});
  Write("Cameras/pair.txt");
  const DatasetScan scan = ScanDataset(DatasetKind::kDtu, folder_.path());
  ASSERT_EQ(scan.scenes.size(), 2u);
  EXPECT_EQ(scan.scenes[0].image_path, "scan1/image");
  EXPECT_THAT(scan.scenes[1].clean, ElementsAre("0.jpg", "1.jpg"));
  EXPECT_THAT(scan.left_out, ElementsAre("Cameras"));
}

TEST_F(ScanDatasetTest, FolderIsOneSceneOrSeveral) {
  WriteAll("b/images", {"x.jpg"});
  WriteAll("b/masks", {"x.jpg.png"});
  WriteAll("a", {"y clutter.jpg", "z.jpg"});
  Write("notes/readme.txt");
  const DatasetScan scan = ScanDataset(DatasetKind::kFolder, folder_.path());
  ASSERT_EQ(scan.scenes.size(), 2u);
  EXPECT_EQ(scan.scenes[0].image_path, "a");
  EXPECT_THAT(scan.scenes[0].clean, ElementsAre("z.jpg"));
  EXPECT_THAT(scan.scenes[0].clutter, ElementsAre("y clutter.jpg"));
  EXPECT_EQ(scan.scenes[0].mask_path, "");
  EXPECT_EQ(scan.scenes[1].image_path, "b/images");
  EXPECT_EQ(scan.scenes[1].mask_path, "b/masks");
  EXPECT_THAT(scan.left_out, UnorderedElementsAre("notes"));
  const DatasetScan one = ScanDataset(DatasetKind::kFolder, folder_ / "a");
  ASSERT_EQ(one.scenes.size(), 1u);
  EXPECT_EQ(one.scenes[0].name, "a");
  EXPECT_EQ(one.scenes[0].image_path, ".");
  EXPECT_EQ(ScanDataset(DatasetKind::kFolder, folder_ / "b").scenes.at(0).image_path, "images");
}

TEST_F(ScanDatasetTest, NothingThatItKnowsIsAnError) {
  EXPECT_THAT(ErrorOf(DatasetKind::kDavis), HasSubstr("holds no scene of davis"));
  EXPECT_THAT(ErrorOf(DatasetKind::kRobustNerf), HasSubstr("holds no scene of robustnerf"));
}

TEST(ParseSplitJson, RefusesIndicesThatCannotBe) {
  EXPECT_THAT(ParseSplitJson(R"({"clutter": [1], "extra": [0]})", 2, "s").clean, ElementsAre(0));
  for (const char* text : {"[]",
                           "{\"clutter\": 3}",
                           "{\"clutter\": [2]}",
                           "{\"clutter\": [-1]}",
                           "{\"clutter\": [0.5]}",
                           "{\"clutter\": [1], \"clean\": [1]}",
                           "{"}) {
    EXPECT_THROW(ParseSplitJson(text, 2, "s"), Error) << text;
  }
}

TEST(DatasetKindOf, IsTheInverseOfTheWords) {
  for (const std::string_view word : DatasetWords()) {
    EXPECT_EQ(DatasetWords()[static_cast<size_t>(DatasetKindOf(word))], word);
  }
  EXPECT_THROW(DatasetKindOf("kitti"), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
