// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/transforms_json.h"

#include "tests/support/bytes.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::string FileOf(const std::string& matrix, const std::string& name = "\"./images/a.jpg\"") {
  return R"({"camera_angle_x": 0.7, "frames": [{"file_path": )" + name +
         R"(, "transform_matrix": )" + matrix + "}]}";
}

const std::string kIdentity = "[[1,0,0,2],[0,1,0,3],[0,0,1,4],[0,0,0,1]]";

TEST(TransformsJson, CamerasLookAlongMinusZ) {
  const auto frames = ParseTransformsJson(FileOf(kIdentity), "t.json");
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].name, "images/a.jpg");
  // A point 5 in front of our camera lies at -z of the file's, a point below it at -y.
  const Eigen::Vector3d ahead = frames[0].world_from_cam * Eigen::Vector3d(0, 0, 5);
  EXPECT_LT((ahead - Eigen::Vector3d(2, 3, 4 - 5)).norm(), 1e-12);
  const Eigen::Vector3d below = frames[0].world_from_cam * Eigen::Vector3d(0, 1, 0);
  EXPECT_LT((below - Eigen::Vector3d(2, 3 - 1, 4)).norm(), 1e-12);
}

TEST(TransformsJson, FramesKeepTheirOrder) {
  const std::string frame = R"({"file_path": "b", "transform_matrix": )" + kIdentity + "}";
  const std::string other = R"({"file_path": "a", "transform_matrix": )" + kIdentity + "}";
  const auto frames = ParseTransformsJson("{\"frames\": [" + frame + "," + other + "]}", "t.json");
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].name, "b");
  EXPECT_EQ(frames[1].name, "a");
}

TEST(TransformsJson, MatricesMayLackTheLastRow) {
  EXPECT_EQ(ParseTransformsJson(FileOf("[[1,0,0,0],[0,1,0,0],[0,0,1,0]]"), "t.json").size(), 1u);
}

TEST(TransformsJson, DamageIsAnErrorOfOneLine) {
  for (const std::string& bad : {std::string("{"),
                                 std::string("[]"),
                                 std::string("{}"),
                                 std::string("{\"frames\": []}"),
                                 std::string("{\"frames\": [1]}"),
                                 FileOf(kIdentity, "7"),
                                 FileOf("1"),
                                 FileOf("[[1,0,0,0],[0,1,0,0]]"),
                                 FileOf("[[1,0,0],[0,1,0],[0,0,1]]"),
                                 FileOf("[[1,0,0,0],[0,1,0,0],[0,0,\"1\",0],[0,0,0,1]]"),
                                 FileOf("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]"),
                                 FileOf("[[1,0,0,1e999],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"),
                                 FileOf("[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]"),
                                 FileOf("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]")}) {
    const std::string message = ErrorOf([&] { ParseTransformsJson(bad, "t.json"); });
    EXPECT_EQ(message.find("t.json"), 0u) << bad << ": " << message;
  }
}

}  // namespace
}  // namespace vgtw
