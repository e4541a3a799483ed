// SPDX-License-Identifier: BSD-3-Clause
#include "matching/sift.h"

#include "matching/sift_budget.h"
#include "scene/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/core/version.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace vgtw {
namespace {

constexpr int kNumLayers = 3;
constexpr int kDescriptorSize = 128;
// Below, OpenCV's pyramid would have no octave.
constexpr int kMinSide = 4;

cv::Ptr<cv::SIFT> MakeSift(const SiftOptions& options) {
  constexpr int kAll = 0;
  constexpr double kBaseSigma = 1.6;
  const double contrast_threshold = kNumLayers * options.peak_threshold;
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 8)
  return cv::SIFT::create(
      kAll, kNumLayers, contrast_threshold, options.edge_threshold, kBaseSigma, CV_8U, true);
#else
  return cv::SIFT::create(
      kAll, kNumLayers, contrast_threshold, options.edge_threshold, kBaseSigma, CV_8U);
#endif
}

// From OpenCV's keypoints to continuous pixels: its first centre is 0, and where it does not place
// the pixels of the doubled image precisely, everything lies a quarter pixel too far to the right.
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 8)
constexpr double kPixelOffset = 0.5;
#else
constexpr double kPixelOffset = 0.25;
#endif

ImageSize ReducedSize(const ImageSize& size, int max_image_size) {
  const uint64_t longer = std::max(size.width, size.height);
  const auto limit = static_cast<uint64_t>(max_image_size);
  if (longer <= limit) return size;
  // COLMAP's rounding: down.
  return {std::max<uint64_t>(1, size.width * limit / longer),
          std::max<uint64_t>(1, size.height * limit / longer)};
}

cv::Mat Reduce(const GrayImage& image, int max_image_size) {
  // Only read from.
  const cv::Mat original(
      image.height(), image.width(), CV_8UC1, const_cast<uint8_t*>(image.data().data()));
  const ImageSize size =
      ReducedSize({static_cast<uint64_t>(image.width()), static_cast<uint64_t>(image.height())},
                  max_image_size);
  const cv::Size reduced_size(static_cast<int>(size.width), static_cast<int>(size.height));
  if (reduced_size == original.size()) return original;
  cv::Mat reduced;
  cv::resize(original, reduced, reduced_size, 0.0, 0.0, cv::INTER_AREA);
  return reduced;
}

// A COLMAP keypoint: x y a11 a12 a21 a22.
using KeypointRow = std::array<float, 6>;

KeypointRow ToRow(const cv::KeyPoint& keypoint, double scale_x, double scale_y) {
  const double angle_rad = static_cast<double>(keypoint.angle) * std::numbers::pi / 180.0;
  const double cos_s = 0.5 * static_cast<double>(keypoint.size) * std::cos(angle_rad);
  const double sin_s = 0.5 * static_cast<double>(keypoint.size) * std::sin(angle_rad);
  return {static_cast<float>(scale_x * (static_cast<double>(keypoint.pt.x) + kPixelOffset)),
          static_cast<float>(scale_y * (static_cast<double>(keypoint.pt.y) + kPixelOffset)),
          static_cast<float>(scale_x * cos_s),
          static_cast<float>(scale_x * -sin_s),
          static_cast<float>(scale_y * sin_s),
          static_cast<float>(scale_y * cos_s)};
}

class Exclusion {
 public:
  Exclusion(const StaticMask& static_mask, double margin_scales)
      : static_mask_(static_mask), margin_scales_(margin_scales) {
    if (margin_scales > 0.0) distance_ = DistanceToExcluded(static_mask);
  }

  bool operator()(const KeypointRow& row) const {
    const float x = row[0];
    const float y = row[1];
    if (static_mask_.empty()) return false;
    if (IsExcluded(static_mask_, x, y)) return true;
    const double scale = std::hypot(row[2], row[4]);
    return !distance_.empty() &&
           static_cast<double>(distance_(static_cast<int>(x), static_cast<int>(y))) <=
               margin_scales_ * scale;
  }

 private:
  const StaticMask& static_mask_;
  double margin_scales_;
  Grid<float> distance_;
};

