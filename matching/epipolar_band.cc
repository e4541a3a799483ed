// SPDX-License-Identifier: BSD-3-Clause
#include "matching/epipolar_band.h"

#include <cmath>

#include <Eigen/Geometry>

namespace vgtw {
namespace {

// The equation's gradient in view 1 is taken at one place of the band.
constexpr double kSlack = 1.25;

// A piece of a line in the units of x2.
struct Piece {
  Eigen::Vector2d start, foot, end;
};

// Sampson's distance divides by the gradient in both views, the distance from the line by that in
// view 2 alone: it is larger by this factor, most of all near the epipole.
double OneSidedFactor(const Eigen::Matrix3d& matrix,
                      const Eigen::Vector3d& line,
                      const Eigen::Vector2d& x2) {
  const double norm2_in_1 = (matrix.transpose() * x2.homogeneous()).head<2>().squaredNorm();
  return kSlack * std::sqrt(1.0 + norm2_in_1 / line.head<2>().squaredNorm());
}

std::optional<Piece> Clip(const Eigen::Vector3d& line,
                          const Eigen::Vector2d& expected,
                          double radius) {
  const double norm2 = line.head<2>().squaredNorm();
  if (!(norm2 > 0.0)) return std::nullopt;
  const Eigen::Vector2d foot = expected - line.dot(expected.homogeneous()) / norm2 * line.head<2>();
  if (!((foot - expected).norm() <= radius)) return std::nullopt;
  const Eigen::Vector2d reach = radius / std::sqrt(norm2) * Eigen::Vector2d(-line.y(), line.x());
  return Piece{foot - reach, foot, foot + reach};
}

}  // namespace

EpipolarBand EpipolarBand::OfRays(const Eigen::Matrix3d& E,
                                  const Camera& camera2,
                                  double max_error_px) {
  return EpipolarBand(E, &camera2, max_error_px);
}

EpipolarBand EpipolarBand::OfPixels(const Eigen::Matrix3d& F, double max_error_px) {
  return EpipolarBand(F, nullptr, max_error_px);
}

std::optional<Capsule> EpipolarBand::Around(const Eigen::Vector2f& expected_pixel,
                                            float radius_px,
                                            const Eigen::Vector2d& x1) const {
  const Eigen::Vector3d line = matrix_ * x1.homogeneous();
  const Capsule disc = {expected_pixel, expected_pixel, radius_px};
  Eigen::Vector2d expected = expected_pixel.cast<double>();
  double unit = 1.0;  // of x2, per pixel
  if (is_of_rays()) {
    const auto ray = Unproject(*camera2_, expected);
    if (!ray) return disc;
    expected = *ray;
    unit = 1.0 / camera2_->MeanFocalLength();
  }
  const double max_distance_px = max_error_px_ * OneSidedFactor(matrix_, line, expected);
  auto piece = Clip(line, expected, unit * (radius_px + max_distance_px));
  if (!piece) return std::nullopt;
  if (is_of_rays()) {
    for (Eigen::Vector2d* point : {&piece->start, &piece->foot, &piece->end}) {
      const auto pixel = Project(*camera2_, point->homogeneous());
      if (!pixel) return disc;
      *point = *pixel;
    }
  }
  Capsule capsule = {piece->start.cast<float>(), piece->end.cast<float>(), 0.0f};
  const float bow = std::sqrt(capsule.SquaredDistanceToAxis(piece->foot.cast<float>()));
  capsule.radius = bow + static_cast<float>(max_distance_px);
  return capsule;
}

}  // namespace vgtw
