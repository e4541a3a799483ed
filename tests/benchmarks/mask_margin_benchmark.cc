// SPDX-License-Identifier: BSD-3-Clause
// mask_margin_benchmark SCENE ...
// How wide SiftOptions::mask_margin_scales should be. SCENE holds images/ and masks/
// (<photo>.png, 0 = distractor). Behind its mask every photo gets what the next photo, mirrored,
// shows there, as if another distractor stood in the same place. A static feature is contaminated
// if it is not found again (1 scale, a quarter octave, 20 deg) with a descriptor that differs by
// less than the angle at the head of the column. By the width of the margin: how many of the
// features that are kept are contaminated, and how many of the clean ones are lost.
#include "matching/sift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <span>
#include <string>
#include <vector>

namespace vgtw {
namespace {

constexpr std::array kMargins = {0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0};
constexpr std::array kMaxAngles_rad = {0.1, 0.2, 0.4};

struct StaticFeature {
  double distance_scales = 0.0;  // to the mask
  double change_rad = 0.0;       // of the descriptor, pi if not found again
};

double Angle_rad(const Descriptors& a, size_t i, const Descriptors& b, size_t j) {
  double dot = 0.0;
  double norm_a = 0.0;
  double norm_b = 0.0;
  for (size_t k = 0; k < a.cols; ++k) {
    const double value_a = a.data[i * a.cols + k];
    const double value_b = b.data[j * b.cols + k];
    dot += value_a * value_b;
    norm_a += value_a * value_a;
    norm_b += value_b * value_b;
  }
  return std::acos(std::min(1.0, dot / std::sqrt(norm_a * norm_b)));
}

double Orientation_rad(const Keypoints& keypoints, size_t i) {
  return std::atan2(keypoints.data[i * 6 + 4], keypoints.data[i * 6 + 2]);
}

bool IsSameKeypoint(const Keypoints& a, size_t i, const Keypoints& b, size_t j) {
  const double turn_rad =
      std::remainder(Orientation_rad(a, i) - Orientation_rad(b, j), 2.0 * std::numbers::pi);
  return std::hypot(a.x(i) - b.x(j), a.y(i) - b.y(j)) < a.Scale(i) &&
         std::abs(std::log2(a.Scale(i) / b.Scale(j))) < 0.25 &&
         std::abs(turn_rad) < 20.0 * std::numbers::pi / 180.0;
}

double Change_rad(const Features& a, size_t i, const Features& b) {
  double least_rad = std::numbers::pi;
  size_t j = 0;  // first that is near enough in x, by which the rows are sorted
  for (size_t end = b.keypoints.rows; j < end;) {
    const size_t middle = (j + end) / 2;
    if (b.keypoints.x(middle) < a.keypoints.x(i) - a.keypoints.Scale(i)) {
      j = middle + 1;
    } else {
      end = middle;
    }
  }
  for (; j < b.keypoints.rows; ++j) {
    if (b.keypoints.x(j) > a.keypoints.x(i) + a.keypoints.Scale(i)) break;
    if (!IsSameKeypoint(a.keypoints, i, b.keypoints, j)) continue;
    least_rad = std::min(least_rad, Angle_rad(a.descriptors, i, b.descriptors, j));
  }
  return least_rad;
}

GrayImage WithOtherDistractor(GrayImage photo, const StaticMask& mask, const GrayImage& other) {
  for (int y = 0; y < photo.height(); ++y) {
    for (int x = 0; x < photo.width(); ++x) {
      if (mask(x, y) == 0)
        photo(x, y) = other(other.width() - 1 - x % other.width(), y % other.height());
    }
  }
  return photo;
}

std::vector<StaticFeature> Measure(const std::filesystem::path& scene) {
  SiftOptions options;
  options.mask_margin_scales = 0.0;
  options.max_num_features = 1 << 20;
  const std::vector<std::string> names = ListImages(scene / "images");
  std::vector<StaticFeature> result;
  for (size_t n = 0; n < names.size(); ++n) {
    const GrayImage photo = ReadGrayImage(scene / "images" / names[n]);
    const StaticMask mask = ReadStaticMask(scene / "masks" / (names[n] + ".png"));
    const GrayImage next = ReadGrayImage(scene / "images" / names[(n + 1) % names.size()]);
    const Features features = ExtractSift(photo, mask, options);
    const Features changed = ExtractSift(WithOtherDistractor(photo, mask, next), mask, options);
    const Grid<float> distance = DistanceToExcluded(mask);
    const Keypoints& keypoints = features.keypoints;
    for (size_t i = 0; i < keypoints.rows; ++i) {
      const float pixels =
          distance(static_cast<int>(keypoints.x(i)), static_cast<int>(keypoints.y(i)));
      result.push_back({pixels / keypoints.Scale(i), Change_rad(features, i, changed)});
    }
  }
  return result;
}

void Print(const char* scene, const std::vector<StaticFeature>& features) {
  std::printf("%s, %zu features outside of masks\n margin", scene, features.size());
  for (const double max_angle_rad : kMaxAngles_rad) {
    std::printf(" | > %.1f rad: contaminated, lost", max_angle_rad);
  }
  std::printf("\n");
  for (const double margin : kMargins) {
    std::printf("%7.0f", margin);
    for (const double max_angle_rad : kMaxAngles_rad) {
      double num_kept = 0.0;
      double num_contaminated = 0.0;
      double num_clean = 0.0;
      double num_lost = 0.0;
      for (const StaticFeature& feature : features) {
        const bool is_kept = margin == 0.0 || feature.distance_scales > margin;
        const bool is_clean = feature.change_rad <= max_angle_rad;
        num_kept += is_kept;
        num_contaminated += is_kept && !is_clean;
        num_clean += is_clean;
        num_lost += is_clean && !is_kept;
      }
      std::printf(" |     %13.2f %%, %5.2f %%",
                  100.0 * num_contaminated / num_kept,
                  100.0 * num_lost / num_clean);
    }
    std::printf("\n");
  }
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  for (const char* scene : std::span(argv, static_cast<size_t>(argc)).subspan(1)) {
    vgtw::Print(scene, vgtw::Measure(scene));
  }
}
