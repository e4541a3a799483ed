// SPDX-License-Identifier: BSD-3-Clause
// What of refine/schur_system.h is done once per problem.
#include "refine/point_blocks.h"
#include "refine/schur_system.h"
#include "scene/error.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <unordered_map>
#include <utility>

namespace vgtw {
namespace {

// Times the mean number of uses of a block.
constexpr size_t kManyUses = 4;

}  // namespace

SchurSystem::SchurSystem(const ceres::Problem& problem,
                         std::span<Eigen::Vector3d> points,
                         int num_threads)
    : num_threads_(num_threads), points_(points) {
  ReadTerms(problem);
  RankBlocks();
  SortTerms();
  AddEntries();
  FindPairs();
  gradient_.setZero(reduced_->size());
  reduced_gradient_.setZero(reduced_->size());
  units_.setZero(reduced_->size());
  point_units_.resize(points_.size());
}

int SchurSystem::AddBlock(const ceres::Problem& problem, double* values) {
  const int size = problem.ParameterBlockTangentSize(values);
  if (problem.IsParameterBlockConstant(values) || size == 0) return kHeld;
  Block& block = blocks_.emplace_back();
  block.values = values;
  block.ambient_size = problem.ParameterBlockSize(values);
  block.size = size;
  block.manifold = problem.GetManifold(values);
  block.plus_jacobian.resize(block.ambient_size, block.size);
  return static_cast<int>(blocks_.size()) - 1;
}

void SchurSystem::ReadTerms(const ceres::Problem& problem) {
  // Blocks come in the order in which residuals name them: Ceres lists them by address, which
  // differs from run to run.
  std::unordered_map<const double*, int> block_by_values;
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  std::vector<double*> blocks;
  for (const ceres::ResidualBlockId id : ids) {
    Term& term = terms_.emplace_back();
    term.cost = problem.GetCostFunctionForResidualBlock(id);
    term.loss = problem.GetLossFunctionForResidualBlock(id);
    term.num_residuals = term.num_rows = term.cost->num_residuals();
    term.parameter = parameters_.size();
    problem.GetParameterBlocksForResidualBlock(id, &blocks);
    for (double* values : blocks) {
      Parameter& parameter = parameters_.emplace_back(Parameter{values, kHeld});
      if (const std::ptrdiff_t point = PointIdx(points_, values); point >= 0) {
        VGTW_CHECK(term.point < 0, "a residual of two points");
        parameter.block = kPoint;
        term.point = static_cast<int>(point);
        term.num_rows = 2;
      } else {
        const auto [block, is_new] = block_by_values.try_emplace(values, kHeld);
        if (is_new) block->second = AddBlock(problem, values);
        parameter.block = block->second;
      }
    }
    VGTW_CHECK(term.num_residuals <= term.num_rows,
               "a point in " + std::to_string(term.num_residuals) + " residuals, must be <= 2");
  }
  AddEndOfTerms();
}

void SchurSystem::AddEndOfTerms() {
  Term& end = terms_.emplace_back();
  end.parameter = parameters_.size();
  end.slot = slots_.size();
  end.value = values_.size();
}

std::span<const SchurSystem::Parameter> SchurSystem::ParametersOf(size_t term) const {
  return std::span(parameters_)
      .subspan(terms_[term].parameter, terms_[term + 1].parameter - terms_[term].parameter);
}

// What most points observe (a shared camera) comes last, since the pairs of a block are formed by
// the first of the two; the rest stays as it is, neighbours beside each other.
void SchurSystem::RankBlocks() {
  std::vector<size_t> num_uses(blocks_.size(), 0);
  for (const Parameter& parameter : parameters_) {
    if (parameter.block >= 0) ++num_uses[static_cast<size_t>(parameter.block)];
  }
  ranked_.resize(blocks_.size());
  std::iota(ranked_.begin(), ranked_.end(), 0);
  std::stable_partition(ranked_.begin(), ranked_.end(), [&](int block) {
    return num_uses[static_cast<size_t>(block)] * blocks_.size() < kManyUses * parameters_.size();
  });
  ranks_.resize(blocks_.size());
  for (size_t i = 0; i < ranked_.size(); ++i) {
    ranks_[static_cast<size_t>(ranked_[i])] = static_cast<int>(i);
  }
}

// Terms of one point become neighbours in memory, and points near those that the same block
// observes: what a block's rows need is then not scattered.
void SchurSystem::SortTerms() {
  constexpr int kNone = std::numeric_limits<int>::max();
  std::vector<int> first_rank_by_point(points_.size(), kNone);
  for (size_t term = 0; term < NumTerms(); ++term) {
    if (terms_[term].point < 0) continue;
    int& first = first_rank_by_point[static_cast<size_t>(terms_[term].point)];
    for (const Parameter& parameter : ParametersOf(term)) {
      if (parameter.block < 0) continue;
      first = std::min(first, ranks_[static_cast<size_t>(parameter.block)]);
    }
  }
  order_.resize(points_.size());
  std::iota(order_.begin(), order_.end(), size_t{0});
  std::stable_sort(order_.begin(), order_.end(), [&](size_t a, size_t b) {
    return first_rank_by_point[a] < first_rank_by_point[b];
  });
  std::vector<int> place_by_point(points_.size());
  for (size_t i = 0; i < order_.size(); ++i) place_by_point[order_[i]] = static_cast<int>(i);
  for (Term& term : terms_) {
    if (term.point >= 0) term.point = place_by_point[static_cast<size_t>(term.point)];
  }

  std::vector<size_t> by_place(NumTerms());
  std::iota(by_place.begin(), by_place.end(), size_t{0});
  std::stable_sort(by_place.begin(), by_place.end(), [&](size_t a, size_t b) {
    return static_cast<unsigned>(terms_[a].point) < static_cast<unsigned>(terms_[b].point);
  });
  const std::vector<Term> terms = std::exchange(terms_, {});
  const std::vector<Parameter> parameters = std::exchange(parameters_, {});
  uses_.resize(blocks_.size());
  terms_.reserve(terms.size());
  parameters_.reserve(parameters.size());
  for (const size_t term : by_place) {
    AddTerm(terms[term],
            std::span(parameters)
                .subspan(terms[term].parameter, terms[term + 1].parameter - terms[term].parameter));
  }
  point_terms_.assign(points_.size() + 1, 0);
  for (const Term& term : terms_) {
    if (term.point >= 0) ++point_terms_[static_cast<size_t>(term.point) + 1];
  }
  std::partial_sum(point_terms_.begin(), point_terms_.end(), point_terms_.begin());
  AddEndOfTerms();
}

void SchurSystem::AddTerm(Term term, std::span<const Parameter> parameters) {
  term.parameter = parameters_.size();
  term.slot = slots_.size();
  term.value = values_.size();
  const auto num_rows = static_cast<size_t>(term.num_rows);
  size_t end = term.value + num_rows + (term.point >= 0 ? 6 : 0);
  for (const Parameter& parameter : parameters) {
    parameters_.push_back(parameter);
    if (parameter.block < 0) continue;
    const auto block = static_cast<size_t>(parameter.block);
    slots_.push_back({parameter.block, end, 0});
    uses_[block].push_back({terms_.size(), end});
    end += num_rows * static_cast<size_t>(blocks_[block].size);
  }
  values_.resize(end);
  terms_.push_back(term);
}

void SchurSystem::AddEntries() {
  block_entries_.resize(blocks_.size());
  std::vector<size_t> entry_by_block(blocks_.size());
  std::vector<int> blocks;
  size_t num_products = 0;
  for (size_t point = 0; point < points_.size(); ++point) {
    point_entries_.push_back(entries_.size());
    const size_t first_slot = terms_[point_terms_[point]].slot;
    const std::span<Slot> slots =
        std::span(slots_).subspan(first_slot, terms_[point_terms_[point + 1]].slot - first_slot);
    blocks.clear();
    for (const Slot& slot : slots) blocks.push_back(slot.block);
    std::sort(blocks.begin(), blocks.end(), [&](int x, int y) {
      return ranks_[static_cast<size_t>(x)] < ranks_[static_cast<size_t>(y)];
    });
    blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
    point_products_.push_back(num_products);
    num_products += kNumPointProducts;
    for (const int block : blocks) {
      const auto idx = static_cast<size_t>(block);
      entry_by_block[idx] = entries_.size();
      block_entries_[idx].push_back(entries_.size());
      entries_.push_back({block, static_cast<int>(point), num_products});
      num_products += 3 * static_cast<size_t>(blocks_[idx].size);
    }
    for (Slot& slot : slots) slot.entry = entry_by_block[static_cast<size_t>(slot.block)];
  }
  point_entries_.push_back(entries_.size());
  products_.resize(num_products);
}

// Blocks are coupled where they share a point, or a term without one.
void SchurSystem::FindPairs() {
  const size_t n = blocks_.size();
  neighbours_.resize(n);
  std::vector<int> sizes;
  std::vector<std::pair<int, int>> pairs;
  std::vector<size_t> seen_by(n, n);
  for (size_t x = 0; x < n; ++x) {
    sizes.push_back(blocks_[x].size);
    const auto add = [&](int block) {
      const auto y = static_cast<size_t>(block);
      if (seen_by[y] == x || !Owns(static_cast<int>(x), block)) return;
      seen_by[y] = x;
      neighbours_[x].push_back(block);
      pairs.emplace_back(static_cast<int>(x), block);
    };
    add(static_cast<int>(x));
    for (const size_t first : block_entries_[x]) {
      const size_t end = point_entries_[static_cast<size_t>(entries_[first].point) + 1];
      for (size_t entry = first; entry < end; ++entry) add(entries_[entry].block);
    }
    for (const Use& use : uses_[x]) {
      if (terms_[use.term].point >= 0) continue;
      for (const Slot& slot : SlotsOf(use.term)) add(slot.block);
    }
  }
  reduced_.emplace(sizes, pairs);
}

}  // namespace vgtw
