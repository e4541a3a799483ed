// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model_binary.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/sample_model.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

const std::filesystem::path kPath = "file.bin";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr uint64_t kNone = std::numeric_limits<uint64_t>::max();

const std::string kIdentityPose = Bytes(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
const std::string kSmallCamera =
    Bytes(uint32_t{1}, int32_t{0}, uint64_t{4}, uint64_t{3}, 5.0, 2.0, 1.5);

struct FileKind {
  void (*parse)(std::span<const std::byte>, const std::filesystem::path&, Reconstruction&);
  void (*write)(const Reconstruction&, const std::filesystem::path&);
};
const std::vector<FileKind> kKinds = {{ParseCamerasBinary, WriteCamerasBinary},
                                      {ParseImagesBinary, WriteImagesBinary},
                                      {ParsePoints3DBinary, WritePoints3DBinary},
                                      {ParseRigsBinary, WriteRigsBinary},
                                      {ParseFramesBinary, WriteFramesBinary}};

std::string Written(const FileKind& kind, const Reconstruction& model) {
  const TemporaryFolder folder;
  kind.write(model, folder / "file.bin");
  return ReadFile(folder / "file.bin");
}

Reconstruction Parsed(const FileKind& kind, const std::string& bytes) {
  Reconstruction model;
  kind.parse(AsBytes(bytes), kPath, model);
  return model;
}

TEST(ColmapModelBinary, CamerasAreTheBytesOfTheFormat) {
  Reconstruction model;
  model.cameras[7] = {7, CameraModel::kSimpleRadial, 640, 480, {500.5, 320.0, 240.0, -0.1}, false};
  EXPECT_EQ(Written(kKinds[0], model),
            Bytes(uint64_t{1},
                  uint32_t{7},
                  int32_t{2},
                  uint64_t{640},
                  uint64_t{480},
                  500.5,
                  320.0,
                  240.0,
                  -0.1));
}

TEST(ColmapModelBinary, ImagesAreTheBytesOfTheFormat) {
  Reconstruction model;
  Image& image = model.images[3];
  image.image_id = 3;
  image.camera_id = 2;
  image.name = "a/b.jpg";
  image.cam_from_world = {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {1.0, 2.0, 3.0}};
  image.points2D = {{{10.5, 20.25}, 9}, {{1.0, 2.0}, kInvalidPoint3DId}};
  EXPECT_EQ(Written(kKinds[1], model),
            Bytes(uint64_t{1},
                  uint32_t{3},
                  Bytes(0.5, -0.5, 0.5, -0.5, 1.0, 2.0, 3.0),
                  uint32_t{2},
                  "a/b.jpg",
                  '\0',
                  uint64_t{2},
                  Bytes(10.5, 20.25, uint64_t{9}),
                  Bytes(1.0, 2.0, kNone)));
}

TEST(ColmapModelBinary, Points3DAreTheBytesOfTheFormat) {
  Reconstruction model;
  model.points3D[9] = {{1.0, 2.0, 3.0}, {255, 1, 0}, 0.5, {{3, 0}, {4, 17}}};
  EXPECT_EQ(Written(kKinds[2], model),
            Bytes(uint64_t{1},
                  uint64_t{9},
                  Bytes(1.0, 2.0, 3.0),
                  Bytes(uint8_t{255}, uint8_t{1}, uint8_t{0}),
                  0.5,
                  uint64_t{2},
                  Bytes(uint32_t{3}, uint32_t{0}, uint32_t{4}, uint32_t{17})));
}

TEST(ColmapModelBinary, RigsAndFramesAreTheBytesOfTheFormat) {
  Reconstruction model;
  const Rigid3d pose = {Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0), {1.0, 2.0, 3.0}};
  const std::string pose_bytes = Bytes(0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0);
  model.rigs[1] = {1, {0, 2}, {{{0, 7}, pose}, {{1, 5}, {}}}};
  model.frames[8] = {8, 1, pose, {{{0, 2}, uint64_t{1} << 40}}};
  EXPECT_EQ(Written(kKinds[3], model),
            Bytes(uint64_t{1},
                  uint32_t{1},
                  uint32_t{3},
                  Bytes(int32_t{0}, uint32_t{2}),
                  Bytes(int32_t{0}, uint32_t{7}, uint8_t{1}, pose_bytes),
                  Bytes(int32_t{1}, uint32_t{5}, uint8_t{0})));
  EXPECT_EQ(Written(kKinds[4], model),
            Bytes(uint64_t{1},
                  uint32_t{8},
                  uint32_t{1},
                  pose_bytes,
                  uint32_t{1},
                  Bytes(int32_t{0}, uint32_t{2}, uint64_t{1} << 40)));
}

