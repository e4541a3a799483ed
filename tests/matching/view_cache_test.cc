// SPDX-License-Identifier: BSD-3-Clause
#include "matching/view_cache.h"

#include "tests/matching/point_views.h"

#include <atomic>
#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Loads that were asked for, in their order. A view of 10 features takes 10 * (128 + 48) bytes.
struct Loads {
  ViewCache Cache(int64_t max_memory) {
    return ViewCache(
        [this](size_t idx) {
          idxs.push_back(idx);
          return views.at(idx);
        },
        max_memory);
  }
  std::vector<ViewFeatures> views = MakePointViews(3, 10);
  std::vector<size_t> idxs;
};
constexpr int64_t kBytesPerView = 1760;

TEST(ViewCache, TheLeastRecentlyUsedLeaves) {
  Loads loads;
  ViewCache cache = loads.Cache(2 * kBytesPerView);
  for (const size_t idx : {0, 1, 0, 2, 0, 1}) {
    EXPECT_EQ(cache.Get(idx)->features().view.name, std::to_string(idx));
  }
  EXPECT_THAT(loads.idxs, testing::ElementsAre(0, 1, 2, 1));
}

TEST(ViewCache, WhatIsInUseStaysUsable) {
  Loads loads;
  ViewCache cache = loads.Cache(1);
  const ViewCache::View held = cache.Get(0);
  cache.Get(1);
  EXPECT_EQ(held->features().size(), 10u);
  cache.Get(0);
  EXPECT_THAT(loads.idxs, testing::ElementsAre(0, 1, 0));
}

TEST(ViewCache, ManyThreadsLoadAViewOnce) {
  Loads loads;
  ViewCache cache = loads.Cache(int64_t{1} << 30);
  std::atomic<size_t> num_features = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] { num_features += cache.Get(2)->features().size(); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_features, 80u);
  EXPECT_THAT(loads.idxs, testing::ElementsAre(2));
}

TEST(ViewCache, FailuresReachWhoeverAsks) {
  ViewCache cache([](size_t) -> ViewFeatures { throw std::runtime_error("gone"); }, 1);
  EXPECT_THROW(cache.Get(0), std::runtime_error);
  EXPECT_THROW(cache.Get(0), std::runtime_error);
}

}  // namespace
}  // namespace vgtw
