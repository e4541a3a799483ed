// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_selection.h"

#include "matching/pair_candidates.h"
#include "matching/pair_graph.h"
#include "scene/disjoint_sets.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <string>
#include <tuple>
#include <utility>

namespace vgtw {
namespace {

using IndexPair = std::pair<size_t, size_t>;

IndexPair IndicesOf(const ViewPair& pair) { return {pair.view_idx1, pair.view_idx2}; }

// The first half of `candidates`, which are sorted, and an even sample of the others.
std::vector<size_t> Thin(const std::vector<size_t>& candidates, size_t max_num) {
  if (candidates.size() <= max_num) return candidates;
  const size_t num_first = max_num / 2;
  const size_t num_others = max_num - num_first;
  std::vector<size_t> thinned(candidates.begin(),
                              candidates.begin() + static_cast<std::ptrdiff_t>(num_first));
  for (size_t i = 0; i < num_others; ++i) {
    thinned.push_back(candidates[num_first + i * (candidates.size() - num_first) / num_others]);
  }
  return thinned;
}

// Measures pairs of views that share something.
class PairMeasurer {
 public:
  PairMeasurer(const std::vector<ViewSketch>& sketches, const PairSelectionOptions& options)
      : covisibility_(sketches, options.covisibility),
        candidates_(covisibility_),
        options_(options) {}

  // Those that are covisible, by indices.
  std::vector<ViewPair> Run() const {
    const auto max_num = static_cast<size_t>(options_.max_candidates);
    std::vector<ViewPair> pairs =
        Measure(PairsOf([&](size_t view_idx) { return Thin(candidates_.Of(view_idx), max_num); }));
    DisjointSets<> parts(covisibility_.num_views());
    for (const ViewPair& pair : pairs) parts.Join(pair.view_idx1, pair.view_idx2);
    if (parts.num_sets() <= 1) return pairs;
    std::vector<size_t> part_by_view;
    for (size_t i = 0; i < covisibility_.num_views(); ++i) part_by_view.push_back(parts.Find(i));
    const std::vector<ViewPair> bridges = Measure(PairsOf([&](size_t view_idx) {
      std::vector<size_t> others = candidates_.Of(view_idx);
      std::erase_if(others, [&](size_t i) { return part_by_view[i] == part_by_view[view_idx]; });
      return others;
    }));
    std::vector<ViewPair> all;
    std::merge(pairs.begin(),
               pairs.end(),
               bridges.begin(),
               bridges.end(),
               std::back_inserter(all),
               [](const ViewPair& a, const ViewPair& b) { return IndicesOf(a) < IndicesOf(b); });
    return all;
  }

 private:
  // What `partners_of` gives for each view, without duplicates, ascending.
  std::vector<IndexPair> PairsOf(
      const std::function<std::vector<size_t>(size_t)>& partners_of) const {
    std::vector<std::vector<size_t>> partners(covisibility_.num_views());
    ParallelFor(static_cast<int64_t>(partners.size()), options_.num_threads, [&](int64_t i) {
      partners[static_cast<size_t>(i)] = partners_of(static_cast<size_t>(i));
    });
    std::vector<IndexPair> pairs;
    for (size_t i = 0; i < partners.size(); ++i) {
      for (const size_t partner : partners[i]) pairs.push_back(std::minmax(i, partner));
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
  }

  std::vector<ViewPair> Measure(const std::vector<IndexPair>& pairs) const {
    constexpr size_t kBatch = 256;  // pairs that one call of a thread measures
    std::vector<std::vector<ViewPair>> batches((pairs.size() + kBatch - 1) / kBatch);
    ParallelFor(static_cast<int64_t>(batches.size()), options_.num_threads, [&](int64_t batch) {
      const size_t begin = static_cast<size_t>(batch) * kBatch;
      for (size_t i = begin; i < std::min(begin + kBatch, pairs.size()); ++i) {
        const auto measured = covisibility_.Measure(pairs[i].first, pairs[i].second);
        if (measured) batches[static_cast<size_t>(batch)].push_back(*measured);
      }
    });
    std::vector<ViewPair> all;
    for (const auto& batch : batches) all.insert(all.end(), batch.begin(), batch.end());
    return all;
  }

  Covisibility covisibility_;
  PairCandidates candidates_;
  const PairSelectionOptions& options_;
};

// Chooses among measured pairs, which are sorted by indices.
class PairChooser {
 public:
  PairChooser(size_t num_views,
              const std::vector<ViewPair>& pairs,
              const PairSelectionOptions& options)
      : pairs_(pairs),
        options_(options),
        is_chosen_(pairs.size(), false),
        by_covisibility_(pairs.size()),
        pairs_by_view_(num_views) {
    for (size_t i = 0; i < pairs.size(); ++i) by_covisibility_[i] = i;
    std::stable_sort(by_covisibility_.begin(), by_covisibility_.end(), [&](size_t a, size_t b) {
      return std::pair(Rank(pairs[a]), -pairs[a].covisibility) <
             std::pair(Rank(pairs[b]), -pairs[b].covisibility);
    });
    for (const size_t i : by_covisibility_) {
      if (!IsGood(pairs[i])) break;
      pairs_by_view_[pairs[i].view_idx1].push_back(i);
      pairs_by_view_[pairs[i].view_idx2].push_back(i);
    }
  }

