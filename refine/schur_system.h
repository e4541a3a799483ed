// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/tiled_cholesky.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>

namespace vgtw {

// The linear least-squares problems that Levenberg and Marquardt's method solves for a
// ceres::Problem in which most parameters are points: with  r + J d  the linearised residuals
// (scaled for robust losses) and D the damping, it finds  d = argmin |r + J d|^2 + d^T D d  by
// eliminating the points, each of which couples only the blocks that observe it. Each block forms
// its own rows of the reduced system, so that results do not depend on the number of threads.
//
// Law of the problem: a residual block has at most one point, and then at most two residuals;
// points are free and Euclidean; no bounds. Other blocks may be anything that Ceres allows.
class SchurSystem {
 public:
  // Keeps references. Throws std::invalid_argument if the law is broken.
  SchurSystem(const ceres::Problem& problem, std::span<Eigen::Vector3d> points, int num_threads);

  // Half the sum of the losses at the present parameters; nullopt if one has no finite value.
  std::optional<double> Cost() const;

  // The same, and the derivatives for Solve.
  std::optional<double> Linearise();

  struct Step {
    Eigen::VectorXd blocks;               // tangents, in the order of the reduced system
    std::vector<Eigen::Vector3d> points;  // in the order that the system keeps them in
    double model_decrease = 0.0;          // of the cost, had the residuals been linear
    double squared_norm = 0.0;
    double max_gradient = 0.0;
  };

  // Damping: diagonal of J^T J, in units in which it starts at about 1, but at least 1e-6, over
  // `radius`. nullopt if the damped system is not positive definite or the step not finite.
  std::optional<Step> Solve(double radius);

  // Moves the parameters; Undo puts those of before the last Apply back, bit by bit.
  void Apply(const Step& step);
  void Undo();

  double SquaredNorm() const;  // of all free parameters

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  // A free parameter block other than a point.
  struct Block {
    double* values = nullptr;
    int ambient_size = 0;
    int size = 0;  // of the tangent
    const ceres::Manifold* manifold = nullptr;
    RowMajor plus_jacobian;        // [ambient_size, size], where there is a manifold
    std::vector<double> previous;  // values
  };
  struct Parameter {
    double* values = nullptr;
    int block = 0;  // or one of the two below
  };
  static constexpr size_t kNumPointProducts = 12;
  static constexpr int kHeld = -1;
  static constexpr int kPoint = -2;
  // The derivative of a residual block by one block: num_rows x size, row-major, in values_.
  struct Slot {
    int block = 0;
    size_t value = 0;
    size_t entry = 0;  // in entries_, if the term has a point
  };
  // A block that observes a point:  J_point^T J_block, 3 x size, row-major, in products_.
  struct Entry {
    int block = 0;
    int point = 0;
    size_t value = 0;
  };
  // A residual block. In values_: residuals, then, if it has a point, the 2 x 3 derivative by it.
  struct Term {
    const ceres::CostFunction* cost = nullptr;
    const ceres::LossFunction* loss = nullptr;
    int num_residuals = 0;
    int num_rows = 0;  // 2 where there is a point: a single residual is followed by a zero
    int point = -1;
    size_t parameter = 0;  // its first; those of the next term follow
    size_t slot = 0;
    size_t value = 0;
  };
  struct Use {
    size_t term = 0;
    size_t value = 0;  // of the slot
  };
  struct Scratch;

  // Its index, or kHeld.
  int AddBlock(const ceres::Problem& problem, double* values);
  void ReadTerms(const ceres::Problem& problem);
  void AddTerm(Term term, std::span<const Parameter> parameters);
  void AddEndOfTerms();
  void RankBlocks();
  void SortTerms();
  void AddEntries();
  void FindPairs();

  size_t NumTerms() const { return terms_.size() - 1; }
  std::span<const Slot> SlotsOf(size_t term) const;
  std::span<const Parameter> ParametersOf(size_t term) const;
  // Whether the rows of x, not those of y, hold the pair.
  bool Owns(int x, int y) const;

  double EvaluateCost(size_t term, Scratch& scratch) const;
  double EvaluateDerivatives(size_t term, Scratch& scratch);
  void FormPoint(size_t point, double radius);
  void FormRows(int x, double radius);
  template <int kRows, int kSize>
  void AddTermProducts(int x, const Use& use, double* panel, double* diagonal);
  template <int kSize>
  void EliminatePoint(int x, size_t entry, double* panel);
  void MovePoint(size_t point, Step& step) const;
  double ModelDecrease(size_t term, const Step& step, Eigen::VectorXd& change) const;

  const int num_threads_;
  const std::span<Eigen::Vector3d> points_;
  std::vector<Eigen::Vector3d> previous_points_;
  std::vector<Block> blocks_;
  // Points in the order in which all here is kept: indices into points_.
  std::vector<size_t> order_;
  std::vector<Term> terms_;          // by point, those without one last; then one that ends them
  std::vector<size_t> point_terms_;  // by point: its first term; those of the next follow
  std::vector<Slot> slots_;
  std::vector<Parameter> parameters_;
  std::vector<double> values_;
  std::vector<std::vector<Use>> uses_;  // by block
  std::vector<int> ranked_;             // blocks, those with very many uses last
  std::vector<int> ranks_;              // by block: its place there
  std::vector<Entry> entries_;          // by point, then by rank
  std::vector<size_t> point_entries_;   // by point: its first entry; those of the next follow
  std::vector<std::vector<size_t>> block_entries_;
  // By point: inverse of its damped Hessian [3, 3], its gradient [3], products of its entries.
  std::vector<double> products_;
  std::vector<size_t> point_products_;
  std::vector<std::vector<int>> neighbours_;  // by block: those of its pairs that it owns
  std::optional<TiledCholesky> reduced_;
  Eigen::VectorXd gradient_;          // by column of the reduced system: J^T r
  Eigen::VectorXd reduced_gradient_;  // after eliminating the points
  Eigen::VectorXd units_;             // by column
  std::vector<Eigen::Vector3d> point_units_;
  bool has_units_ = false;
};

}  // namespace vgtw
