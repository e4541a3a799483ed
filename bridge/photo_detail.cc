// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/photo_detail.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace vgtw {
namespace {

constexpr int kLocalRadius = 8;  // pixels of the reduced photo

float GreyLevel(const Rgb& rgb) {
  return 0.299f * static_cast<float>(rgb[0]) + 0.587f * static_cast<float>(rgb[1]) +
         0.114f * static_cast<float>(rgb[2]);
}

// Means of the blocks of original pixels that fall into each reduced pixel.
Grid<float> Reduce(const RgbImage& image) {
  const double scale =
      std::min(1.0, static_cast<double>(kDetailSide) / std::max(image.width(), image.height()));
  const int width = std::max(1, static_cast<int>(image.width() * scale));
  const int height = std::max(1, static_cast<int>(image.height() * scale));
  Grid<float> sums(width, height);
  Grid<int> counts(width, height);
  for (int y = 0; y < image.height(); ++y) {
    const auto reduced_y = static_cast<int>(int64_t{y} * height / image.height());
    for (int x = 0; x < image.width(); ++x) {
      const auto reduced_x = static_cast<int>(int64_t{x} * width / image.width());
      sums(reduced_x, reduced_y) += GreyLevel(image(x, y));
      ++counts(reduced_x, reduced_y);
    }
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    sums.data()[i] /= static_cast<float>(counts.data()[i]);
  }
  return sums;
}

// Sums over all pixels above and to the left: [H+1,W+1].
Grid<double> IntegralImage(const Grid<float>& image) {
  Grid<double> integral(image.width() + 1, image.height() + 1);
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      integral(x + 1, y + 1) =
          image(x, y) + integral(x, y + 1) + integral(x + 1, y) - integral(x, y);
    }
  }
  return integral;
}

}  // namespace

PhotoDetail MakePhotoDetail(const RgbImage& image) {
  VGTW_CHECK(!image.empty(), "the photo is empty");
  PhotoDetail detail = Reduce(image);
  const Grid<double> integral = IntegralImage(detail);
  for (int y = 0; y < detail.height(); ++y) {
    const int top = std::max(0, y - kLocalRadius);
    const int bottom = std::min(detail.height(), y + kLocalRadius + 1);
    for (int x = 0; x < detail.width(); ++x) {
      const int left = std::max(0, x - kLocalRadius);
      const int right = std::min(detail.width(), x + kLocalRadius + 1);
      const double sum = integral(right, bottom) - integral(left, bottom) - integral(right, top) +
                         integral(left, top);
      detail(x, y) -= static_cast<float>(sum / ((right - left) * (bottom - top)));
    }
  }
  return detail;
}

float DetailAt(const PhotoDetail& detail, const Eigen::Vector2d& relative_position) {
  const auto x = static_cast<int>(std::floor(relative_position.x() * detail.width()));
  const auto y = static_cast<int>(std::floor(relative_position.y() * detail.height()));
  return detail.Contains(x, y) ? detail(x, y) : 0.0f;
}

double Correlation(const std::vector<float>& a, const std::vector<float>& b) {
  VGTW_CHECK(a.size() == b.size(), "two lists of different lengths");
  if (a.size() < 2) return 0.0;
  const auto length = static_cast<Eigen::Index>(a.size());
  const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXf>(a.data(), length).cast<double>();
  const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXf>(b.data(), length).cast<double>();
  const Eigen::VectorXd x_centred = x.array() - x.mean();
  const Eigen::VectorXd y_centred = y.array() - y.mean();
  const double norm = x_centred.norm() * y_centred.norm();
  return norm > 0.0 ? x_centred.dot(y_centred) / norm : 0.0;
}

}  // namespace vgtw