  std::vector<ViewPair> Run() {
    for (size_t i = 0; i < pairs_by_view_.size(); ++i) ChooseBest(i);
    ChooseForest();
    ChooseLoops();
    std::vector<ViewPair> chosen;
    for (size_t i = 0; i < pairs_.size(); ++i) {
      if (is_chosen_[i]) chosen.push_back(pairs_[i]);
    }
    return chosen;
  }

 private:
  // In which order the forest takes pairs.
  int Rank(const ViewPair& pair) const {
    if (pair.covisibility < options_.min_covisibility) return 2;
    return pair.angle_deg < options_.min_angle_deg ? 1 : 0;
  }
  bool IsGood(const ViewPair& pair) const { return Rank(pair) == 0; }

  size_t OtherView(size_t pair_idx, size_t view_idx) const {
    const ViewPair& pair = pairs_[pair_idx];
    return pair.view_idx1 == view_idx ? pair.view_idx2 : pair.view_idx1;
  }

  double CovisibilityOf(size_t a, size_t b) const {
    const IndexPair wanted = std::minmax(a, b);
    const auto found = std::lower_bound(
        pairs_.begin(), pairs_.end(), wanted, [](const ViewPair& pair, const IndexPair& indices) {
          return IndicesOf(pair) < indices;
        });
    return found != pairs_.end() && IndicesOf(*found) == wanted ? found->covisibility : 0.0;
  }

  void ChooseBest(size_t view_idx) {
    const std::vector<size_t>& good = pairs_by_view_[view_idx];
    const size_t num_best = std::min(good.size(), static_cast<size_t>(options_.num_best));
    std::vector<double> likeness(good.size(), 0.0);  // to the views that are paired already
    std::vector<bool> is_taken(good.size(), false);
    const auto take = [&](size_t k) {
      is_taken[k] = is_chosen_[good[k]] = true;
      const size_t taken_view = OtherView(good[k], view_idx);
      for (size_t i = num_best; i < good.size(); ++i) {
        if (is_taken[i]) continue;
        likeness[i] =
            std::max(likeness[i], CovisibilityOf(OtherView(good[i], view_idx), taken_view));
      }
    };
    for (size_t k = 0; k < num_best; ++k) take(k);
    const auto value = [&](size_t k) { return pairs_[good[k]].covisibility * (1.0 - likeness[k]); };
    for (int n = 0; n < options_.num_diverse && num_best < good.size(); ++n) {
      size_t best = good.size();
      for (size_t k = num_best; k < good.size(); ++k) {
        if (!is_taken[k] && (best == good.size() || value(k) > value(best))) best = k;
      }
      if (best == good.size()) return;
      take(best);
    }
  }

  void ChooseForest() {
    DisjointSets<> parts(pairs_by_view_.size());
    for (const size_t i : by_covisibility_) {
      if (parts.Join(pairs_[i].view_idx1, pairs_[i].view_idx2)) is_chosen_[i] = true;
    }
  }

  void ChooseLoops() {
    HopGraph graph(pairs_by_view_.size());
    for (size_t i = 0; i < pairs_.size(); ++i) {
      if (is_chosen_[i]) graph.AddEdge(pairs_[i].view_idx1, pairs_[i].view_idx2);
    }
    for (const size_t i : by_covisibility_) {
      if (!IsGood(pairs_[i])) return;
      const auto [a, b] = IndicesOf(pairs_[i]);
      if (graph.IsWithin(a, b, options_.max_hops)) continue;
      graph.AddEdge(a, b);
      is_chosen_[i] = true;
    }
  }

  const std::vector<ViewPair>& pairs_;
  const PairSelectionOptions& options_;
  std::vector<bool> is_chosen_;
  std::vector<size_t> by_covisibility_;             // within ranks: good ones first
  std::vector<std::vector<size_t>> pairs_by_view_;  // good ones, the most covisible first
};

void CheckRange(double value, double min, double max, const std::string& name) {
  VGTW_CHECK(value >= min && value <= max,
             "PairSelectionOptions::" + name + " = " + std::to_string(value) + ", must be in [" +
                 std::to_string(min) + ", " + std::to_string(max) + "]");
}

}  // namespace

void PairSelectionOptions::Check() const {
  covisibility.Check();
  CheckRange(min_covisibility, 0.0, 1.0, "min_covisibility");
  CheckRange(min_angle_deg, 0.0, 180.0, "min_angle_deg");
  CheckRange(num_best, 0, 100000, "num_best");
  CheckRange(num_diverse, 0, 100000, "num_diverse");
  CheckRange(max_hops, 1, 100, "max_hops");
  CheckRange(max_candidates, 2, 1000000, "max_candidates");
}

std::vector<ViewPair> SelectPairs(const std::vector<ViewSketch>& sketches,
                                  const PairSelectionOptions& options) {
  options.Check();
  const std::vector<ViewPair> measured = PairMeasurer(sketches, options).Run();
  return PairChooser(sketches.size(), measured, options).Run();
}

}  // namespace vgtw
