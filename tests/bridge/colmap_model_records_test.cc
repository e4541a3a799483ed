// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model_records.h"

#include "scene/error.h"
#include "tests/support/bytes.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

const std::filesystem::path kPath = "model.txt";
const RecordSource kSource = {kPath, 12};
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(ColmapModelRecords, UnitRotationsKeepTheirBits) {
  // Unit as far as float32 goes.
  const PoseValues single = {0.70710676908493, 0.0, 0.70710676908493, 0.0, 4.0, -5.0, 1e-300};
  EXPECT_EQ(ValuesFromPose(PoseFromValues(kSource, "image 1", single)), single);
  // Text with three digits.
  const PoseValues rounded = {0.707, 0.0, 0.707, 0.0, 4.0, -5.0, 1e-300};
  const PoseValues values = ValuesFromPose(PoseFromValues(kSource, "image 1", rounded));
  EXPECT_DOUBLE_EQ(values[0], std::sqrt(0.5));
  EXPECT_DOUBLE_EQ(values[2], std::sqrt(0.5));
}

TEST(ColmapModelRecords, ValuesAreInTheOrderWxyz) {
  const Rigid3d pose = PoseFromValues(kSource, "image 1", {0.5, -0.5, 0.5, -0.5, 1.0, 2.0, 3.0});
  EXPECT_EQ(pose.rotation.w(), 0.5);
  EXPECT_EQ(pose.rotation.vec(), Eigen::Vector3d(-0.5, 0.5, -0.5));
  EXPECT_EQ(pose.translation, Eigen::Vector3d(1.0, 2.0, 3.0));
}

TEST(ColmapModelRecords, RotationsFarFromUnitAreErrors) {
  const auto error_of = [](double w) {
    return ErrorOf([&] { PoseFromValues(kSource, "image 1", {w, 0, 0, 0, 0, 0, 0}); });
  };
  EXPECT_EQ(error_of(0.995), "");
  EXPECT_EQ(error_of(-1.005), "");
  EXPECT_THAT(error_of(0.98),
              StartsWith("model.txt: line 12 has a rotation of image 1 of norm 0.98"));
  EXPECT_THAT(error_of(0.0), HasSubstr("norm 0"));
  EXPECT_THAT(error_of(2.0), HasSubstr("norm 2"));
  EXPECT_THAT(error_of(1e200), HasSubstr("norm inf"));
  EXPECT_THAT(error_of(kInfinity), HasSubstr("not finite"));
}

TEST(ColmapModelRecords, RepeatedIdsAreErrors) {
  std::map<CameraId, Camera> cameras;
  const Camera camera = {4, CameraModel::kSimplePinhole, 4, 3, {5.0, 2.0, 1.5}, false};
  AddCamera(kSource, camera, cameras);
  EXPECT_THAT(ErrorOf([&] { AddCamera(kSource, camera, cameras); }), HasSubstr("camera 4 twice"));

  std::map<ImageId, Image> images;
  Image image;
  image.image_id = 6;
  image.name = "a.jpg";
  AddImage(kSource, image, images);
  EXPECT_THAT(ErrorOf([&] { AddImage(kSource, image, images); }), HasSubstr("image 6 twice"));

  std::map<Point3DId, Point3D> points3D;
  AddPoint3D(kSource, 8, {}, points3D);
  EXPECT_THAT(ErrorOf([&] { AddPoint3D(kSource, 8, {}, points3D); }), HasSubstr("point3D 8 twice"));

  std::map<RigId, Rig> rigs;
  AddRig(kSource, {1, {0, 2}, {}}, rigs);
  EXPECT_THAT(ErrorOf([&] { AddRig(kSource, {1, {0, 2}, {}}, rigs); }), HasSubstr("rig 1 twice"));
  std::map<FrameId, Frame> frames;
  AddFrame(kSource, {3, 1, {}, {}}, frames);
  EXPECT_THAT(ErrorOf([&] {
                AddFrame(kSource, {3, 1, {}, {}}, frames);
              }),
              HasSubstr("frame 3 twice"));
}

TEST(ColmapModelRecords, InvalidRecordsAreErrors) {
  std::map<CameraId, Camera> cameras;
  EXPECT_THAT(ErrorOf([&] {
                AddCamera(kSource,
                          {4, CameraModel::kSimplePinhole, 4, 3, {-5.0, 2.0, 1.5}, false},
                          cameras);
              }),
              HasSubstr("camera 4"));
  std::map<Point3DId, Point3D> points3D;
  EXPECT_THAT(ErrorOf([&] { AddPoint3D(kSource, kInvalidPoint3DId, {}, points3D); }),
              HasSubstr("id -1"));
  EXPECT_THAT(ErrorOf([&] {
                AddPoint3D(kSource, 1, {{kInfinity, 0, 0}, {}, 0.0, {}}, points3D);
              }),
              HasSubstr("point3D 1 that is not finite"));
  std::map<RigId, Rig> rigs;
  EXPECT_THAT(ErrorOf([&] {
                AddRig(kSource, {1, {0, 2}, {{{0, 2}, {}}}}, rigs);
              }),
              HasSubstr("reference sensor of rig 1 twice"));
  std::map<ImageId, Image> images;
  Image image;
  image.name = "a.jpg";
  image.points2D = {{{0.0, kInfinity}, kInvalidPoint3DId}};
  EXPECT_THAT(ErrorOf([&] { AddImage(kSource, image, images); }), HasSubstr("not finite"));
  EXPECT_TRUE(cameras.empty() && images.empty() && points3D.empty() && rigs.empty());
}

TEST(ColmapModelRecords, NamesThatLeaveTheImageFolderAreErrors) {
  for (const std::string name : {"", "/etc/passwd", "../a.jpg", "a/../b.jpg", "a//b", "a\nb"}) {
    Image image;
    image.name = name;
    std::map<ImageId, Image> images;
    EXPECT_THAT(ErrorOf([&] { AddImage(kSource, image, images); }), HasSubstr("relative path"))
        << name;
  }
}

TEST(ColmapModelRecords, FindsModelsByNameAndId) {
  EXPECT_EQ(FindModelOrFail(kSource, 4).name, "OPENCV");
  EXPECT_EQ(FindModelOrFail(kSource, "FOV").num_params, 5);
  EXPECT_THAT(ErrorOf([] { FindModelOrFail(kSource, "opencv"); }),
              StartsWith("model.txt: line 12 has a camera of model opencv"));
  EXPECT_THAT(ErrorOf([] { FindModelOrFail({kPath}, 11); }),
              StartsWith("model.txt: has a camera of model 11"));
}

}  // namespace
}  // namespace vgtw
