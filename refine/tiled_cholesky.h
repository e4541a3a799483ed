// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Cholesky factor L L^T of a sparse symmetric positive definite matrix whose variables come in
// blocks. Neighbouring blocks are joined to dense tiles, of which only those exist that are not
// zero in L: the products are then dense ones, and a full matrix is nothing special.
// Results do not depend on the number of threads.
class TiledCholesky {
 public:
  // Columns per block, and the pairs of blocks (each once, in either order; a block with itself
  // need not be named) that are not zero. Blocks are eliminated as given or by AMD (Amestoy, Davis,
  // Duff, 1996), whichever makes less work.
  TiledCholesky(const std::vector<int>& block_sizes, const std::vector<std::pair<int, int>>& pairs);

  int size() const { return size_; }

  // First column of a block in vectors that are given to Solve.
  int offset(int block) const { return offsets_[static_cast<size_t>(block)]; }

  void SetZero();

  // Sets A(x, y), row-major, and A(y, x) with it. Different pairs can be set by different threads.
  void SetBlock(int x, int y, const double* values);

  // Replaces the matrix by its factor; false if it is not positive definite.
  bool Factorise(int num_threads);

  // A^-1 b with the factor.
  Eigen::VectorXd Solve(const Eigen::VectorXd& b) const;

 private:
  struct Place {
    int tile = 0;    // row and column of tiles
    int offset = 0;  // inside the tile
    int size = 0;
  };
  struct Layout {
    std::vector<Place> places;              // by block
    std::vector<int> tile_sizes;            // by column of tiles
    std::vector<std::vector<int>> columns;  // by column of tiles: rows below the diagonal
    double work = 0.0;
  };

  static Layout MakeLayout(const std::vector<int>& block_sizes,
                           const std::vector<std::pair<int, int>>& pairs,
                           const std::vector<int>& order);

  int num_tiles() const { return static_cast<int>(layout_.tile_sizes.size()); }
  const Eigen::MatrixXd* Find(int row, int column) const;
  Eigen::MatrixXd* Find(int row, int column);
  void Eliminate(int row, int column);

  int size_ = 0;
  std::vector<int> offsets_;
  Layout layout_;
  std::vector<int> tile_offsets_;       // by row of tiles, in the order of elimination
  std::vector<std::vector<int>> rows_;  // by row of tiles: columns left of the diagonal
  std::vector<int> tile_idxs_;          // [row, column] into tiles_, -1 = zero
  std::vector<Eigen::MatrixXd> tiles_;
};

}  // namespace vgtw
