// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/progress.h"

#include <chrono>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

std::string StderrOf(const std::function<void()>& work) {
  testing::internal::CaptureStderr();
  work();
  return testing::internal::GetCapturedStderr();
}

// Progress of 4 units, the last two of which come after the 2 s in which nothing is shown.
void WorkForTwoSeconds() {
  ProgressDisplay display("matching");
  const ProgressCallback progress = display.Callback();
  progress(1, 4);
  std::this_thread::sleep_for(std::chrono::milliseconds(2100));
  progress(2, 4);
  progress(4, 4);
}

TEST(Progress, SaysNothingAboutShortWork) {
  SetProgressStyle("plain");
  EXPECT_EQ(StderrOf([] {
              ProgressDisplay display("short");
              display.Callback()(1, 2);
              display.Callback()(2, 2);
            }),
            "");
}

TEST(Progress, PlainLinesTellDoneTotalAndTimeLeft) {
  SetProgressStyle("plain");
  // Half was done after 2.1 s, so about 2 s are left.
  EXPECT_EQ(StderrOf(WorkForTwoSeconds),
            "matching: 2/4, 2 s, about 2 s left\nmatching: 4/4, 2 s, about 0 s left\n");
}

TEST(Progress, JsonLinesCarryTheSameForMachines) {
  SetProgressStyle("json");
  const std::string text = StderrOf(WorkForTwoSeconds);
  const nlohmann::json first = nlohmann::json::parse(text.substr(0, text.find('\n')));
  EXPECT_EQ(first["progress"], "matching");
  EXPECT_EQ(first["done"], 2);
  EXPECT_EQ(first["total"], 4);
  EXPECT_NEAR(first["eta_sec"].get<double>(), first["elapsed_sec"].get<double>(), 1e-9);
  EXPECT_EQ(StderrOf([] { Announce("a stage"); }), "{\"message\":\"a stage\"}\n");
}

TEST(Progress, NoneIsSilent) {
  SetProgressStyle("none");
  EXPECT_EQ(StderrOf([] {
              WorkForTwoSeconds();
              Announce("a stage");
            }),
            "");
}

}  // namespace
}  // namespace vgtw
