// SPDX-License-Identifier: BSD-3-Clause
#include "scene/drawing.h"

#include <algorithm>

#include <opencv2/imgproc.hpp>

namespace vgtw {
namespace {

// The same pixels, seen by OpenCV; channels stay in RGB order.
cv::Mat AsMat(RgbImage& image) {
  return {image.height(), image.width(), CV_8UC3, image.data().data()};
}

cv::Scalar Scalar(const Rgb& color) {
  return {double(color[0]), double(color[1]), double(color[2])};
}

}  // namespace

RgbImage ResizeImage(const RgbImage& image, int width, int height) {
  VGTW_CHECK(!image.empty() && width > 0 && height > 0, "resized image has pixels");
  RgbImage source = image;
  RgbImage resized(width, height);
  cv::Mat target = AsMat(resized);
  const bool is_smaller = width < image.width();
  cv::resize(AsMat(source),
             target,
             target.size(),
             0.0,
             0.0,
             is_smaller ? cv::INTER_AREA : cv::INTER_LINEAR);
  return resized;
}

RgbImage ResizeToWidth(const RgbImage& image, int width) {
  const double aspect = double(image.height()) / double(image.width());
  return ResizeImage(image, width, std::max(1, cvRound(width * aspect)));
}

void DrawDisc(const Eigen::Vector2d& centre, double radius_px, const Rgb& color, RgbImage& image) {
  // Fixed point with 4 fractional bits; OpenCV's pixel centres are at integers.
  constexpr int kShift = 4;
  constexpr double kScale = 1 << kShift;
  cv::Mat target = AsMat(image);
  cv::circle(target,
             cv::Point(cvRound((centre.x() - 0.5) * kScale), cvRound((centre.y() - 0.5) * kScale)),
             cvRound(radius_px * kScale),
             Scalar(color),
             cv::FILLED,
             cv::LINE_AA,
             kShift);
}

void DrawText(
    const std::string& text, int x, int y, double height_px, const Rgb& color, RgbImage& image) {
  constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
  constexpr double kCapitalHeightPx = 21.0;  // of this font at scale 1
  cv::Mat target = AsMat(image);
  cv::putText(target,
              text,
              cv::Point(x, y),
              kFont,
              height_px / kCapitalHeightPx,
              Scalar(color),
              std::max(1, cvRound(height_px / 10.0)),
              cv::LINE_AA);
}

void Paste(const RgbImage& image, int x, int y, RgbImage& canvas) {
  VGTW_CHECK(x >= 0 && y >= 0 && x + image.width() <= canvas.width() &&
                 y + image.height() <= canvas.height(),
             "pasted image fits");
  for (int row = 0; row < image.height(); ++row) {
    std::copy_n(&image(0, row), image.width(), &canvas(x, y + row));
  }
}

}  // namespace vgtw
