// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/refine_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(UnrefinedNotes, GroupViewsByReason) {
  nlohmann::json views;
  for (const char* name : {"a", "b", "c", "d", "e", "f", "g"}) views[name]["reason"] = "too few";
  views["h"]["reason"] = "would turn";
  views["i"]["reason"] = "";
  EXPECT_THAT(UnrefinedNotes(views),
              ElementsAre("a, b, c, d, e and 2 others keep their poses: too few",
                          "h keeps its pose: would turn"));
}

TEST(FormatRefinement, SaysWhatWasBoughtAndWhatWasNot) {
  RefineModelResult result;
  result.num_held_out_tracks = 12;
  result.held_out_before_px = 3.25;
  result.held_out_after_px = 0.5;
  result.views[1].name = "a.jpg";
  result.views[1].outcome = ViewOutcome::kRefined;
  result.views[2].name = "b.jpg";
  result.views[2].reason = "too few";
  const std::string text = FormatRefinement(result);
  EXPECT_THAT(text, HasSubstr("error of the 12 tracks held out: from 3.250 to 0.500 px\n"));
  EXPECT_THAT(text, HasSubstr("note: b.jpg keeps its pose: too few\n"));
  result.views[1].outcome = ViewOutcome::kRejected;
  result.views[1].reason = "worse";
  EXPECT_THAT(FormatRefinement(result), HasSubstr("nothing was refined"));
}

TEST(RefinementAsJson, UnknownNumbersAreNull) {
  RefineModelResult result;
  result.views[1].name = "a.jpg";
  const nlohmann::json json = AsJson(result);
  EXPECT_TRUE(json["held_out_before_px"].is_null());
  EXPECT_TRUE(json["views"]["a.jpg"]["sigma_rotation_deg"].is_null());
  EXPECT_EQ(json["views"]["a.jpg"]["outcome"], "kept");
}

}  // namespace
}  // namespace vgtw
