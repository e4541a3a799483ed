// SPDX-License-Identifier: BSD-3-Clause
#include "matching/match_views.h"

#include "matching/ordered_sink.h"
#include "matching/view_cache.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <optional>
#include <utility>

namespace vgtw {
namespace {

// Pairs of which every view has its most covisible one.
std::vector<size_t> BestPairs(const std::vector<ViewPair>& pairs, size_t num_views) {
  std::vector<size_t> by_covisibility(pairs.size());
  std::iota(by_covisibility.begin(), by_covisibility.end(), size_t{0});
  std::stable_sort(by_covisibility.begin(), by_covisibility.end(), [&](size_t a, size_t b) {
    return pairs[a].covisibility > pairs[b].covisibility;
  });
  std::vector<bool> has_pair(num_views, false);
  std::vector<size_t> best;
  for (const size_t idx : by_covisibility) {
    const auto& [view_idx1, view_idx2, covisibility, angle_deg] = pairs[idx];
    if (has_pair[view_idx1] && has_pair[view_idx2]) continue;
    has_pair[view_idx1] = has_pair[view_idx2] = true;
    best.push_back(idx);
  }
  std::sort(best.begin(), best.end());
  return best;
}

// All pairs of one run, in two batches.
class Run {
 public:
  Run(const std::vector<ViewPair>& pairs,
      size_t num_views,
      const LoadViewFeatures& load,
      const TakeMatchedPair& take,
      const MatchViewsOptions& options,
      const ProgressCallback& progress)
      : pairs_(pairs),
        options_(options),
        progress_(progress),
        cache_(load, options.max_memory),
        ordered_sink_(take),
        num_widenings_(pairs.size()),
        first_widenings_(num_views) {}

  void Do(const std::vector<size_t>& pair_idxs) {
    const int64_t num_before = num_done_;
    ParallelFor(
        static_cast<int64_t>(pair_idxs.size()),
        options_.num_threads,
        [&](int64_t i) {
          const size_t pair_idx = pair_idxs[static_cast<size_t>(i)];
          MatchedPair matched = Match(pairs_[pair_idx]);
          num_widenings_[pair_idx] = matched.num_widenings;
          ordered_sink_.Put(pair_idx, std::move(matched));
        },
        [&](int64_t done, int64_t) {
          num_done_ = num_before + done;
          if (progress_) progress_(num_done_, static_cast<int64_t>(pairs_.size()));
        });
  }

  // From now on each view's pairs start with the windows that its first ones needed.
  void LearnWidenings(const std::vector<size_t>& pair_idxs) {
    for (const size_t pair_idx : pair_idxs) {
      for (const size_t view_idx : {pairs_[pair_idx].view_idx1, pairs_[pair_idx].view_idx2}) {
        // A pair needs what the worse of its views needs: the least of a view's pairs is its own.
        const int num_widenings = num_widenings_[pair_idx];
        first_widenings_[view_idx] =
            std::min(first_widenings_[view_idx].value_or(num_widenings), num_widenings);
      }
    }
  }

 private:
  MatchedPair Match(const ViewPair& pair) {
    const ViewCache::View view1 = cache_.Get(pair.view_idx1);
    const ViewCache::View view2 = cache_.Get(pair.view_idx2);
    MatchPairOptions options = options_.pair;
    options.min_num_widenings = std::max(first_widenings_[pair.view_idx1].value_or(0),
                                         first_widenings_[pair.view_idx2].value_or(0));
    return MatchPair(*view1, *view2, options);
  }

  const std::vector<ViewPair>& pairs_;
  const MatchViewsOptions& options_;
  const ProgressCallback& progress_;
  ViewCache cache_;
  OrderedSink<MatchedPair> ordered_sink_;
  int64_t num_done_ = 0;
  std::vector<int> num_widenings_;                   // per pair
  std::vector<std::optional<int>> first_widenings_;  // per view
};

}  // namespace

void MatchViews(const std::vector<ViewPair>& pairs,
                size_t num_views,
                const LoadViewFeatures& load,
                const TakeMatchedPair& take,
                const MatchViewsOptions& options,
                const ProgressCallback& progress) {
  options.pair.Check();
  for (const ViewPair& pair : pairs) {
    VGTW_CHECK(pair.view_idx1 < num_views && pair.view_idx2 < num_views, "views of a pair");
  }
  Run run(pairs, num_views, load, take, options, progress);
  const std::vector<size_t> best = BestPairs(pairs, num_views);
  run.Do(best);
  run.LearnWidenings(best);
  std::vector<size_t> all(pairs.size()), rest;
  std::iota(all.begin(), all.end(), size_t{0});
  std::set_difference(all.begin(), all.end(), best.begin(), best.end(), std::back_inserter(rest));
  run.Do(rest);
}

}  // namespace vgtw
