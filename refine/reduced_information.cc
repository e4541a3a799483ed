// SPDX-License-Identifier: BSD-3-Clause
#include "refine/reduced_information.h"

#include "refine/point_blocks.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <unordered_map>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace vgtw {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Of variance, against that of a block whose neighbours are known.
constexpr double kMaxInflation = 1e10;

// The residual blocks of each point, those without one last.
std::vector<std::vector<ceres::ResidualBlockId>> GroupByPoint(
    const ceres::Problem& problem, std::span<const Eigen::Vector3d> points) {
  std::vector<std::vector<ceres::ResidualBlockId>> groups(points.size() + 1);
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  std::vector<double*> parameters;
  for (const ceres::ResidualBlockId id : ids) {
    problem.GetParameterBlocksForResidualBlock(id, &parameters);
    size_t group = points.size();
    for (const double* values : parameters) {
      const std::ptrdiff_t point = PointIdx(points, values);
      if (point >= 0) group = static_cast<size_t>(point);
    }
    groups[group].push_back(id);
  }
  return groups;
}

// Inverse on the directions that have information.
Eigen::Matrix3d PseudoInverse(const Eigen::Matrix3d& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information);
  // Below this share rounding of the products makes up the eigenvalue.
  const double least = 1e-14 * solver.eigenvalues()[2];
  Eigen::Vector3d inverse;
  for (int i = 0; i < 3; ++i) {
    const double value = solver.eigenvalues()[i];
    inverse[i] = value > least ? 1.0 / value : 0.0;
  }
  return solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose();
}

// Evaluates residual blocks one after the other.
class Evaluator {
 public:
  struct Factor {
    const ReducedBlock* block = nullptr;  // none for a point
    RowMajor jacobian;                    // times the root of the weight
  };

  Evaluator(const ceres::Problem& problem,
            std::span<const Eigen::Vector3d> points,
            const std::vector<ReducedBlock>& blocks,
            const ResidualWeight& weight)
      : problem_(problem), points_(points), weight_(weight) {
    for (const ReducedBlock& block : blocks) blocks_[block.values] = &block;
  }

  // Derivatives by the free blocks and points; empty where there is no value.
  const std::vector<Factor>& Evaluate(ceres::ResidualBlockId id) {
    problem_.GetParameterBlocksForResidualBlock(id, &parameters_);
    const int num_rows = problem_.GetCostFunctionForResidualBlock(id)->num_residuals();
    factors_.clear();
    factors_.reserve(parameters_.size());  // the pointers below stay
    jacobians_.assign(parameters_.size(), nullptr);
    for (size_t i = 0; i < parameters_.size(); ++i) {
      const auto block = blocks_.find(parameters_[i]);
      const bool is_point = PointIdx(points_, parameters_[i]) >= 0;
      if (block == blocks_.end() && !is_point) continue;
      const int size = is_point ? 3 : block->second->size;
      factors_.push_back({is_point ? nullptr : block->second, RowMajor(num_rows, size)});
      jacobians_[i] = factors_.back().jacobian.data();
    }
    double half_squared_norm = 0.0;
    if (!problem_.EvaluateResidualBlock(
            id, false, &half_squared_norm, nullptr, jacobians_.data())) {
      factors_.clear();
      return factors_;
    }
    const double root = std::sqrt(weight_(id, 2.0 * half_squared_norm));
    for (Factor& factor : factors_) factor.jacobian *= root;
    return factors_;
  }

 private:
  const ceres::Problem& problem_;
  const std::span<const Eigen::Vector3d> points_;
  const ResidualWeight& weight_;
  std::unordered_map<const double*, const ReducedBlock*> blocks_;
  std::vector<double*> parameters_;
  std::vector<double*> jacobians_;
  std::vector<Factor> factors_;
};

class Reducer {
 public:
  Reducer(Evaluator evaluator, int size)
      : evaluator_(std::move(evaluator)), matrix_(Eigen::MatrixXd::Zero(size, size)) {}

  void Add(const std::vector<ceres::ResidualBlockId>& of_one_point) {
    point_information_.setZero();
    couplings_.clear();
    for (const ceres::ResidualBlockId id : of_one_point) AddResidualBlock(id);
    if (couplings_.empty()) return;
    const Eigen::Matrix3d covariance = PseudoInverse(point_information_);
    for (const auto& [offset, coupling] : couplings_) {
      const Coupling product = coupling * covariance;
      for (const auto& [other_offset, other] : couplings_) {
        if (other_offset > offset) break;
        Subtract(product, other, offset, other_offset);
      }
    }
  }

  const Eigen::MatrixXd& matrix() const { return matrix_; }

 private:
  // J^T J by a block and the point; of at most as many rows as a camera model has parameters.
  using Coupling = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, 12, 3>;
  void Subtract(const Coupling& product, const Coupling& other, int row, int column) {
    if (product.rows() == 6 && other.rows() == 6) {  // of poses: the most, and faster by far
      matrix_.block<6, 6>(row, column).noalias() -=
          product.topRows<6>() * other.topRows<6>().transpose();
    } else {
      matrix_.block(row, column, product.rows(), other.rows()).noalias() -=
          product * other.transpose();
    }
  }

