// SPDX-License-Identifier: BSD-3-Clause
#include "scene/parallel.h"

#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(ParallelFor, DoesEveryUnitOnce) {
  for (const int num_threads : {1, 2, 7, 100}) {
    for (const int64_t n : {0, 1, 2, 50}) {
      std::vector<std::atomic<int>> num_calls(50);
      ParallelFor(n, num_threads, [&](int64_t i) { ++num_calls[static_cast<size_t>(i)]; });
      for (size_t i = 0; i < 50; ++i) {
        EXPECT_EQ(num_calls[i], static_cast<int64_t>(i) < n ? 1 : 0) << num_threads << ' ' << n;
      }
    }
  }
}

TEST(ParallelFor, UsesAsManyThreadsAsAsked) {
  // Three units that wait for each other can only end on three threads.
  std::atomic<int> num_started = 0;
  ParallelFor(3, 3, [&](int64_t) {
    ++num_started;
    while (num_started < 3) std::this_thread::yield();
  });
  EXPECT_EQ(num_started, 3);
}

TEST(ParallelFor, RethrowsAndStops) {
  for (const int num_threads : {1, 4}) {
    std::atomic<int> num_calls = 0;
    const auto work = [&](int64_t i) {
      ++num_calls;
      if (i == 3) throw std::runtime_error("unit 3");
    };
    try {
      ParallelFor(1'000'000, num_threads, work);
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "unit 3");
    }
    EXPECT_LT(num_calls, 1'000'000);
  }
}

TEST(ParallelFor, RethrowsWhatTheLowestThrewWhoeverWasFirst) {
  std::atomic<bool> has_second_thrown = false;
  const auto work = [&](int64_t i) {
    if (i == 1) has_second_thrown = true;
    while (!has_second_thrown) std::this_thread::yield();
    throw std::runtime_error("unit " + std::to_string(i));
  };
  try {
    ParallelFor(2, 2, work);
    FAIL() << "nothing was thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "unit 0");
  }
}

TEST(ParallelFor, ReportsProgressInOrderByOneThreadAtATime) {
  std::vector<int64_t> reports;  // not atomic: the lock protects it
  const auto progress = [&](int64_t done, int64_t total) {
    EXPECT_EQ(total, 100);
    reports.push_back(done);
  };
  ParallelFor(
      100, 4, [](int64_t) {}, progress);
  ASSERT_EQ(reports.size(), 100u);
  for (size_t i = 0; i < reports.size(); ++i) EXPECT_EQ(reports[i], static_cast<int64_t>(i) + 1);
}

TEST(ParallelFor, ExceptionOfProgressIsRethrown) {
  const auto progress = [](int64_t, int64_t) { throw std::runtime_error("stop"); };
  EXPECT_THROW(ParallelFor(
                   10, 2, [](int64_t) {}, progress),
               std::runtime_error);
}

TEST(ResolveThreads, TakesAllCoresForZeroOrLess) {
  EXPECT_EQ(ResolveThreads(3), 3);
  EXPECT_GE(ResolveThreads(0), 1);
  EXPECT_EQ(ResolveThreads(-1), ResolveThreads(0));
}

}  // namespace
}  // namespace vgtw