void AppendRoot(const uint8_t* descriptor, std::vector<uint8_t>& bytes) {
  int sum = 0;
  for (int i = 0; i < kDescriptorSize; ++i) sum += descriptor[i];
  const float factor = 512.0f / std::sqrt(static_cast<float>(std::max(sum, 1)));
  for (int i = 0; i < kDescriptorSize; ++i) {
    const float root = factor * std::sqrt(static_cast<float>(descriptor[i]));
    bytes.push_back(static_cast<uint8_t>(std::min(root + 0.5f, 255.0f)));
  }
}

}  // namespace

void SiftOptions::Check() const {
  const auto check = [](bool is_valid, const char* name, double value, const char* bounds) {
    VGTW_CHECK(is_valid,
               std::string("SiftOptions::") + name + " = " + std::to_string(value) +
                   ", must be in " + bounds);
  };
  check(max_image_size >= 1 && max_image_size <= 16000,
        "max_image_size",
        max_image_size,
        "[1, 16000]");
  check(max_num_features >= 1, "max_num_features", max_num_features, "[1, inf)");
  check(peak_threshold > 0.0 && peak_threshold < 1.0, "peak_threshold", peak_threshold, "(0, 1)");
  check(edge_threshold > 1.0 && std::isfinite(edge_threshold),
        "edge_threshold",
        edge_threshold,
        "(1, inf)");
  check(mask_margin_scales >= 0.0 && std::isfinite(mask_margin_scales),
        "mask_margin_scales",
        mask_margin_scales,
        "[0, inf)");
}

Features ExtractSift(const GrayImage& image,
                     const StaticMask& static_mask,
                     const SiftOptions& options) {
  options.Check();
  VGTW_CHECK(static_mask.empty() ||
                 (static_mask.width() == image.width() && static_mask.height() == image.height()),
             "a mask has the size of its image");
  Features features;
  features.keypoints.cols = 6;
  features.descriptors.cols = kDescriptorSize;
  if (image.empty()) return features;
  const cv::Mat reduced = Reduce(image, options.max_image_size);
  if (std::min(reduced.cols, reduced.rows) < kMinSide) return features;

  // Descriptors of dropped keypoints are cheaper than a second pyramid for those of the kept ones.
  std::vector<cv::KeyPoint> detected;
  cv::Mat descriptors;
  MakeSift(options)->detectAndCompute(reduced, cv::noArray(), detected, descriptors);

  const double scale_x = static_cast<double>(image.width()) / reduced.cols;
  const double scale_y = static_cast<double>(image.height()) / reduced.rows;
  const Exclusion is_excluded(static_mask, options.mask_margin_scales);
  std::vector<KeypointRow> rows;
  std::vector<ScoredPixel> scored_pixels;
  std::vector<int> descriptor_idxs;
  for (size_t i = 0; i < detected.size(); ++i) {
    const KeypointRow row = ToRow(detected[i], scale_x, scale_y);
    if (is_excluded(row)) continue;
    rows.push_back(row);
    scored_pixels.push_back({{row[0], row[1]}, detected[i].response});
    descriptor_idxs.push_back(static_cast<int>(i));
  }
  const ImageSize size{static_cast<uint64_t>(image.width()), static_cast<uint64_t>(image.height())};
  const auto budget = static_cast<size_t>(options.max_num_features);
  for (const size_t i : SpreadOverImage(scored_pixels, size, budget)) {
    features.keypoints.data.insert(features.keypoints.data.end(), rows[i].begin(), rows[i].end());
    AppendRoot(descriptors.ptr<uint8_t>(descriptor_idxs[i]), features.descriptors.data);
    ++features.keypoints.rows;
  }
  features.descriptors.rows = features.keypoints.rows;
  return features;
}

int64_t SiftMemory(const ImageSize& size, const SiftOptions& options) {
  options.Check();
  // OpenCV keeps, in float and at twice the size, six Gaussians of every octave and their five
  // differences: 4 bytes * 4 * 11 * 4/3 = 235, and one octave's blur in progress; measured 225.
  constexpr int64_t kBytesPerReducedPixel = 240;
  // Image, mask, distance and, while it is made, its copies in OpenCV.
  constexpr int64_t kBytesPerPixel = 16;
  const ImageSize reduced = ReducedSize(size, options.max_image_size);
  return kBytesPerReducedPixel * static_cast<int64_t>(reduced.width * reduced.height) +
         kBytesPerPixel * static_cast<int64_t>(size.width * size.height);
}

}  // namespace vgtw