TEST(ColmapModelBinary, WriteReadWriteIsByteEqual) {
  const Reconstruction model = SampleModelWithRigs();
  for (const FileKind& kind : kKinds) {
    const std::string bytes = Written(kind, model);
    EXPECT_GT(bytes.size(), 8u);
    EXPECT_EQ(Written(kind, Parsed(kind, bytes)), bytes);
  }
}

TEST(ColmapModelBinary, EveryTruncationAndEveryTailIsAnError) {
  const Reconstruction model = SampleModelWithRigs();
  for (const FileKind& kind : kKinds) {
    const std::string bytes = Written(kind, model);
    for (size_t length = 0; length < bytes.size(); ++length) {
      const std::string prefix = bytes.substr(0, length);
      EXPECT_THAT(ErrorOf([&] { Parsed(kind, prefix); }), HasSubstr("file.bin: ")) << length;
    }
    EXPECT_THAT(ErrorOf([&] { Parsed(kind, bytes + '\0'); }), HasSubstr("1 bytes after the last"));
  }
}

TEST(ColmapModelBinary, AbsurdCountsAreRefusedBeforeAllocation) {
  const uint64_t absurd = uint64_t{1} << 60;
  for (const FileKind& kind : kKinds) {
    EXPECT_THAT(ErrorOf([&] { Parsed(kind, Bytes(absurd, std::string(200, '\0'))); }),
                HasSubstr(std::to_string(absurd)));
  }
  const std::string image = Bytes(uint64_t{1}, uint32_t{1}, kIdentityPose, uint32_t{1}, "a", '\0');
  EXPECT_THAT(ErrorOf([&] { Parsed(kKinds[1], Bytes(image, absurd)); }), HasSubstr("announces"));
  const std::string point =
      Bytes(uint64_t{1}, uint64_t{1}, 0.0, 0.0, 0.0, std::string(3, '\0'), 0.0);
  EXPECT_THAT(ErrorOf([&] { Parsed(kKinds[2], Bytes(point, kNone)); }), HasSubstr("announces"));
  const std::string rig = Bytes(uint64_t{1}, uint32_t{1}, ~uint32_t{0});
  EXPECT_THAT(ErrorOf([&] { Parsed(kKinds[3], rig); }), HasSubstr("announces"));
  const std::string frame = Bytes(uint64_t{1}, uint32_t{1}, uint32_t{1}, kIdentityPose);
  EXPECT_THAT(ErrorOf([&] { Parsed(kKinds[4], Bytes(frame, ~uint32_t{0})); }),
              HasSubstr("announces"));
}

TEST(ColmapModelBinary, RigsWithoutOrWithRepeatedSensorsAreErrors) {
  EXPECT_THAT(ErrorOf([] { Parsed(kKinds[3], Bytes(uint64_t{1}, uint32_t{1}, uint32_t{0})); }),
              HasSubstr("no sensor in rig 1"));
  const std::string sensor = Bytes(int32_t{0}, uint32_t{4}, uint8_t{0});
  const std::string repeated =
      Bytes(uint64_t{1}, uint32_t{1}, uint32_t{3}, Bytes(int32_t{0}, uint32_t{2}), sensor, sensor);
  EXPECT_THAT(ErrorOf([&] { Parsed(kKinds[3], repeated); }), HasSubstr("twice"));
}

TEST(ColmapModelBinary, UnknownCameraModelsAreErrors) {
  for (const int32_t model_id : {-1, 11, 17, std::numeric_limits<int32_t>::max()}) {
    std::string bytes = Bytes(uint64_t{1}, kSmallCamera);
    bytes.replace(12, 4, Bytes(model_id));
    EXPECT_THAT(ErrorOf([&] { Parsed(kKinds[0], bytes); }),
                HasSubstr("model " + std::to_string(model_id)));
  }
}

TEST(ColmapModelBinary, NonFinitePosesAreErrors) {
  for (size_t value = 0; value < 7; ++value) {
    std::string bytes =
        Bytes(uint64_t{1}, uint32_t{1}, kIdentityPose, uint32_t{1}, "a", '\0', uint64_t{0});
    bytes.replace(12 + 8 * value, 8, Bytes(kNaN));
    EXPECT_THAT(ErrorOf([&] { Parsed(kKinds[1], bytes); }),
                HasSubstr("image 1 that is not finite"));
  }
}

}  // namespace
}  // namespace vgtw
