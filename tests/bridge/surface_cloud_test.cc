// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/surface_cloud.h"

#include "scene/files.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

SurfaceCloud MakeCloud() {
  return {.points = {{{1.0f, -2.0f, 0.1f}, {255, 0, 7}}},
          .normals = {{0.0f, 0.6f, -0.8f}},
          .scalars = {{"confidence", {2.5f}}, {"error", {-1.0f}}}};
}

TEST(SurfaceCloud, PlyHoldsEverythingInTheOrderOfColmapsFusion) {
  const TemporaryFolder folder;
  WritePly(folder / "a.ply", MakeCloud());
  EXPECT_EQ(ReadFile(folder / "a.ply"),
            "ply\nformat binary_little_endian 1.0\nelement vertex 1\n"
            "property float x\nproperty float y\nproperty float z\n"
            "property float nx\nproperty float ny\nproperty float nz\n"
            "property uchar red\nproperty uchar green\nproperty uchar blue\n"
            "property float confidence\nproperty float error\nend_header\n" +
                Bytes(1.0f, -2.0f, 0.1f, 0.0f, 0.6f, -0.8f) +
                Bytes(uint8_t{255}, uint8_t{0}, uint8_t{7}, 2.5f, -1.0f));
}

TEST(SurfaceCloud, PcdHasTheNamesThatPclMaps) {
  const TemporaryFolder folder;
  WritePcd(folder / "a.pcd", MakeCloud());
  EXPECT_EQ(ReadFile(folder / "a.pcd"),
            "# .PCD v0.7\nVERSION 0.7\n"
            "FIELDS x y z rgb normal_x normal_y normal_z confidence error\n"
            "SIZE 4 4 4 4 4 4 4 4 4\nTYPE F F F F F F F F F\nCOUNT 1 1 1 1 1 1 1 1 1\n"
            "WIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA binary\n" +
                Bytes(1.0f, -2.0f, 0.1f, uint32_t{0x00ff0007}) +
                Bytes(0.0f, 0.6f, -0.8f, 2.5f, -1.0f));
}

TEST(SurfaceCloud, AppendJoinsEveryList) {
  SurfaceCloud cloud;
  Append(MakeCloud(), cloud);
  Append(MakeCloud(), cloud);
  EXPECT_EQ(cloud.points.size(), 2u);
  EXPECT_EQ(cloud.normals.size(), 2u);
  EXPECT_EQ(cloud.scalars[0].values, (std::vector<float>{2.5f, 2.5f}));
}

TEST(SurfaceCloud, ListsOfOtherLengthsAreRefused) {
  const TemporaryFolder folder;
  SurfaceCloud cloud = MakeCloud();
  cloud.scalars[1].values.clear();
  EXPECT_THROW(WritePly(folder / "a.ply", cloud), std::invalid_argument);
  EXPECT_THROW(WritePcd(folder / "a.pcd", cloud), std::invalid_argument);
  SurfaceCloud joined = MakeCloud();
  EXPECT_THROW(Append({.points = cloud.points, .normals = {}, .scalars = {}}, joined),
               std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
