// SPDX-License-Identifier: BSD-3-Clause
#include "refine/tiled_cholesky.h"

#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

namespace vgtw {
namespace {

// Eight poses: large enough for dense products to be quick, small enough to keep the pattern.
constexpr int kMaxTileSize = 48;

std::vector<int> NaturalOrder(size_t num_blocks) {
  std::vector<int> order(num_blocks);
  std::iota(order.begin(), order.end(), 0);
  return order;
}

std::vector<int> AmdOrder(size_t num_blocks, const std::vector<std::pair<int, int>>& pairs) {
  std::vector<Eigen::Triplet<char>> entries;
  for (const auto& [x, y] : pairs) entries.emplace_back(std::max(x, y), std::min(x, y), 1);
  for (size_t i = 0; i < num_blocks; ++i) {
    entries.emplace_back(static_cast<int>(i), static_cast<int>(i), 1);
  }
  const auto n = static_cast<Eigen::Index>(num_blocks);
  Eigen::SparseMatrix<char> pattern(n, n);
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(pattern.selfadjointView<Eigen::Lower>(), permutation);
  const auto& indices = permutation.indices();
  return {indices.data(), indices.data() + indices.size()};
}

}  // namespace

TiledCholesky::TiledCholesky(const std::vector<int>& block_sizes,
                             const std::vector<std::pair<int, int>>& pairs) {
  for (const int block_size : block_sizes) {
    offsets_.push_back(size_);
    size_ += block_size;
  }
  layout_ = MakeLayout(block_sizes, pairs, NaturalOrder(block_sizes.size()));
  Layout by_amd = MakeLayout(block_sizes, pairs, AmdOrder(block_sizes.size(), pairs));
  if (by_amd.work < layout_.work) layout_ = std::move(by_amd);

  const auto n = layout_.tile_sizes.size();
  rows_.resize(n);
  tile_idxs_.assign(n * n, -1);
  const auto add_tile = [&](size_t row, size_t column) {
    tile_idxs_[row * n + column] = static_cast<int>(tiles_.size());
    tiles_.emplace_back(layout_.tile_sizes[row], layout_.tile_sizes[column]);
  };
  int tile_offset = 0;
  for (size_t column = 0; column < n; ++column) {
    tile_offsets_.push_back(tile_offset);
    tile_offset += layout_.tile_sizes[column];
    add_tile(column, column);
    for (const int row : layout_.columns[column]) {
      add_tile(static_cast<size_t>(row), column);
      rows_[static_cast<size_t>(row)].push_back(static_cast<int>(column));
    }
  }
}

TiledCholesky::Layout TiledCholesky::MakeLayout(const std::vector<int>& block_sizes,
                                                const std::vector<std::pair<int, int>>& pairs,
                                                const std::vector<int>& order) {
  Layout layout;
  layout.places.resize(block_sizes.size());
  for (const int block : order) {
    const int block_size = block_sizes[static_cast<size_t>(block)];
    if (layout.tile_sizes.empty() || layout.tile_sizes.back() + block_size > kMaxTileSize) {
      layout.tile_sizes.push_back(0);
    }
    int& tile_size = layout.tile_sizes.back();
    layout.places[static_cast<size_t>(block)] = {
        static_cast<int>(layout.tile_sizes.size()) - 1, tile_size, block_size};
    tile_size += block_size;
  }
  const size_t n = layout.tile_sizes.size();
  std::vector<bool> is_filled(n * n, false);
  for (const auto& [x, y] : pairs) {
    const auto a = static_cast<size_t>(layout.places[static_cast<size_t>(x)].tile);
    const auto b = static_cast<size_t>(layout.places[static_cast<size_t>(y)].tile);
    is_filled[std::max(a, b) * n + std::min(a, b)] = true;
  }
  layout.columns.resize(n);
  for (size_t column = 0; column < n; ++column) {
    std::vector<int>& rows = layout.columns[column];
    for (size_t row = column + 1; row < n; ++row) {
      if (is_filled[row * n + column]) rows.push_back(static_cast<int>(row));
    }
    // Eliminating a column couples all that it touches.
    for (size_t i = 0; i < rows.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        is_filled[static_cast<size_t>(rows[i]) * n + static_cast<size_t>(rows[j])] = true;
      }
    }
    const auto num_rows = static_cast<double>(rows.size() + 1);
    layout.work += num_rows * num_rows;
  }
  return layout;
}

