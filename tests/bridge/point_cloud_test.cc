// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/point_cloud.h"

#include "bridge/colmap_model.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/sample_model.h"
#include "tests/support/bytes.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

const std::filesystem::path kPath = "a.ply";

std::vector<ColoredPoint> Parsed(const std::string& bytes) {
  return ParsePly(AsBytes(bytes), kPath);
}

std::string ErrorIn(const std::string& bytes) {
  return ErrorOf([&] { Parsed(bytes); });
}

const std::vector<ColoredPoint> kPoints = {{{1.0f, -2.0f, 0.1f}, {255, 0, 7}},
                                           {{4.0f, 5.0f, 6.0f}, {1, 2, 3}}};

void ExpectSamePoints(const std::vector<ColoredPoint>& a, const std::vector<ColoredPoint>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].xyz, b[i].xyz);
    EXPECT_EQ(a[i].rgb, b[i].rgb);
  }
}

TEST(PointCloud, PlyIsTheBytesOfTheFormat) {
  const TemporaryFolder folder;
  WritePly(folder / "a.ply", {kPoints[0]});
  EXPECT_EQ(ReadFile(folder / "a.ply"),
            "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
            "property float x\nproperty float y\nproperty float z\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n" +
                Bytes(1.0f, -2.0f, 0.1f, uint8_t{255}, uint8_t{0}, uint8_t{7}));
}

TEST(PointCloud, PlyIsReadBackExactly) {
  const TemporaryFolder folder;
  WritePly(folder / "a.ply", kPoints);
  ExpectSamePoints(ReadPly(folder / "a.ply"), kPoints);
  WritePly(folder / "empty.ply", {});
  EXPECT_TRUE(ReadPly(folder / "empty.ply").empty());
}

TEST(PointCloud, PcdIsTheBytesThatPclReads) {
  const TemporaryFolder folder;
  WritePcd(folder / "a.pcd", kPoints);
  EXPECT_EQ(ReadFile(folder / "a.pcd"),
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\n"
            "COUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA binary\n" +
                // PCL packs colours as 0x00rrggbb.
                Bytes(1.0f, -2.0f, 0.1f, uint32_t{0x00ff0007}) +
                Bytes(4.0f, 5.0f, 6.0f, uint32_t{0x00010203}));
}

TEST(PointCloud, AsciiPlyWithOtherElementsIsRead) {
  const std::string text =
      "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement camera 1\r\nproperty float f\r\n"
      "property list uchar int v\r\nelement nothing 1152921504606846976\r\n"
      "element vertex 2\r\nproperty uchar red\r\nproperty double z\r\nproperty float nx\r\n"
      "property double x\r\nproperty uchar green\r\nproperty uchar blue\r\nproperty int y\r\n"
      "element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
      "7.5 2 10 11\r\n255 0.1 9 1 0 7 -2\r\n1 6 9 4 2 3 5\r\n3 0 1 1\r\n";
  ExpectSamePoints(Parsed(text), kPoints);
}

TEST(PointCloud, BinaryPlyWithListsIsRead) {
  const std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement face 2\nproperty list ushort int8 i\n"
      "element vertex 1\nproperty list uint8 double weights\nproperty double x\nproperty int16 y\n"
      "property uint8 z\nproperty float red\nend_header\n" +
      Bytes(uint16_t{3}, std::string(3, 'x'), uint16_t{0}) +
      Bytes(uint8_t{1}, 0.25, 0.5, int16_t{-300}, uint8_t{200}, 0.9f);
  // A colour that is not uchar has no agreed scale and is left out.
  ExpectSamePoints(Parsed(bytes), {{{0.5f, -300.0f, 200.0f}, {0, 0, 0}}});
}

TEST(PointCloud, PointsThatAreNotFiniteAreLeftOut) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n";
  ExpectSamePoints(Parsed(header + "nan 1 2\n1 2 3\n1e300 0 0\n"), {{{1.0f, 2.0f, 3.0f}, {}}});
}

TEST(PointCloud, EveryTruncationIsAnError) {
  const TemporaryFolder folder;
  WritePly(folder / "a.ply", kPoints);
  const std::string bytes = ReadFile(folder / "a.ply");
  for (size_t length = 0; length < bytes.size(); ++length) {
    EXPECT_THAT(ErrorIn(bytes.substr(0, length)), HasSubstr("a.ply: ")) << length;
  }
}

TEST(PointCloud, WrongFilesAreErrors) {
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  struct Case {
    std::string bytes;
    std::string message;
  };
  const std::vector<Case> cases = {
      {"", "ends inside its header"},
      {"PLY\n", "does not begin with ply"},
      {"ply\nformat binary_big_endian 1.0\n", "format 'binary_big_endian'"},
      {"ply\nelement vertex 0\n" + xyz + "end_header\n", "names no format"},
      {"ply\nelement vertex -1\n", "no count for element vertex"},
      {"ply\nelement vertex 99999999999999999999\n", "no count"},
      {"ply\nproperty float x\n", "property before any element"},
      {"ply\nelement vertex 1\nproperty half x\n", "type 'half'"},
      {"ply\nelement vertex 1\nproperty list float\n", "type ''"},
      {"ply\nhello\n", "'hello' in its header"},
      {"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "no element vertex"},
      {"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nend_header\n", "x y z"},
      {"ply\nformat ascii 1.0\nelement vertex 1152921504606846976\n" + xyz + "end_header\n1 2 3",
       "ends early"},
      {"ply\nformat binary_little_endian 1.0\nelement vertex 1152921504606846976\n" + xyz +
           "end_header\n0123456789ab",
       "ends at byte 12"},
      {"ply\nformat ascii 1.0\nelement vertex 1\n" + xyz + "end_header\n1 x 3", "'x' among"},
      {"ply\nformat ascii 1.0\nelement vertex 1\nproperty list char float w\n" + xyz +
           "end_header\n-1 2 3 4",
       "list of -1"},
      {"ply\nformat ascii 1.0\nelement vertex 1\nproperty list float float w\n" + xyz +
           "end_header\n1e300 2 3 4",
       "ends early"},
  };
  for (const auto& [bytes, message] : cases) {
    EXPECT_THAT(ErrorIn(bytes), HasSubstr(message)) << bytes;
  }
}

TEST(PointCloud, PointsOfAModelKeepOrderAndColour) {
  const std::vector<ColoredPoint> points = PointsOf(SampleModel());
  ExpectSamePoints(points, {{{1.0f, -2.0f, 3.0f}, {255, 0, 128}}, {{0.1f, 0.2f, 0.3f}, {1, 2, 3}}});
}

TEST(PointCloud, UnwritableAndMissingFilesAreErrors) {
  const TemporaryFolder folder;
  EXPECT_THAT(ErrorOf([&] { WritePly(folder / "no/a.ply", kPoints); }), HasSubstr("cannot be"));
  EXPECT_THAT(ErrorOf([&] { WritePcd(folder / "no/a.pcd", kPoints); }), HasSubstr("cannot be"));
  EXPECT_THAT(ErrorOf([&] { ReadPly(folder / "a.ply"); }), HasSubstr("cannot be read"));
}

TEST(PointCloud, RealPlyIsTheModelItLiesBeside) {
  VGTW_NEED_SHARED_DATA();
  const auto folder = SharedData() / "llff_fern_vggt/vggt";
  // points3D.bin was made from points.ply, point by point.
  ExpectSamePoints(ReadPly(folder / "points.ply"), PointsOf(ReadModel(folder)));
}

}  // namespace
}  // namespace vgtw
