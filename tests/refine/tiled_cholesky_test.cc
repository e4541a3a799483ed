// SPDX-License-Identifier: BSD-3-Clause
#include "refine/tiled_cholesky.h"

#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Blocks of mixed sizes, a random matrix of the pattern, made positive definite by its diagonal.
struct TestSystem {
  std::vector<int> sizes;
  std::vector<std::pair<int, int>> pairs;
  std::vector<int> offsets;
  Eigen::MatrixXd matrix;
  Eigen::VectorXd b;

  TestSystem(int num_blocks, double density, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    int size = 0;
    for (int i = 0; i < num_blocks; ++i) {
      sizes.push_back(i % 7 == 3 ? 2 : 6);
      offsets.push_back(size);
      size += sizes.back();
    }
    matrix.setZero(size, size);
    b = Eigen::VectorXd::NullaryExpr(size, [&] { return uniform(random); });
    for (int x = 0; x < num_blocks; ++x) {
      for (int y = 0; y <= x; ++y) {
        if (x != y && !(std::abs(uniform(random)) < density)) continue;
        // Either order is allowed.
        pairs.push_back(random() % 2 == 0 ? std::pair(x, y) : std::pair(y, x));
        for (int i = 0; i < sizes[static_cast<size_t>(x)]; ++i) {
          for (int j = 0; j < sizes[static_cast<size_t>(y)]; ++j) {
            const int row = offsets[static_cast<size_t>(x)] + i;
            const int column = offsets[static_cast<size_t>(y)] + j;
            matrix(row, column) = matrix(column, row) = uniform(random);
          }
        }
      }
    }
    matrix.diagonal().array() += static_cast<double>(size);
  }

  void CopyTo(TiledCholesky& cholesky) const {
    cholesky.SetZero();
    for (const auto& [x, y] : pairs) {
      const RowMajor block = matrix.block(offsets[static_cast<size_t>(x)],
                                          offsets[static_cast<size_t>(y)],
                                          sizes[static_cast<size_t>(x)],
                                          sizes[static_cast<size_t>(y)]);
      cholesky.SetBlock(x, y, block.data());
    }
  }
};

TEST(TiledCholesky, SolvesWhatADenseFactorSolves) {
  // One tile; many tiles, full, sparse, and with no coupling at all.
  for (const auto& [num_blocks, density] : std::vector<std::pair<int, double>>{
           {1, 1.0}, {5, 0.5}, {60, 1.0}, {60, 0.03}, {60, 0.2}, {60, 0.0}}) {
    const TestSystem system(num_blocks, density, 1);
    TiledCholesky cholesky(system.sizes, system.pairs);
    ASSERT_EQ(cholesky.size(), system.b.size());
    for (const int num_threads : {1, 3}) {
      system.CopyTo(cholesky);
      ASSERT_TRUE(cholesky.Factorise(num_threads));
      // Well conditioned: some hundred roundings.
      EXPECT_LT((cholesky.Solve(system.b) - system.matrix.llt().solve(system.b)).norm(), 1e-14)
          << num_blocks << " " << density;
    }
  }
}

TEST(TiledCholesky, DoesNotDependOnThreads) {
  const TestSystem system(80, 0.1, 2);
  TiledCholesky cholesky(system.sizes, system.pairs);
  system.CopyTo(cholesky);
  ASSERT_TRUE(cholesky.Factorise(1));
  const Eigen::VectorXd expected = cholesky.Solve(system.b);
  system.CopyTo(cholesky);
  ASSERT_TRUE(cholesky.Factorise(4));
  EXPECT_EQ(cholesky.Solve(system.b), expected);
}

TEST(TiledCholesky, HasNothingToSolveWithoutBlocks) {
  TiledCholesky cholesky({}, {});
  EXPECT_TRUE(cholesky.Factorise(1));
  EXPECT_EQ(cholesky.Solve(Eigen::VectorXd()).size(), 0);
}

TEST(TiledCholesky, RefusesWhatIsNotPositiveDefinite) {
  TestSystem system(30, 0.3, 3);
  system.matrix(100, 100) = -1.0;
  TiledCholesky cholesky(system.sizes, system.pairs);
  system.CopyTo(cholesky);
  EXPECT_FALSE(cholesky.Factorise(1));
  system.matrix(100, 100) = std::numeric_limits<double>::quiet_NaN();
  system.CopyTo(cholesky);
  EXPECT_FALSE(cholesky.Factorise(1));
}

TEST(TiledCholesky, RefusesPairsThatWereNotNamed) {
  TiledCholesky cholesky(std::vector<int>(20, 6), {});
  const std::vector<double> values(36, 1.0);
  EXPECT_THROW(cholesky.SetBlock(0, 19, values.data()), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
