// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model_text.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/sample_model.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::filesystem::path kPath = "file.txt";

struct FileKind {
  void (*parse)(std::string_view, const std::filesystem::path&, Reconstruction&);
  void (*write)(const Reconstruction&, const std::filesystem::path&);
};
const FileKind kCameras = {ParseCamerasText, WriteCamerasText};
const FileKind kImages = {ParseImagesText, WriteImagesText};
const FileKind kPoints3D = {ParsePoints3DText, WritePoints3DText};
const FileKind kRigs = {ParseRigsText, WriteRigsText};
const FileKind kFrames = {ParseFramesText, WriteFramesText};
const std::vector<FileKind> kKinds = {kCameras, kImages, kPoints3D, kRigs, kFrames};

std::string Written(const FileKind& kind, const Reconstruction& model) {
  const TemporaryFolder folder;
  kind.write(model, folder / "file.txt");
  return ReadFile(folder / "file.txt");
}

Reconstruction Parsed(const FileKind& kind, const std::string& text) {
  Reconstruction model;
  kind.parse(text, kPath, model);
  return model;
}

std::string ErrorIn(const FileKind& kind, const std::string& text) {
  return ErrorOf([&] { Parsed(kind, text); });
}

// What follows the comment of the columns.
std::string Records(const std::string& text) { return text.substr(text.find('\n') + 1); }

TEST(ColmapModelText, WritesTheLinesOfTheFormat) {
  Reconstruction model;
  const Rigid3d pose = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {1.0, 2.0, 3.5}};
  model.cameras[7] = {7, CameraModel::kSimpleRadial, 640, 480, {500.5, 320.0, 240.0, 0.1}, false};
  model.images[3] = {3, 7, "a/b.jpg", pose, {{{10.5, 20.25}, 9}, {{1.0, 2.0}, kInvalidPoint3DId}}};
  model.images[4] = {4, 7, "c.jpg", pose, {}};
  model.points3D[9] = {{1.0, 2.0, 1e22}, {255, 1, 0}, -1.0, {{3, 0}}};
  model.rigs[1] = {1, {0, 7}, {{{0, 8}, pose}, {{1, 5}, {}}}};
  model.frames[8] = {8, 1, pose, {{{0, 7}, 3}}};
  // 0.1 with 17 digits; what is exact stays short.
  EXPECT_EQ(Records(Written(kCameras, model)),
            "7 SIMPLE_RADIAL 640 480 500.5 320 240 0.10000000000000001\n");
  EXPECT_EQ(Records(Written(kImages, model)),
            "3 0.5 -0.5 0.5 -0.5 1 2 3.5 7 a/b.jpg\n10.5 20.25 9 1 2 -1\n"
            "4 0.5 -0.5 0.5 -0.5 1 2 3.5 7 c.jpg\n\n");
  EXPECT_EQ(Records(Written(kPoints3D, model)), "9 1 2 1e+22 255 1 0 -1 3 0\n");
  EXPECT_EQ(Records(Written(kRigs, model)),
            "1 3 CAMERA 7 CAMERA 8 1 0.5 -0.5 0.5 -0.5 1 2 3.5 IMU 5 0\n");
  EXPECT_EQ(Records(Written(kFrames, model)), "8 1 0.5 -0.5 0.5 -0.5 1 2 3.5 1 CAMERA 7 3\n");
}

TEST(ColmapModelText, WriteReadWriteIsByteEqual) {
  const Reconstruction model = SampleModelWithRigs();
  for (const FileKind& kind : kKinds) {
    const std::string text = Written(kind, model);
    EXPECT_EQ(Written(kind, Parsed(kind, text)), text);
  }
}

TEST(ColmapModelText, DoublesAreReadBackExactly) {
  Reconstruction model = SampleModel();
  const Eigen::Vector3d awkward(
      1.0 / 3.0, std::numeric_limits<double>::min(), -std::numeric_limits<double>::max());
  model.points3D.at(5).xyz = awkward;
  EXPECT_EQ(Parsed(kPoints3D, Written(kPoints3D, model)).points3D.at(5).xyz, awkward);
}

TEST(ColmapModelText, SkipsCommentsAndBlankLinesBetweenRecords) {
  const Reconstruction model = Parsed(kImages,
                                      "# a comment\r\n\n  \t\n"
                                      "1 1 0 0 0 0 0 0 1 a.jpg\r\n\r\n"
                                      "# another\n"
                                      "2 1 0 0 0 0 0 0 1 b.jpg\n  3.5\t4.5   -1  \n");
  ASSERT_EQ(model.images.size(), 2u);
  EXPECT_TRUE(model.images.at(1).points2D.empty());
  ASSERT_EQ(model.images.at(2).points2D.size(), 1u);
  EXPECT_EQ(model.images.at(2).points2D[0].xy, Eigen::Vector2d(3.5, 4.5));
  EXPECT_FALSE(model.images.at(2).points2D[0].HasPoint3D());
}

TEST(ColmapModelText, LastLineNeedsNoEnd) {
  EXPECT_EQ(Parsed(kImages, "1 1 0 0 0 0 0 0 1 a.jpg").images.size(), 1u);
  EXPECT_EQ(Parsed(kImages, "1 1 0 0 0 0 0 0 1 a.jpg\n1 2 -1").images.at(1).points2D.size(), 1u);
}

