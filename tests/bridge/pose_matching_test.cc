// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/pose_matching.h"

#include "tests/support/bytes.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// The i-th pose lies at depth i, so that it is known again.
PoseSet Set(PoseKey key, const std::vector<std::string>& names) {
  PoseSet set;
  set.key = key;
  set.format = key == PoseKey::kLine ? PoseFormat::kKitti : PoseFormat::kTum;
  for (const std::string& name : names) {
    const auto depth = static_cast<double>(set.poses.size());
    set.poses.push_back({name, {Eigen::Quaterniond::Identity(), {0, 0, depth}}});
    if (key == PoseKey::kTimestamp) set.times_sec.push_back(std::stod(name));
  }
  return set;
}

PoseSet Named(const std::vector<std::string>& names) { return Set(PoseKey::kImageName, names); }
PoseSet Timed(const std::vector<std::string>& names) { return Set(PoseKey::kTimestamp, names); }
PoseSet Lines(const std::vector<std::string>& names) { return Set(PoseKey::kLine, names); }

// "<reference name>=<index of the estimate> ..."
std::string Pairs(const MatchedPoses& matched) {
  std::string text;
  for (const NamedPose& pose : matched.estimate) {
    text += pose.name + "=" + std::to_string(static_cast<int>(pose.cam_from_world.translation.z()));
    text += " ";
  }
  return text;
}

TEST(MatchPoses, EqualNamesBelongTogether) {
  const MatchedPoses matched =
      MatchPoses(Named({"b.jpg", "x.jpg", "a.jpg"}), Named({"a.jpg", "b.jpg", "c.jpg"}), 0.0);
  EXPECT_EQ(Pairs(matched), "b.jpg=0 a.jpg=2 ");
  EXPECT_EQ(matched.num_surplus, 1u);
  EXPECT_TRUE(matched.notes.empty());
}

TEST(MatchPoses, FoldersAndExtensionsAreIgnoredWhereNoNameIsEqual) {
  const MatchedPoses matched =
      MatchPoses(Named({"images/a.jpg", "images/b.jpg"}), Named({"a.png", "b.png"}), 0.0);
  EXPECT_EQ(Pairs(matched), "a.png=0 b.png=1 ");
  ASSERT_EQ(matched.notes.size(), 1u);
  EXPECT_NE(matched.notes[0].find("2 names"), std::string::npos) << matched.notes[0];
  EXPECT_EQ(Pairs(MatchPoses(Named({"train/r_0"}), Named({"r_0.png"}), 0.0)), "r_0.png=0 ");
  EXPECT_EQ(Pairs(MatchPoses(Named({"r_0.png"}), Named({"train/r_0"}), 0.0)), "train/r_0=0 ");
}

TEST(MatchPoses, OtherFoldersAreOtherViewsWhereSomeNamesAreEqual) {
  const MatchedPoses matched =
      MatchPoses(Named({"left/0.png", "right/1.png"}), Named({"left/0.png", "left/1.png"}), 0.0);
  EXPECT_EQ(Pairs(matched), "left/0.png=0 ");
  EXPECT_EQ(matched.num_surplus, 1u);
}

TEST(MatchPoses, TwoPosesOfOneViewAreAnError) {
  const std::string message = ErrorOf([] {
    MatchPoses(Named({"left/0.jpg", "right/0.jpg"}), Named({"0.png", "1.png"}), 0.0);
  });
  EXPECT_NE(message.find("both mean '0.png'"), std::string::npos) << message;
}

TEST(MatchPoses, TimesBelongToTheNearestWithinTheTolerance) {
  const MatchedPoses matched =
      MatchPoses(Timed({"1.02", "1.05", "2.5", "9"}), Timed({"1.0", "1.04", "2.0", "9.1"}), 0.1001);
  // 1.02 is as near to 1.04 as to 1.0; 1.05 is nearer to 1.04 and takes it.
  EXPECT_EQ(Pairs(matched), "1.0=0 1.04=1 9.1=3 ");
  EXPECT_EQ(matched.num_surplus, 1u);
  EXPECT_EQ(Pairs(MatchPoses(Timed({"1", "3"}), Timed({"1", "2"}), 0.0)), "1=0 ");
}

TEST(MatchPoses, TrajectoriesFollowTheOrderOfNamesIfTheCountsAgree) {
  for (const PoseSet& estimate : {Timed({"0.5", "0.6"}), Lines({"0", "1"})}) {
    const MatchedPoses matched = MatchPoses(estimate, Named({"a.png", "b.png"}), 0.01);
    EXPECT_EQ(Pairs(matched), "a.png=0 b.png=1 ");
    ASSERT_EQ(matched.notes.size(), 1u);
    EXPECT_NE(matched.notes[0].find("order"), std::string::npos);
  }
  EXPECT_EQ(Pairs(MatchPoses(Named({"a", "b"}), Lines({"0", "1"}), 0.0)), "0=0 1=1 ");
  EXPECT_EQ(Pairs(MatchPoses(Timed({"5", "6"}), Lines({"0", "1"}), 0.0)), "0=0 1=1 ");
  const std::string message = ErrorOf([] {
    MatchPoses(Timed({"0.5", "0.6"}), Named({"a", "b", "c"}), 0.01);
  });
  EXPECT_NE(message.find("2 poses"), std::string::npos) << message;
  EXPECT_NE(message.find("of 3"), std::string::npos) << message;
}

TEST(MatchPoses, LabelsThatAllNameViewsAreNames) {
  // Names without extension that are numbers look like timestamps.
  const PoseSet estimate = Timed({"001", "000"});
  EXPECT_EQ(Pairs(MatchPoses(estimate, Named({"000.png", "001.png", "002.png"}), 0.01)),
            "001.png=0 000.png=1 ");
}

}  // namespace
}  // namespace vgtw