  void AddResidualBlock(ceres::ResidualBlockId id) {
    const std::vector<Evaluator::Factor>& factors = evaluator_.Evaluate(id);
    const RowMajor* point = nullptr;
    for (const Evaluator::Factor& factor : factors) {
      if (!factor.block) point = &factor.jacobian;
    }
    if (point) point_information_ += point->transpose() * *point;
    for (const Evaluator::Factor& factor : factors) {
      if (!factor.block) continue;
      const ReducedBlock& block = *factor.block;
      for (const Evaluator::Factor& other : factors) {
        if (!other.block || other.block->offset > block.offset) continue;
        matrix_.block(block.offset, other.block->offset, block.size, other.block->size) +=
            factor.jacobian.transpose() * other.jacobian;
      }
      if (!point) continue;
      const auto [coupling, is_new] = couplings_.try_emplace(block.offset);
      if (is_new) coupling->second.setZero(block.size, 3);
      coupling->second += factor.jacobian.transpose() * *point;
    }
  }

  Evaluator evaluator_;
  Eigen::MatrixXd matrix_;
  Eigen::Matrix3d point_information_;
  std::map<int, Coupling> couplings_;  // by offset of the block
};

}  // namespace

std::vector<ReducedBlock> FindReducedBlocks(const ceres::Problem& problem,
                                            std::span<const Eigen::Vector3d> points) {
  std::vector<double*> parameters;
  problem.GetParameterBlocks(&parameters);
  std::vector<ReducedBlock> blocks;
  int offset = 0;
  for (const double* values : parameters) {
    const int size = problem.ParameterBlockTangentSize(values);
    if (PointIdx(points, values) >= 0 || problem.IsParameterBlockConstant(values) || size == 0) {
      continue;
    }
    blocks.push_back({values, offset, size});
    offset += size;
  }
  return blocks;
}

Eigen::MatrixXd ReduceInformation(const ceres::Problem& problem,
                                  std::span<const Eigen::Vector3d> points,
                                  const std::vector<ReducedBlock>& blocks,
                                  const ResidualWeight& weight) {
  const int size = blocks.empty() ? 0 : blocks.back().offset + blocks.back().size;
  Reducer reducer(Evaluator(problem, points, blocks, weight), size);
  for (const auto& group : GroupByPoint(problem, points)) reducer.Add(group);
  return reducer.matrix();
}

InverseInformation::InverseInformation(const Eigen::MatrixXd& information)
    : units_(information.diagonal().cwiseMax(0.0).cwiseSqrt().cwiseInverse()) {
  // In units in which the diagonal is one, variances are their inflation by the other unknowns.
  for (double& unit : units_) {
    if (!std::isfinite(unit)) unit = 1.0;
  }
  Eigen::MatrixXd scaled = units_.asDiagonal() * information * units_.asDiagonal();
  // Beyond rounding, so that undetermined directions come out as large instead of failing.
  scaled.diagonal().array() += 0.01 / kMaxInflation;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(scaled);
  if (cholesky.info() != Eigen::Success) return;
  inverse_factor_ = Eigen::MatrixXd::Identity(scaled.rows(), scaled.cols());
  cholesky.matrixL().solveInPlace(inverse_factor_);
}

Eigen::MatrixXd InverseInformation::Covariance(const ReducedBlock& block) const {
  const Eigen::MatrixXd unknown =
      Eigen::MatrixXd::Constant(block.size, block.size, std::numeric_limits<double>::quiet_NaN());
  if (inverse_factor_.size() == 0) return unknown;
  const auto columns = inverse_factor_.middleCols(block.offset, block.size);
  const Eigen::MatrixXd inflation = columns.transpose() * columns;
  if (!(inflation.diagonal().maxCoeff() < kMaxInflation)) return unknown;
  const auto unit = units_.segment(block.offset, block.size).asDiagonal();
  return unit * inflation * unit;
}

double InverseInformation::Leverage(const ceres::Problem& problem,
                                    const std::vector<ceres::ResidualBlockId>& ids,
                                    const std::vector<ReducedBlock>& blocks,
                                    const ResidualWeight& weight) const {
  Evaluator evaluator(problem, {}, blocks, weight);
  double leverage = 0.0;
  for (const ceres::ResidualBlockId id : ids) {
    const int num_rows = problem.GetCostFunctionForResidualBlock(id)->num_residuals();
    if (inverse_factor_.size() == 0) {
      leverage += num_rows;
      continue;
    }
    Eigen::MatrixXd product = Eigen::MatrixXd::Zero(units_.size(), num_rows);
    for (const Evaluator::Factor& factor : evaluator.Evaluate(id)) {
      const ReducedBlock& block = *factor.block;
      product += inverse_factor_.middleCols(block.offset, block.size) *
                 units_.segment(block.offset, block.size).asDiagonal() *
                 factor.jacobian.transpose();
    }
    leverage += std::min<double>(num_rows, product.squaredNorm());
  }
  return leverage;
}

}  // namespace vgtw
