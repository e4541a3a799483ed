// SPDX-License-Identifier: BSD-3-Clause
#include "scene/distractor_mask.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace vgtw {
namespace {

// Two neighbouring samples of one axis and the weight of the second.
struct LinearTap {
  int first = 0;
  int second = 0;
  float weight = 0.0f;
};

// `position` in continuous pixels, inside [0, size]; beyond the outermost centres the value is
// continued as a constant. A tap without weight is not touched, so that its NaN does not spread.
LinearTap MakeTap(double position, int size) {
  const double centred = std::clamp(position - 0.5, 0.0, static_cast<double>(size - 1));
  const auto first = static_cast<int>(centred);
  const auto weight = static_cast<float>(centred - first);
  return {first, weight > 0.0f ? first + 1 : first, weight};
}

float Lerp(float a, float b, float weight) { return a + weight * (b - a); }

// Distractor probability at a continuous network pixel; NaN outside and next to unknown pixels.
float SampleProbability(const DistractorMask& distractor, double x, double y) {
  if (!(x >= 0.0 && y >= 0.0 && x <= distractor.width() && y <= distractor.height())) {
    return std::numeric_limits<float>::quiet_NaN();
  }
  const LinearTap tap_x = MakeTap(x, distractor.width());
  const LinearTap tap_y = MakeTap(y, distractor.height());
  const auto sample_row = [&](int row) {
    return Lerp(distractor(tap_x.first, row), distractor(tap_x.second, row), tap_x.weight);
  };
  return Lerp(sample_row(tap_y.first), sample_row(tap_y.second), tap_y.weight);
}

// States of original pixels, [H,W] CV_8UC1, 255 = true. Neither means known to be static.
struct PixelStates {
  cv::Mat is_excluded;
  cv::Mat is_unknown;
};

PixelStates Classify(const View& view, const DistractorMask& distractor, double threshold) {
  const cv::Size size(static_cast<int>(view.camera.width), static_cast<int>(view.camera.height));
  PixelStates states{cv::Mat(size, CV_8UC1, cv::Scalar(0)), cv::Mat(size, CV_8UC1, cv::Scalar(0))};
  if (distractor.empty()) {
    states.is_unknown.setTo(255);
    return states;
  }
  const PixelMap network_from_original = Inverse(view.original_from_network);
  for (int y = 0; y < size.height; ++y) {
    uchar* is_excluded = states.is_excluded.ptr<uchar>(y);
    uchar* is_unknown = states.is_unknown.ptr<uchar>(y);
    const Eigen::Vector2d row_start = network_from_original * Eigen::Vector3d(0.5, y + 0.5, 1.0);
    for (int x = 0; x < size.width; ++x) {
      const Eigen::Vector2d pixel = row_start + x * network_from_original.col(0);
      const float probability = SampleProbability(distractor, pixel.x(), pixel.y());
      if (std::isnan(probability)) {
        is_unknown[x] = 255;
      } else if (probability >= threshold) {
        is_excluded[x] = 255;
      }
    }
  }
  return states;
}

// Exact distance of every pixel centre to the centre of the nearest pixel of value 0.
cv::Mat DistanceToZero(const cv::Mat& image) {
  cv::Mat distance;
  cv::distanceTransform(image, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return distance;
}

// Only known static pixels eat into the excluded area: image and crop borders do not.
void Erode(PixelStates& states, int radius_px) {
  if (radius_px == 0) return;
  const cv::Mat is_not_static = states.is_excluded | states.is_unknown;
  if (cv::countNonZero(is_not_static) == is_not_static.size().area()) return;
  states.is_excluded.setTo(0, DistanceToZero(is_not_static) <= radius_px);
}

void Dilate(cv::Mat& is_excluded, int radius_px) {
  if (radius_px == 0 || cv::countNonZero(is_excluded) == 0) return;
  is_excluded.setTo(255, DistanceToZero(~is_excluded) <= radius_px);
}

struct Components {
  cv::Mat labels;  // CV_32S, 0 = background
  cv::Mat stats;   // one row of cv::CC_STAT_* per label

  int num_labels() const { return stats.rows; }
  int area(int label) const { return stats.at<int>(label, cv::CC_STAT_AREA); }
  bool touches_border(int label) const {
    const int* row = stats.ptr<int>(label);
    return row[cv::CC_STAT_LEFT] == 0 || row[cv::CC_STAT_TOP] == 0 ||
           row[cv::CC_STAT_LEFT] + row[cv::CC_STAT_WIDTH] == labels.cols ||
           row[cv::CC_STAT_TOP] + row[cv::CC_STAT_HEIGHT] == labels.rows;
  }
};

Components FindComponents(const cv::Mat& image, int connectivity) {
  Components components;
  cv::Mat centroids;
  cv::connectedComponentsWithStats(
      image, components.labels, components.stats, centroids, connectivity, CV_32S);
  return components;
}

void PaintLabels(const cv::Mat& labels,
                 const std::vector<bool>& is_painted,
                 uchar value,
                 cv::Mat& image) {
  for (int y = 0; y < image.rows; ++y) {
    const int* label = labels.ptr<int>(y);
    uchar* pixel = image.ptr<uchar>(y);
    for (int x = 0; x < image.cols; ++x) {
      if (is_painted[static_cast<size_t>(label[x])]) pixel[x] = value;
    }
  }
}

void RemoveSmallAreas(cv::Mat& is_excluded, int min_area_px) {
  if (min_area_px <= 1) return;
  const Components components = FindComponents(is_excluded, 8);
  std::vector<bool> is_small(static_cast<size_t>(components.num_labels()), false);
  for (int label = 1; label < components.num_labels(); ++label) {
    is_small[static_cast<size_t>(label)] = components.area(label) < min_area_px;
  }
  PaintLabels(components.labels, is_small, 0, is_excluded);
}

// A gap that is open to the image border is no hole.
void FillHoles(cv::Mat& is_excluded, int fill_holes_px) {
  if (fill_holes_px <= 1) return;
  const Components components = FindComponents(~is_excluded, 4);
  std::vector<bool> is_hole(static_cast<size_t>(components.num_labels()), false);
  for (int label = 1; label < components.num_labels(); ++label) {
    is_hole[static_cast<size_t>(label)] =
        components.area(label) < fill_holes_px && !components.touches_border(label);
  }
  PaintLabels(components.labels, is_hole, 255, is_excluded);
}

}  // namespace

void StaticMaskOptions::Check() const {
  VGTW_CHECK(threshold > 0.0 && threshold <= 1.0,
             "StaticMaskOptions::threshold = " + std::to_string(threshold) + ", must be in (0, 1]");
  const auto check = [](int value, const std::string& name) {
    VGTW_CHECK(value >= 0,
               "StaticMaskOptions::" + name + " = " + std::to_string(value) + ", must be >= 0");
  };
  check(dilate_px, "dilate_px");
  check(erode_px, "erode_px");
  check(min_area_px, "min_area_px");
  check(fill_holes_px, "fill_holes_px");
}

StaticMask MakeStaticMask(const View& view,
                          const DistractorMask& distractor,
                          const StaticMaskOptions& options) {
  options.Check();
  constexpr uint64_t kMaxSide = 1 << 20;
  VGTW_CHECK(view.camera.width - 1 < kMaxSide && view.camera.height - 1 < kMaxSide,
             view.name + ": camera size is absurd");
  VGTW_CHECK(distractor.width() == view.network_width && distractor.height() == view.network_height,
             view.name + ": distractor probability is not of network size");
  PixelStates states = Classify(view, distractor, options.threshold);
  Erode(states, options.erode_px);
  RemoveSmallAreas(states.is_excluded, options.min_area_px);
  FillHoles(states.is_excluded, options.fill_holes_px);
  Dilate(states.is_excluded, options.dilate_px);
  if (options.unknown == UnknownPolicy::kExclude) states.is_excluded |= states.is_unknown;
  StaticMask static_mask(states.is_excluded.cols, states.is_excluded.rows);
  std::transform(states.is_excluded.begin<uchar>(),
                 states.is_excluded.end<uchar>(),
                 static_mask.data().begin(),
                 [](uchar is_excluded) { return static_cast<uint8_t>(255 - is_excluded); });
  return static_mask;
}

bool IsExcluded(const StaticMask& static_mask, double x, double y) {
  const bool is_inside =
      x >= 0.0 && y >= 0.0 && x < static_mask.width() && y < static_mask.height();
  return !is_inside || static_mask(static_cast<int>(x), static_cast<int>(y)) == 0;
}

Grid<float> DistanceToExcluded(const StaticMask& static_mask) {
  Grid<float> distance(
      static_mask.width(), static_mask.height(), std::numeric_limits<float>::infinity());
  const auto& pixels = static_mask.data();
  if (std::find(pixels.begin(), pixels.end(), 0) == pixels.end()) return distance;
  // OpenCV's headers of foreign memory are not const; the source is only read.
  const cv::Mat is_kept(
      static_mask.height(), static_mask.width(), CV_8UC1, const_cast<uint8_t*>(pixels.data()));
  DistanceToZero(is_kept).copyTo(
      cv::Mat(distance.height(), distance.width(), CV_32FC1, distance.data().data()));
  return distance;
}

double ExcludedShare(const StaticMask& static_mask) {
  if (static_mask.empty()) return 0.0;
  const auto num_excluded = std::count(static_mask.data().begin(), static_mask.data().end(), 0);
  return static_cast<double>(num_excluded) / static_cast<double>(static_mask.size());
}

}  // namespace vgtw
