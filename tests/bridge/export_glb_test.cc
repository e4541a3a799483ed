// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/export_glb.h"

#include "scene/files.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <cstring>
#include <numbers>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;

// The two chunks of a GLB file, by the specification of glTF 2.0, chapter 4.
struct GlbFile {
  json header;
  std::string binary;
};

GlbFile ReadGlb(const std::filesystem::path& path) {
  const std::string bytes = ReadFile(path);
  const auto number = [&](size_t offset) {
    uint32_t value = 0;
    std::memcpy(&value, bytes.substr(offset, 4).data(), 4);
    return value;
  };
  EXPECT_EQ(bytes.substr(0, 8), "glTF" + Bytes(uint32_t{2}));
  EXPECT_EQ(number(8), bytes.size());
  GlbFile file;
  for (size_t offset = 12; offset < bytes.size(); offset += 8 + number(offset)) {
    EXPECT_EQ(number(offset) % 4, 0u);
    const std::string kind = bytes.substr(offset + 4, 4);
    const std::string content = bytes.substr(offset + 8, number(offset));
    if (kind == "JSON") {
      file.header = json::parse(content);
    } else {
      EXPECT_EQ(kind, std::string("BIN\0", 4));
      file.binary = content;
    }
  }
  return file;
}

// header[list][idx], as glTF refers to things.
const json& Entry(const json& header, const char* list, const json& idx) {
  return header.at(list).at(idx.get<size_t>());
}

View MakeView() {
  View view;
  view.name = "a/b.jpg";
  view.camera = MakePinhole(400, 200, 200.0, 100.0);
  // Stands at (1, 2, 3) and looks along the world's x; its y is the world's.
  Eigen::Matrix3d cam_from_world;
  cam_from_world << 0, 0, -1, 0, 1, 0, 1, 0, 0;
  view.cam_from_world.rotation = Eigen::Quaterniond(cam_from_world);
  view.cam_from_world.translation = -(cam_from_world * Eigen::Vector3d(1, 2, 3));
  return view;
}

const SurfaceCloud kCloud = {
    .points = {{{1.0f, -2.0f, 0.5f}, {255, 0, 188}}, {{-1.0f, 4.0f, 0.25f}, {0, 10, 255}}},
    .normals = {},
    .scalars = {{"confidence", {1.0f, 2.0f}}}};

#define VGTW_NEED_TINYGLTF() \
  if (!CanWriteGlb()) GTEST_SKIP() << "libtinygltf-dev was absent when this was built"

TEST(ExportGlb, PointsHavePositionsAndColoursInLinearLight) {
  VGTW_NEED_TINYGLTF();
  const TemporaryFolder folder;
  WriteGlb(folder / "a.glb", kCloud, {});
  const GlbFile file = ReadGlb(folder / "a.glb");
  const json& primitive = file.header.at("meshes").at(0).at("primitives").at(0);
  EXPECT_EQ(primitive.at("mode"), 0);
  const json& positions = Entry(file.header, "accessors", primitive["attributes"]["POSITION"]);
  EXPECT_EQ(positions.at("componentType"), 5126);
  EXPECT_EQ(positions.at("type"), "VEC3");
  EXPECT_EQ(positions.at("count"), 2);
  EXPECT_EQ(positions.at("min"), json({-1.0, -2.0, 0.25}));
  EXPECT_EQ(positions.at("max"), json({1.0, 4.0, 0.5}));
  const json& colors = Entry(file.header, "accessors", primitive["attributes"]["COLOR_0"]);
  EXPECT_EQ(colors.at("componentType"), 5123);
  EXPECT_EQ(colors.at("normalized"), true);
  EXPECT_EQ(colors.at("type"), "VEC4");
  const json& color_view = Entry(file.header, "bufferViews", colors.at("bufferView"));
  EXPECT_EQ(color_view.at("byteOffset"), 24);
  EXPECT_EQ(color_view.at("byteLength"), 16);
  EXPECT_EQ(file.header.at("buffers").at(0).at("byteLength"), 40);
  // sRGB 188 is 0.502886 of full light, 10 is 0.003035.
  const std::string expected =
      Bytes(1.0f, -2.0f, 0.5f, -1.0f, 4.0f, 0.25f) +
      Bytes(uint16_t{65535}, uint16_t{0}, uint16_t{32957}, uint16_t{65535}) +
      Bytes(uint16_t{0}, uint16_t{199}, uint16_t{65535}, uint16_t{65535});
  EXPECT_EQ(file.binary.substr(0, 40), expected);
  EXPECT_TRUE(file.header["materials"][0]["extensions"].contains("KHR_materials_unlit"));
}

TEST(ExportGlb, CamerasLookWhereTheyLookedBelowAWorldTurnedUp) {
  VGTW_NEED_TINYGLTF();
  const TemporaryFolder folder;
  WriteGlb(folder / "a.glb", kCloud, {MakeView()});
  const json header = ReadGlb(folder / "a.glb").header;
  const json& world = Entry(header, "nodes", header["scenes"][0]["nodes"][0]);
  EXPECT_EQ(world.at("rotation"), json({1.0, 0.0, 0.0, 0.0}));
  ASSERT_EQ(world.at("children").size(), 2u);
  const json& node = Entry(header, "nodes", world["children"][1]);
  EXPECT_EQ(node.at("name"), "a/b.jpg");
  const auto t = node.at("translation").get<std::array<double, 3>>();
  EXPECT_LT((Eigen::Vector3d(t.data()) - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  const auto q = node.at("rotation").get<std::array<double, 4>>();
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  EXPECT_LT((rotation * Eigen::Vector3d(0, 0, -1) - Eigen::Vector3d::UnitX()).norm(), 1e-12);
  EXPECT_LT((rotation * Eigen::Vector3d::UnitY() + Eigen::Vector3d::UnitY()).norm(), 1e-12);
  const json& lens = Entry(header, "cameras", node.at("camera"));
  EXPECT_EQ(lens.at("type"), "perspective");
  EXPECT_NEAR(lens.at("perspective").at("yfov"), std::numbers::pi / 2.0, 1e-12);
  EXPECT_NEAR(lens.at("perspective").at("aspectRatio"), 1.0, 1e-12);
}

TEST(ExportGlb, CamerasAloneAreAFile) {
  VGTW_NEED_TINYGLTF();
  const TemporaryFolder folder;
  WriteGlb(folder / "a.glb", {}, {MakeView()});
  const json header = ReadGlb(folder / "a.glb").header;
  EXPECT_FALSE(header.contains("meshes"));
  EXPECT_EQ(header.at("nodes").size(), 2u);
}

TEST(ExportGlb, WithoutTheLibraryItSaysWhatToInstall) {
  if (CanWriteGlb()) GTEST_SKIP() << "libtinygltf-dev was here when this was built";
  EXPECT_THAT(ErrorOf([] { WriteGlb("a.glb", kCloud, {}); }), testing::HasSubstr("libtinygltf"));
}

}  // namespace
}  // namespace vgtw
