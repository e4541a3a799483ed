// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/progress.h"

#include <cstdio>

#include <nlohmann/json.hpp>
#include <unistd.h>

namespace vgtw {
namespace {

using Clock = std::chrono::steady_clock;

ProgressStyle chosen_style = ProgressStyle::kAuto;

ProgressStyle ResolvedStyle() {
  if (chosen_style != ProgressStyle::kAuto) return chosen_style;
  return ::isatty(STDERR_FILENO) != 0 ? ProgressStyle::kBar : ProgressStyle::kPlain;
}

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void PrintJson(const nlohmann::json& object) {
  std::fprintf(stderr,
               "%s\n",
               object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

}  // namespace

void SetProgressStyle(const std::string& style) {
  if (style == "bar") chosen_style = ProgressStyle::kBar;
  if (style == "plain") chosen_style = ProgressStyle::kPlain;
  if (style == "json") chosen_style = ProgressStyle::kJson;
  if (style == "none") chosen_style = ProgressStyle::kNone;
}

ProgressDisplay::ProgressDisplay(std::string label)
    : label_(std::move(label)),
      style_(ResolvedStyle()),
      start_(Clock::now()),
      last_shown_(start_) {}

ProgressDisplay::~ProgressDisplay() {
  if (has_shown_ && style_ == ProgressStyle::kBar) std::fputc('\n', stderr);
}

ProgressCallback ProgressDisplay::Callback() {
  return [this](int64_t done, int64_t total) { Show(done, total); };
}

void ProgressDisplay::Show(int64_t done, int64_t total) {
  constexpr double kQuietSec = 2.0;
  const double interval_sec = style_ == ProgressStyle::kPlain ? 5.0 : 0.25;
  const double elapsed_sec = SecondsSince(start_);
  const bool is_last = done >= total;
  if (style_ == ProgressStyle::kNone || elapsed_sec < kQuietSec) return;
  if (has_shown_ && !is_last && SecondsSince(last_shown_) < interval_sec) return;
  has_shown_ = true;
  last_shown_ = Clock::now();
  const double eta_sec =
      done > 0 ? elapsed_sec * static_cast<double>(total - done) / static_cast<double>(done) : 0.0;
  if (style_ == ProgressStyle::kJson) {
    PrintJson({{"progress", label_},
               {"done", done},
               {"total", total},
               {"elapsed_sec", elapsed_sec},
               {"eta_sec", eta_sec}});
    return;
  }
  const bool is_bar = style_ == ProgressStyle::kBar;
  std::fprintf(stderr,
               "%s%s: %lld/%lld, %.0f s, about %.0f s left%s",
               is_bar ? "\r\033[K" : "",
               label_.c_str(),
               static_cast<long long>(done),
               static_cast<long long>(total),
               elapsed_sec,
               eta_sec,
               is_bar ? "" : "\n");
}

void Announce(const std::string& text) {
  switch (ResolvedStyle()) {
    case ProgressStyle::kNone:
      return;
    case ProgressStyle::kJson:
      PrintJson({{"message", text}});
      return;
    default:
      std::fprintf(stderr, "vgtw: %s\n", text.c_str());
  }
}

}  // namespace vgtw