const Eigen::MatrixXd* TiledCholesky::Find(int row, int column) const {
  const int idx = tile_idxs_[static_cast<size_t>(row) * layout_.tile_sizes.size() +
                             static_cast<size_t>(column)];
  return idx < 0 ? nullptr : &tiles_[static_cast<size_t>(idx)];
}

Eigen::MatrixXd* TiledCholesky::Find(int row, int column) {
  return const_cast<Eigen::MatrixXd*>(std::as_const(*this).Find(row, column));
}

void TiledCholesky::SetZero() {
  for (Eigen::MatrixXd& tile : tiles_) tile.setZero();
}

void TiledCholesky::SetBlock(int x, int y, const double* values) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Place& row = layout_.places[static_cast<size_t>(x)];
  const Place& column = layout_.places[static_cast<size_t>(y)];
  const Eigen::Map<const RowMajor> block(values, row.size, column.size);
  const bool is_lower =
      row.tile > column.tile || (row.tile == column.tile && row.offset >= column.offset);
  Eigen::MatrixXd* tile = is_lower ? Find(row.tile, column.tile) : Find(column.tile, row.tile);
  VGTW_CHECK(tile != nullptr, "TiledCholesky::SetBlock: a pair that was not named");
  if (is_lower) {
    tile->block(row.offset, column.offset, row.size, column.size) = block;
  } else {
    tile->block(column.offset, row.offset, column.size, row.size) = block.transpose();
  }
}

// Subtracts from a tile what the columns left of it give.
void TiledCholesky::Eliminate(int row, int column) {
  Eigen::MatrixXd& tile = *Find(row, column);
  for (const int k : rows_[static_cast<size_t>(column)]) {
    const Eigen::MatrixXd* left = Find(row, k);
    if (left != nullptr) tile.noalias() -= *left * Find(column, k)->transpose();
  }
}

bool TiledCholesky::Factorise(int num_threads) {
  for (int column = 0; column < num_tiles(); ++column) {
    Eliminate(column, column);
    Eigen::MatrixXd& diagonal = *Find(column, column);
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> in_place(diagonal);
    if (in_place.info() != Eigen::Success || !diagonal.diagonal().allFinite()) return false;
    const std::vector<int>& rows = layout_.columns[static_cast<size_t>(column)];
    ParallelFor(static_cast<int64_t>(rows.size()), num_threads, [&](int64_t i) {
      const int row = rows[static_cast<size_t>(i)];
      Eliminate(row, column);
      diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(
          *Find(row, column));
    });
  }
  return true;
}

Eigen::VectorXd TiledCholesky::Solve(const Eigen::VectorXd& b) const {
  Eigen::VectorXd ordered(size_);
  const auto part = [&](int tile) {
    const auto idx = static_cast<size_t>(tile);
    return ordered.segment(tile_offsets_[idx], layout_.tile_sizes[idx]);
  };
  for (size_t block = 0; block < offsets_.size(); ++block) {
    const Place& place = layout_.places[block];
    part(place.tile).segment(place.offset, place.size) = b.segment(offsets_[block], place.size);
  }
  for (int column = 0; column < num_tiles(); ++column) {
    Find(column, column)->triangularView<Eigen::Lower>().solveInPlace(part(column));
    for (const int row : layout_.columns[static_cast<size_t>(column)]) {
      part(row) -= *Find(row, column) * part(column);
    }
  }
  for (int column = num_tiles() - 1; column >= 0; --column) {
    for (const int row : layout_.columns[static_cast<size_t>(column)]) {
      part(column) -= Find(row, column)->transpose() * part(row);
    }
    Find(column, column)->triangularView<Eigen::Lower>().transpose().solveInPlace(part(column));
  }
  Eigen::VectorXd x(size_);
  for (size_t block = 0; block < offsets_.size(); ++block) {
    const Place& place = layout_.places[block];
    x.segment(offsets_[block], place.size) = part(place.tile).segment(place.offset, place.size);
  }
  return x;
}

}  // namespace vgtw