TEST(ColmapModelText, ForgottenPointsLineIsAnErrorInsteadOfHalfTheImages) {
  EXPECT_THAT(ErrorIn(kImages, "1 1 0 0 0 0 0 0 1 a.jpg\n2 1 0 0 0 0 0 0 1 b.jpg\n"),
              testing::AllOf(StartsWith("file.txt: line 2 "), HasSubstr("may be empty")));
}

TEST(ColmapModelText, FaultsAreErrorsWithTheLine) {
  struct Case {
    FileKind kind;
    std::string text;
    std::string message;
  };
  const std::string image = "\n1 1 0 0 0 0 0 0 1 a.jpg\n";
  const std::vector<Case> cases = {
      {kCameras, "\nx PINHOLE 4 3 5 5 2 1.5", "line 2 has 'x', expected a camera id"},
      {kCameras, "\n-1 PINHOLE 4 3 5 5 2 1.5", "line 2 has '-1', expected a camera id"},
      {kCameras, "\n4294967296 PINHOLE 4 3 5 5 2 1.5", "'4294967296'"},
      {kCameras, "\n1 NONE 4 3 5 5 2 1.5", "line 2 has a camera of model NONE"},
      {kCameras, "\n1 PINHOLE 4 3 5 5 2", "line 2 ends, expected 4 parameters of PINHOLE"},
      {kCameras, "\n1 PINHOLE 4 3 5 5 2 1.5 6", "line 2 goes on with '6'"},
      {kCameras, "\n1 PINHOLE 4 3 5 5 2 1,5", "line 2 has '1,5'"},
      {kCameras, "\n1 PINHOLE 4 3 5 5 2 nan", "line 2 has a wrong camera 1"},
      {kCameras, "\n1 PINHOLE 0 3 5 5 2 1", "line 2 has a wrong camera 1"},
      {kCameras, "1 PINHOLE 4 3 5 5 2 1\n1 PINHOLE 4 3 5 5 2 1", "line 2 holds camera 1 twice"},
      {kImages, "\n1 1 0 0 0 0 0", "line 2 ends, expected a pose"},
      {kImages, "\n1 1 0 0 0 0 0 0 1", "line 2 ends, expected the image's name"},
      {kImages, "\n1 1 0 0 0 0 0 0 1 a b.jpg", "a name without spaces"},
      {kImages, "\n1 1 0 0 0 0 0 0 1 ../a.jpg", "relative path"},
      {kImages, "\n1 nan 0 0 0 0 0 0 1 a.jpg", "not finite"},
      {kImages, "\n1 1 1 0 0 0 0 0 1 a.jpg", "line 2 has a rotation of image 1 of norm 1.41"},
      {kImages, image + "1 2", "line 3 ends, expected points2D"},
      {kImages, image + "1 2 x", "line 3 has 'x'"},
      {kImages, image + "1 inf -1", "line 3 has a point2D of image 1"},
      {kPoints3D, "\n-1 0 0 0 0 0 0 0", "line 2 has '-1', expected a point3D id"},
      {kPoints3D, "\n1 0 0 1e999 0 0 0 0", "line 2 has '1e999'"},
      {kPoints3D, "\n1 0 0 nan 0 0 0 0", "point3D 1 that is not finite"},
      {kPoints3D, "\n1 0 0 0 256 0 0 0", "line 2 has '256', expected r g b"},
      {kPoints3D, "\n1 0 0 0 0 0 0 0 5", "line 2 ends, expected a point2D index"},
      {kRigs, "\n1 0", "line 2 has no sensor"},
      {kRigs, "\n1 1 LIDAR 1", "line 2 has 'LIDAR', expected a sensor type"},
      {kRigs, "\n1 4000000000 CAMERA 1", "line 2 ends"},
      {kRigs, "\n1 3 CAMERA 1 CAMERA 2 0 CAMERA 2 0", "twice"},
      {kFrames, "\n1 1 1 0 0 0 0 0 0 4000000000 CAMERA 1 1", "line 2 ends"},
      {kFrames, "\n1 1 1 0 0 0 0 0 0 0 CAMERA", "line 2 goes on with 'CAMERA'"},
  };
  for (const auto& [kind, text, message] : cases) {
    EXPECT_THAT(ErrorIn(kind, text), HasSubstr(message)) << text;
  }
}

TEST(ColmapModelText, TruncationNeverCrashesAndNeverInventsRecords) {
  const Reconstruction model = SampleModelWithRigs();
  for (const FileKind& kind : kKinds) {
    const std::string text = Written(kind, model);
    for (size_t length = 0; length < text.size(); ++length) {
      ErrorOf([&] {
        const Reconstruction prefix = Parsed(kind, text.substr(0, length));
        EXPECT_LE(prefix.cameras.size(), model.cameras.size());
        EXPECT_LE(prefix.images.size(), model.images.size());
        EXPECT_LE(prefix.points3D.size(), model.points3D.size());
      });
    }
  }
}

TEST(ColmapModelText, NamesWithSpacesAreRefused) {
  const TemporaryFolder folder;
  Reconstruction model = SampleModel();
  model.images.at(3).name = "a b.jpg";
  EXPECT_THROW(WriteImagesText(model, folder / "images.txt"), std::invalid_argument);
  EXPECT_TRUE(Snapshot(folder.path()).empty());
}

}  // namespace
}  // namespace vgtw
