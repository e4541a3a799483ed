// SPDX-License-Identifier: BSD-3-Clause
#include "refine/align.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

namespace vgtw {
namespace {

constexpr int kMaxIterations = 50;

struct PosePair {
  Rigid3d model;
  Rigid3d reference;
};

// Iteratively reweighted to the least sum of absolute angles; quaternions average by the largest
// eigenvector of the sum of their outer products.
Eigen::Quaterniond MedianRotation(const std::vector<PosePair>& pairs) {
  Eigen::Quaterniond median = Eigen::Quaterniond::Identity();
  for (int i = 0; i < kMaxIterations; ++i) {
    Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
    for (const PosePair& pair : pairs) {
      const Eigen::Quaterniond change = pair.reference.rotation.conjugate() * pair.model.rotation;
      // The first pass weighs all alike. Angles below 1e-6 deg are no longer told apart.
      const double weight = i == 0 ? 1.0 : 1.0 / std::max(AngleBetweenDeg(change, median), 1e-6);
      sum += weight * change.coeffs() * change.coeffs().transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum);
    const Eigen::Quaterniond next(Eigen::Vector4d(solver.eigenvectors().col(3)));
    const double change_deg = AngleBetweenDeg(next, median);
    median = next.normalized();
    if (change_deg < 1e-9) break;
  }
  return median;
}

double LargestNorm(const std::vector<Eigen::Vector3d>& points) {
  double largest = 0.0;
  for (const Eigen::Vector3d& point : points) largest = std::max(largest, point.norm());
  return largest;
}

// Scale and shift for a given rotation, reweighted likewise.
Sim3d MedianScaleAndShift(const std::vector<PosePair>& pairs, const Eigen::Quaterniond& rotation) {
  std::vector<Eigen::Vector3d> from, to;
  for (const PosePair& pair : pairs) {
    from.push_back(rotation * OriginInSource(pair.model));
    to.push_back(OriginInSource(pair.reference));
  }
  Sim3d similarity;
  similarity.rotation = rotation;
  // Of this size are differences of centres that coincide, and their products.
  const double rounding = 1e-12 * LargestNorm(to);
  const double product_rounding = 1e-12 * LargestNorm(from) * rounding;
  std::vector<double> weights(from.size(), 1.0);
  for (int i = 0; i < kMaxIterations; ++i) {
    double total = 0.0;
    Eigen::Vector3d mean_from = Eigen::Vector3d::Zero();
    Eigen::Vector3d mean_to = Eigen::Vector3d::Zero();
    for (size_t k = 0; k < from.size(); ++k) {
      total += weights[k];
      mean_from += weights[k] * from[k];
      mean_to += weights[k] * to[k];
    }
    mean_from /= total;
    mean_to /= total;
    double product = 0.0;
    double square = 0.0;
    double extent = 0.0;
    for (size_t k = 0; k < from.size(); ++k) {
      product += weights[k] * (from[k] - mean_from).dot(to[k] - mean_to);
      square += weights[k] * (from[k] - mean_from).squaredNorm();
      extent = std::max(extent, (to[k] - mean_to).norm());
    }
    // Centres that coincide or run against each other have no similarity; the scale is left as it
    // is.
    if (product > product_rounding * total) similarity.scale = product / square;
    const Eigen::Vector3d before = similarity.translation;
    similarity.translation = mean_to - similarity.scale * mean_from;
    if (extent <= rounding || (similarity.translation - before).norm() <= 1e-12 * extent) break;
    for (size_t k = 0; k < from.size(); ++k) {
      const double distance = (similarity.scale * from[k] + similarity.translation - to[k]).norm();
      weights[k] = 1.0 / std::max(distance, 1e-9 * extent);
    }
  }
  return similarity;
}

}  // namespace

Sim3d AlignPoses(const Reconstruction& model,
                 const Reconstruction& reference,
                 const std::set<ImageId>& left_out) {
  std::vector<PosePair> pairs;
  for (const auto& [id, image] : model.images) {
    const auto other = reference.images.find(id);
    if (other == reference.images.end() || left_out.contains(id)) continue;
    pairs.push_back({image.cam_from_world, other->second.cam_from_world});
  }
  if (pairs.empty()) return {};
  return MedianScaleAndShift(pairs, MedianRotation(pairs));
}

void Transform(const Sim3d& b_from_world, Reconstruction& model) {
  for (auto& [id, image] : model.images) {
    image.cam_from_world = TransformCamera(b_from_world, image.cam_from_world);
  }
  for (auto& [id, point] : model.points3D) point.xyz = b_from_world * point.xyz;
  UpdateFrames(model);
}

}  // namespace vgtw
