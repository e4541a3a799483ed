// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/trajectory_text.h"

#include "tests/support/bytes.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// 90 degrees around z: x_in_world = (-y, x, z) + t.
constexpr const char* kTurned = " 1 2 3 0 0 0.70710678118654752 0.70710678118654752\n";
constexpr const char* kTurnedMatrix = "0 -1 0 1  1 0 0 2  0 0 1 3\n";

void ExpectTurned(const Rigid3d& world_from_cam) {
  const Eigen::Vector3d point = world_from_cam * Eigen::Vector3d(10, 20, 30);
  EXPECT_LT((point - Eigen::Vector3d(-20 + 1, 10 + 2, 30 + 3)).norm(), 1e-12);
}

std::string TumErrorOf(const std::string& text) {
  return ErrorOf([&] { ParseTumTrajectory(text, "t.txt"); });
}

std::string KittiErrorOf(const std::string& text) {
  return ErrorOf([&] { ParseKittiTrajectory(text, "t.txt"); });
}

TEST(TrajectoryText, TumQuaternionsComeWithTheScalarLast) {
  const auto poses = ParseTumTrajectory("# comment\n\n7.5" + std::string(kTurned), "t.txt");
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_EQ(poses[0].label, "7.5");
  ExpectTurned(poses[0].world_from_cam);
}

TEST(TrajectoryText, TumLabelsMayBeNamesWithSpaces) {
  const auto poses = ParseTumTrajectory("my photo 1.jpg 1 2 3 0 0 0 1\r\n", "t.txt");
  EXPECT_EQ(poses[0].label, "my photo 1.jpg");
  EXPECT_EQ(ParseTumTrajectory("a,1,2,3,0,0,0,1", "t.csv")[0].label, "a");
}

TEST(TrajectoryText, DamagedTumLinesAreNamed) {
  for (const char* bad : {"1 2 3 0 0 0 1",          // no label
                          "1.0 1 2 3 0 0 0 x",      // no number
                          "1.0 1 2 nan 0 0 0 1",    // not finite
                          "1.0 1 2 1e999 0 0 0 1",  // too large
                          "1.0 1 2 3 0 0 0 0",      // no rotation
                          "1.0 1 2 3 0 0 0 2"}) {   // not of unit length
    const std::string message = TumErrorOf("0.5 1 2 3 0 0 0 1\n" + std::string(bad) + "\n");
    EXPECT_NE(message.find("line 2"), std::string::npos) << bad << ": " << message;
  }
  EXPECT_NE(TumErrorOf(""), "");
  EXPECT_NE(TumErrorOf("# nothing\n"), "");
}

TEST(TrajectoryText, KittiLinesAreMatricesRowByRow) {
  const auto poses =
      ParseKittiTrajectory("1 0 0 0 0 1 0 0 0 0 1 0\n" + std::string(kTurnedMatrix), "t.txt");
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(poses[0].translation.norm(), 0.0);
  ExpectTurned(poses[1]);
}

TEST(TrajectoryText, DamagedKittiLinesAreNamed) {
  for (const char* bad : {"1 0 0 0 0 1 0 0 0 0 1",       // eleven
                          "1 0 0 0 0 1 0 0 0 0 1 0 0",   // thirteen
                          "1 0 0 0 0 1 0 0 0 0 1 inf",   // not finite
                          "1 0 0 0 0 1 0 0 0 0 -1 0",    // a mirror
                          "2 0 0 0 0 2 0 0 0 0 2 0"}) {  // scaled
    const std::string message = KittiErrorOf(kTurnedMatrix + std::string(bad) + "\n");
    EXPECT_NE(message.find("line 2"), std::string::npos) << bad << ": " << message;
  }
  EXPECT_NE(KittiErrorOf(""), "");
}

TEST(TrajectoryText, FormatsAreToldByTheirFirstPose) {
  EXPECT_EQ(FindTrajectoryFormat("# a comment\n\n" + std::string(kTurnedMatrix)),
            TrajectoryFormat::kKitti);
  EXPECT_EQ(FindTrajectoryFormat("1.5" + std::string(kTurned)), TrajectoryFormat::kTum);
  EXPECT_EQ(FindTrajectoryFormat("a b c d" + std::string(kTurned)), TrajectoryFormat::kTum);
  EXPECT_FALSE(FindTrajectoryFormat("1 2 3\n"));
  // A 4x4 matrix, whose end looks like a translation and a unit quaternion.
  EXPECT_FALSE(FindTrajectoryFormat("1 0 0 7 0 1 0 8 0 0 1 9 0 0 0 1\n"));
  EXPECT_FALSE(FindTrajectoryFormat(""));
}

TEST(TrajectoryText, RowsHaveTheirNumberOfColumns) {
  EXPECT_EQ(ParseNumberRows("# fx fy cx cy\n1 2.5 -3 4e1\n\n5,6,7,8\r\n", 4, "k"),
            (std::vector<std::vector<double>>{{1, 2.5, -3, 40}, {5, 6, 7, 8}}));
  for (const char* bad : {"1 2 3", "1 2 3 4 5", "1 2 nan 4", "1 2 x 4"}) {
    try {
      ParseNumberRows("1 2 3 4\n" + std::string(bad) + "\n", 4, "k");
      ADD_FAILURE() << bad;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("line 2"), std::string::npos) << error.what();
    }
  }
  EXPECT_THROW(ParseNumberRows("\n", 4, "k"), Error);
}

TEST(TrajectoryText, TimestampsAreFiniteNumbers) {
  EXPECT_EQ(ParseTimestamp("1305031102.175304"), 1305031102.175304);
  EXPECT_EQ(ParseTimestamp("+2"), 2.0);
  EXPECT_FALSE(ParseTimestamp("2.jpg"));
  EXPECT_FALSE(ParseTimestamp("nan"));
  EXPECT_FALSE(ParseTimestamp(""));
}

}  // namespace
}  // namespace vgtw
