// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <chrono>
#include <string>

namespace vgtw {

// kBar on a terminal, kPlain otherwise, unless --progress says so.
enum class ProgressStyle { kAuto, kBar, kPlain, kJson, kNone };

// Sets the style for the whole program: "auto", "bar", "plain", "json", "none".
void SetProgressStyle(const std::string& style);

// Shows on stderr how far one piece of work is: nothing before 2 s, then at most four lines or
// updates per second (plain: every 5 s), with the time left. stdout stays free for results.
class ProgressDisplay {
 public:
  explicit ProgressDisplay(std::string label);
  ~ProgressDisplay();  // ends the line

  ProgressCallback Callback();

 private:
  void Show(int64_t done, int64_t total);

  std::string label_;
  ProgressStyle style_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_shown_;
  bool has_shown_ = false;
};

// One line on stderr ("vgtw: <text>", or a JSON object): a stage begins, a command is run.
void Announce(const std::string& text);

}  // namespace vgtw
