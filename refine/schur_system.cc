// SPDX-License-Identifier: BSD-3-Clause
#include "refine/schur_system.h"

#include "scene/parallel.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include <Eigen/LU>

namespace vgtw {
namespace {

// What a pose has; products of this size are unrolled.
constexpr int kPoseSize = 6;
// Terms or points that a thread takes at once; sums are formed per chunk, whoever forms them.
constexpr size_t kChunkSize = 1024;

constexpr double kMinDiagonal = 1e-6;
constexpr double kMaxDiagonal = 1e32;

template <int kRows, int kColumns>
using ConstRows = Eigen::Map<const Eigen::Matrix<double, kRows, kColumns, Eigen::RowMajor>>;
template <int kRows, int kColumns>
using Rows = Eigen::Map<Eigen::Matrix<double, kRows, kColumns, Eigen::RowMajor>>;

// Sum of work(i, scratch) over [0, n); Scratch is what a chunk keeps from one i to the next.
template <typename Scratch, typename Work>
double SumInChunks(size_t n, int num_threads, const Work& work) {
  const size_t num_chunks = (n + kChunkSize - 1) / kChunkSize;
  std::vector<double> sums(num_chunks, 0.0);
  ParallelFor(static_cast<int64_t>(num_chunks), num_threads, [&](int64_t chunk) {
    const auto idx = static_cast<size_t>(chunk);
    Scratch scratch;
    for (size_t i = idx * kChunkSize; i < std::min(n, (idx + 1) * kChunkSize); ++i) {
      sums[idx] += work(i, scratch);
    }
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

std::optional<double> IfFinite(double value) {
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

// What Levenberg and Marquardt's method adds to a diagonal element of J^T J.
double Damping(double diagonal, double unit, double radius) {
  const double squared_unit = unit * unit;
  return std::clamp(diagonal * squared_unit, kMinDiagonal, kMaxDiagonal) / (radius * squared_unit);
}

double UnitOf(double diagonal) { return 1.0 / (1.0 + std::sqrt(diagonal)); }

}  // namespace

// Buffers of one chunk, so that terms allocate nothing.
struct SchurSystem::Scratch {
  std::vector<double> residuals;
  std::vector<const double*> parameters;
  std::vector<double*> jacobians;
  std::vector<RowMajor> ambient;  // jacobians by blocks that have a manifold
};

std::span<const SchurSystem::Slot> SchurSystem::SlotsOf(size_t term) const {
  return std::span(slots_).subspan(terms_[term].slot, terms_[term + 1].slot - terms_[term].slot);
}

bool SchurSystem::Owns(int x, int y) const {
  return ranks_[static_cast<size_t>(x)] <= ranks_[static_cast<size_t>(y)];
}

double SchurSystem::EvaluateCost(size_t idx, Scratch& scratch) const {
  const Term& term = terms_[idx];
  const size_t num_parameters = terms_[idx + 1].parameter - term.parameter;
  scratch.parameters.resize(num_parameters);
  scratch.residuals.resize(static_cast<size_t>(term.num_residuals));
  for (size_t i = 0; i < num_parameters; ++i) {
    scratch.parameters[i] = parameters_[term.parameter + i].values;
  }
  double* residuals = scratch.residuals.data();
  if (!term.cost->Evaluate(scratch.parameters.data(), residuals, nullptr)) return NAN;
  const double squared = Eigen::Map<Eigen::VectorXd>(residuals, term.num_residuals).squaredNorm();
  if (term.loss == nullptr) return 0.5 * squared;
  double rho[3];
  term.loss->Evaluate(squared, rho);
  return 0.5 * rho[0];
}

// Residuals and derivatives are scaled by sqrt(rho'), so that their products are those of the
// iteratively reweighted squares (what Ceres does where rho'' <= 0, as in all losses of this
// folder).
double SchurSystem::EvaluateDerivatives(size_t idx, Scratch& scratch) {
  const Term& term = terms_[idx];
  const size_t num_parameters = terms_[idx + 1].parameter - term.parameter;
  scratch.parameters.resize(num_parameters);
  scratch.jacobians.assign(num_parameters, nullptr);
  scratch.ambient.resize(std::max(scratch.ambient.size(), num_parameters));
  const Slot* slot = slots_.data() + term.slot;
  for (size_t i = 0; i < num_parameters; ++i) {
    const auto [values, block_idx] = parameters_[term.parameter + i];
    scratch.parameters[i] = values;
    if (block_idx == kHeld) continue;
    if (block_idx == kPoint) {
      scratch.jacobians[i] = &values_[term.value + 2];
      continue;
    }
    const Block& block = blocks_[static_cast<size_t>(block_idx)];
    if (block.manifold != nullptr) {
      scratch.ambient[i].resize(term.num_residuals, block.ambient_size);
      scratch.jacobians[i] = scratch.ambient[i].data();
    } else {
      scratch.jacobians[i] = &values_[slot->value];
    }
    ++slot;
  }
  double* residuals = &values_[term.value];
  if (!term.cost->Evaluate(scratch.parameters.data(), residuals, scratch.jacobians.data())) {
    return NAN;
  }
  slot = slots_.data() + term.slot;
  for (size_t i = 0; i < num_parameters; ++i) {
    const int block_idx = parameters_[term.parameter + i].block;
    if (block_idx < 0) continue;
    const Block& block = blocks_[static_cast<size_t>(block_idx)];
    if (block.manifold != nullptr) {
      Eigen::Map<RowMajor>(&values_[slot->value], term.num_residuals, block.size).noalias() =
          scratch.ambient[i].lazyProduct(block.plus_jacobian);
    }
    ++slot;
  }
  const double squared = Eigen::Map<Eigen::VectorXd>(residuals, term.num_residuals).squaredNorm();
  const size_t end = idx + 1 < NumTerms() ? terms_[idx + 1].value : values_.size();
  Eigen::Map<Eigen::VectorXd> all(residuals, static_cast<Eigen::Index>(end - term.value));
  double rho[3] = {squared, 1.0, 0.0};
  if (term.loss != nullptr) {
    term.loss->Evaluate(squared, rho);
    all *= std::sqrt(rho[1]);
  }
  return all.allFinite() ? 0.5 * rho[0] : NAN;
}

std::optional<double> SchurSystem::Cost() const {
  return IfFinite(
      SumInChunks<Scratch>(NumTerms(), num_threads_, [&](size_t term, Scratch& scratch) {
        return EvaluateCost(term, scratch);
      }));
}

std::optional<double> SchurSystem::Linearise() {
  for (Block& block : blocks_) {
    if (block.manifold != nullptr) {
      block.manifold->PlusJacobian(block.values, block.plus_jacobian.data());
    }
  }
  return IfFinite(
      SumInChunks<Scratch>(NumTerms(), num_threads_, [&](size_t term, Scratch& scratch) {
        return EvaluateDerivatives(term, scratch);
      }));
}

void SchurSystem::FormPoint(size_t point, double radius) {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (size_t entry = point_entries_[point]; entry < point_entries_[point + 1]; ++entry) {
    const int size = blocks_[static_cast<size_t>(entries_[entry].block)].size;
    std::fill_n(&products_[entries_[entry].value], 3 * size, 0.0);
  }
  for (size_t term = point_terms_[point]; term < point_terms_[point + 1]; ++term) {
    const double* values = &values_[terms_[term].value];
    const ConstRows<2, 3> by_point(values + 2);
    hessian += by_point.transpose() * by_point;
    gradient += by_point.transpose() * Eigen::Map<const Eigen::Vector2d>(values);
    for (const Slot& slot : SlotsOf(term)) {
      const int size = blocks_[static_cast<size_t>(slot.block)].size;
      double* product = &products_[entries_[slot.entry].value];
      if (size == kPoseSize) {
        Rows<3, kPoseSize>(product) +=
            by_point.transpose() * ConstRows<2, kPoseSize>(&values_[slot.value]);
      } else {
        Rows<3, Eigen::Dynamic>(product, 3, size) += by_point.transpose().lazyProduct(
            ConstRows<2, Eigen::Dynamic>(&values_[slot.value], 2, size));
      }
    }
  }
  for (int i = 0; i < 3; ++i) {
    double& unit = point_units_[point][i];
    if (!has_units_) unit = UnitOf(hessian(i, i));
    hessian(i, i) += Damping(hessian(i, i), unit, radius);
  }
  double* products = &products_[point_products_[point]];
  Eigen::Map<Eigen::Matrix3d>{products} = hessian.inverse();
  Eigen::Map<Eigen::Vector3d>{products + 9} = gradient;
}

// J_x^T (J_y, r) of one term.
template <int kRows, int kSize>
void SchurSystem::AddTermProducts(int x, const Use& use, double* panel, double* diagonal) {
  const int size = blocks_[static_cast<size_t>(x)].size;
  const Term& term = terms_[use.term];
  const ConstRows<kRows, kSize> by_x(&values_[use.value], term.num_rows, size);
  const Eigen::Map<const Eigen::Matrix<double, kRows, 1>> residuals(&values_[term.value],
                                                                    term.num_rows);
  gradient_.segment<kSize>(reduced_->offset(x), size) += by_x.transpose().lazyProduct(residuals);
  Eigen::Map<Eigen::Matrix<double, kSize, 1>>(diagonal, size) +=
      by_x.colwise().squaredNorm().transpose();
  for (const Slot& slot : SlotsOf(use.term)) {
    if (!Owns(x, slot.block)) continue;
    double* cell = panel + size * reduced_->offset(slot.block);
    const int other_size = blocks_[static_cast<size_t>(slot.block)].size;
    if (kRows == 2 && other_size == kPoseSize) {
      Rows<kSize, kPoseSize>(cell, size, kPoseSize) += by_x.transpose().lazyProduct(
          ConstRows<kRows, kPoseSize>(&values_[slot.value], 2, kPoseSize));
    } else {
      Rows<kSize, Eigen::Dynamic>(cell, size, other_size) += by_x.transpose().lazyProduct(
          ConstRows<kRows, Eigen::Dynamic>(&values_[slot.value], term.num_rows, other_size));
    }
  }
}

// Subtracts  W_x^T V^-1 (W_y, g)  for the pairs of one point that x owns: W the products of the
// entries, V and g the damped Hessian and the gradient of the point.
template <int kSize>
void SchurSystem::EliminatePoint(int x, size_t first, double* panel) {
  const int size = blocks_[static_cast<size_t>(x)].size;
  const auto point = static_cast<size_t>(entries_[first].point);
  const double* products = &products_[point_products_[point]];
  const Eigen::Matrix<double, kSize, 3> left =
      ConstRows<3, kSize>(&products_[entries_[first].value], 3, size)
          .transpose()
          .lazyProduct(Eigen::Map<const Eigen::Matrix3d>(products));
  reduced_gradient_.segment<kSize>(reduced_->offset(x), size) -=
      left.lazyProduct(Eigen::Map<const Eigen::Vector3d>(products + 9));
  for (size_t entry = first; entry < point_entries_[point + 1]; ++entry) {
    const auto [block, unused_point, value] = entries_[entry];
    double* cell = panel + size * reduced_->offset(block);
    const int other_size = blocks_[static_cast<size_t>(block)].size;
    if (other_size == kPoseSize) {
      Rows<kSize, kPoseSize>(cell, size, kPoseSize) -=
          left.lazyProduct(ConstRows<3, kPoseSize>(&products_[value]));
    } else {
      Rows<kSize, Eigen::Dynamic>(cell, size, other_size) -=
          left.lazyProduct(ConstRows<3, Eigen::Dynamic>(&products_[value], 3, other_size));
    }
  }
}

// The rows of one block in the reduced system. The panel has room for all columns, block after
// block, but only the pages of neighbours are ever touched.
void SchurSystem::FormRows(int x, double radius) {
  const auto idx = static_cast<size_t>(x);
  const int size = blocks_[idx].size;
  const int offset = reduced_->offset(x);
  const auto panel =
      std::make_unique_for_overwrite<double[]>(static_cast<size_t>(size * reduced_->size()));
  const auto cell = [&](int y) { return panel.get() + size * reduced_->offset(y); };
  for (const int y : neighbours_[idx]) {
    std::fill_n(cell(y), size * blocks_[static_cast<size_t>(y)].size, 0.0);
  }
  gradient_.segment(offset, size).setZero();
  reduced_gradient_.segment(offset, size).setZero();
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(size);
  for (const Use& use : uses_[idx]) {
    if (terms_[use.term].point < 0) {
      AddTermProducts<Eigen::Dynamic, Eigen::Dynamic>(x, use, panel.get(), diagonal.data());
    } else if (size == kPoseSize) {
      AddTermProducts<2, kPoseSize>(x, use, panel.get(), diagonal.data());
    } else {
      AddTermProducts<2, Eigen::Dynamic>(x, use, panel.get(), diagonal.data());
    }
  }
  for (const size_t entry : block_entries_[idx]) {
    if (size == kPoseSize) {
      EliminatePoint<kPoseSize>(x, entry, panel.get());
    } else {
      EliminatePoint<Eigen::Dynamic>(x, entry, panel.get());
    }
  }
  reduced_gradient_.segment(offset, size) += gradient_.segment(offset, size);
  for (int i = 0; i < size; ++i) {
    double& unit = units_[offset + i];
    if (!has_units_) unit = UnitOf(diagonal[i]);
    cell(x)[i * size + i] += Damping(diagonal[i], unit, radius);
  }
  for (const int y : neighbours_[idx]) reduced_->SetBlock(x, y, cell(y));
}

void SchurSystem::MovePoint(size_t point, Step& step) const {
  const double* products = &products_[point_products_[point]];
  Eigen::Vector3d gradient = Eigen::Map<const Eigen::Vector3d>(products + 9);
  for (size_t entry = point_entries_[point]; entry < point_entries_[point + 1]; ++entry) {
    const int block = entries_[entry].block;
    const int size = blocks_[static_cast<size_t>(block)].size;
    gradient += ConstRows<3, Eigen::Dynamic>(&products_[entries_[entry].value], 3, size)
                    .lazyProduct(step.blocks.segment(reduced_->offset(block), size));
  }
  step.points[point] = -Eigen::Map<const Eigen::Matrix3d>(products) * gradient;
}

double SchurSystem::ModelDecrease(size_t idx, const Step& step, Eigen::VectorXd& change) const {
  const Term& term = terms_[idx];
  change.setZero(term.num_rows);
  for (const Slot& slot : SlotsOf(idx)) {
    const int size = blocks_[static_cast<size_t>(slot.block)].size;
    change += Eigen::Map<const RowMajor>(&values_[slot.value], term.num_rows, size)
                  .lazyProduct(step.blocks.segment(reduced_->offset(slot.block), size));
  }
  if (term.point >= 0) {
    change +=
        ConstRows<2, 3>(&values_[term.value + 2]) * step.points[static_cast<size_t>(term.point)];
  }
  const Eigen::Map<const Eigen::VectorXd> residuals(&values_[term.value], term.num_rows);
  return -change.dot(residuals + 0.5 * change);
}

std::optional<SchurSystem::Step> SchurSystem::Solve(double radius) {
  SumInChunks<int>(points_.size(), num_threads_, [&](size_t point, int&) {
    FormPoint(point, radius);
    return 0.0;
  });
  reduced_->SetZero();
  // Those that take long first.
  ParallelFor(static_cast<int64_t>(ranked_.size()), num_threads_, [&](int64_t i) {
    FormRows(ranked_[ranked_.size() - 1 - static_cast<size_t>(i)], radius);
  });
  has_units_ = true;
  if (!reduced_->Factorise(num_threads_)) return std::nullopt;

  Step step;
  step.blocks = reduced_->Solve(-reduced_gradient_);
  step.points.resize(points_.size());
  step.squared_norm = step.blocks.squaredNorm();
  step.squared_norm += SumInChunks<int>(points_.size(), num_threads_, [&](size_t point, int&) {
    MovePoint(point, step);
    return step.points[point].squaredNorm();
  });
  step.model_decrease = SumInChunks<Eigen::VectorXd>(
      NumTerms(), num_threads_, [&](size_t term, Eigen::VectorXd& change) {
        return ModelDecrease(term, step, change);
      });
  if (!std::isfinite(step.squared_norm) || !std::isfinite(step.model_decrease)) return std::nullopt;
  if (gradient_.size() > 0) step.max_gradient = gradient_.cwiseAbs().maxCoeff();
  for (const size_t products : point_products_) {
    const Eigen::Map<const Eigen::Vector3d> gradient(&products_[products + 9]);
    step.max_gradient = std::max(step.max_gradient, gradient.cwiseAbs().maxCoeff());
  }
  return step;
}

void SchurSystem::Apply(const Step& step) {
  for (size_t i = 0; i < blocks_.size(); ++i) {
    Block& block = blocks_[i];
    block.previous.assign(block.values, block.values + block.ambient_size);
    const double* change = step.blocks.data() + reduced_->offset(static_cast<int>(i));
    if (block.manifold != nullptr) {
      block.manifold->Plus(block.previous.data(), change, block.values);
    } else {
      for (int k = 0; k < block.size; ++k) block.values[k] += change[k];
    }
  }
  previous_points_.assign(points_.begin(), points_.end());
  for (size_t i = 0; i < points_.size(); ++i) points_[order_[i]] += step.points[i];
}

void SchurSystem::Undo() {
  for (const Block& block : blocks_) {
    std::copy(block.previous.begin(), block.previous.end(), block.values);
  }
  std::copy(previous_points_.begin(), previous_points_.end(), points_.begin());
}

double SchurSystem::SquaredNorm() const {
  double squared = 0.0;
  for (const Block& block : blocks_) {
    squared += Eigen::Map<const Eigen::VectorXd>(block.values, block.ambient_size).squaredNorm();
  }
  for (const Eigen::Vector3d& point : points_) squared += point.squaredNorm();
  return squared;
}

}  // namespace vgtw
