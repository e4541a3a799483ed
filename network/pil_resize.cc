// SPDX-License-Identifier: BSD-3-Clause
#include "network/pil_resize.h"

#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

namespace vgtw {
namespace {

constexpr size_t kNumChannels = 3;

// Weights are integers in units of 2^-22, as in Pillow.
constexpr int kWeightBits = 22;
// Along rows each is split into high * 2^11 + low: a sum becomes two dot products of 16 bits, for
// which processors have an instruction. No weight comes near 2^26, where `high` would overflow: a
// kernel's peak is 1, and where the border cuts its tails, normalizing adds less than a third.
constexpr int kLowBits = 11;
// 255 * 2^11 * (6 * 512 + 2 taps) < 2^31, so that no sum overflows.
constexpr int kMaxShrinking = 512;
// Taps are padded with zeros to whole vectors.
constexpr int kVectorSize = 8;

double Sinc(double x) {
  const double angle = x * std::numbers::pi;
  return angle == 0.0 ? 1.0 : std::sin(angle) / angle;
}

// The order of the operations decides the last bit.
double Bicubic(double x) {
  x = std::abs(x);
  if (x < 1.0) return (1.5 * x - 2.5) * x * x + 1.0;
  if (x < 2.0) return (((x - 5.0) * x + 8.0) * x - 4.0) * -0.5;
  return 0.0;
}

double Lanczos(double x) { return x >= -3.0 && x < 3.0 ? Sinc(x) * Sinc(x / 3.0) : 0.0; }

struct Kernel {
  double radius;
  double (*value)(double x);
};

Kernel KernelOf(PilFilter filter) {
  return filter == PilFilter::kBicubic ? Kernel{2.0, Bicubic} : Kernel{3.0, Lanczos};
}

// How one new pixel of an axis is made: sum_k weights[k] old[first + k] / 2^22.
struct Taps {
  int first = 0;
  std::vector<int32_t> weights;
};

// Pixels first .. end - 1 of an axis.
struct Range {
  int first = 0;
  int end = 0;
  int size() const { return end - first; }
};

std::vector<Taps> MakeTaps(int old_size, int new_size, const Range& wanted, PilFilter filter) {
  const Kernel kernel = KernelOf(filter);
  const double scale = static_cast<double>(old_size) / new_size;
  const double stretch = std::max(scale, 1.0);
  const double radius = kernel.radius * stretch;
  std::vector<Taps> taps(static_cast<size_t>(wanted.size()));
  std::vector<double> values;
  for (int i = wanted.first; i < wanted.end; ++i) {
    const double centre = (i + 0.5) * scale;
    const int first = std::max(static_cast<int>(centre - radius + 0.5), 0);
    const int end = std::min(static_cast<int>(centre + radius + 0.5), old_size);
    values.clear();
    double sum = 0.0;
    for (int j = first; j < end; ++j) {
      values.push_back(kernel.value((j - centre + 0.5) * (1.0 / stretch)));
      sum += values.back();
    }
    Taps& tap = taps[static_cast<size_t>(i - wanted.first)];
    tap.first = first;
    for (const double value : values) {
      const double weight = value / sum;
      tap.weights.push_back(
          static_cast<int32_t>(weight * (1 << kWeightBits) + (weight < 0.0 ? -0.5 : 0.5)));
    }
  }
  return taps;
}

uint8_t RoundToByte(int32_t sum) {
  return static_cast<uint8_t>(std::clamp((sum + (1 << (kWeightBits - 1))) >> kWeightBits, 0, 255));
}

// The taps of a row, ready for Dot: those of output i start at i * num_vectors * kVectorSize.
struct RowTaps {
  int num_vectors = 0;
  std::vector<int> first;
  std::vector<int16_t> high;
  std::vector<int16_t> low;
};

RowTaps MakeRowTaps(const std::vector<Taps>& taps) {
  size_t max_taps = 0;
  for (const Taps& tap : taps) max_taps = std::max(max_taps, tap.weights.size());
  RowTaps row;
  row.num_vectors = (static_cast<int>(max_taps) + kVectorSize - 1) / kVectorSize;
  const auto stride = static_cast<size_t>(row.num_vectors * kVectorSize);
  row.high.resize(taps.size() * stride);
  row.low.resize(taps.size() * stride);
  for (size_t i = 0; i < taps.size(); ++i) {
    row.first.push_back(taps[i].first);
    for (size_t k = 0; k < taps[i].weights.size(); ++k) {
      const int32_t weight = taps[i].weights[k];
      row.high[i * stride + k] = static_cast<int16_t>(weight >> kLowBits);
      row.low[i * stride + k] = static_cast<int16_t>(weight & ((1 << kLowBits) - 1));
    }
  }
  return row;
}

int32_t Dot(const int16_t* a, const int16_t* b, int num_vectors) {
  int32_t sum = 0;
  for (int i = 0; i < num_vectors * kVectorSize; ++i) sum += a[i] * b[i];
  return sum;
}

// One channel of a row. `old_line` is longer than the row by one stride, which has no weight.
void ResizeLine(const int16_t* old_line, const RowTaps& taps, size_t channel, Rgb* new_row) {
  const auto stride = static_cast<size_t>(taps.num_vectors * kVectorSize);
  const int16_t* high = taps.high.data();
  const int16_t* low = taps.low.data();
  for (const int first : taps.first) {
    const int32_t sum = Dot(old_line + first, high, taps.num_vectors) * (1 << kLowBits) +
                        Dot(old_line + first, low, taps.num_vectors);
    (*new_row++)[channel] = RoundToByte(sum);
    high += stride;
    low += stride;
  }
}

// The wanted rows of `image`, `width` wide.
RgbImage ResizeWidth(const RgbImage& image,
                     int width,
                     const Range& rows,
                     const PilResizeOptions& options) {
  constexpr int kRowsPerTask = 64;
  const RowTaps taps = MakeRowTaps(MakeTaps(image.width(), width, {0, width}, options.filter));
  const auto old_width = static_cast<size_t>(image.width());
  RgbImage resized(width, rows.size());
  const int num_tasks = (rows.size() + kRowsPerTask - 1) / kRowsPerTask;
  ParallelFor(num_tasks, options.num_threads, [&](int64_t task) {
    std::vector<int16_t> line(old_width + static_cast<size_t>(taps.num_vectors * kVectorSize));
    const int first_row = static_cast<int>(task) * kRowsPerTask;
    const int end_row = std::min(first_row + kRowsPerTask, rows.size());
    for (int y = first_row; y < end_row; ++y) {
      const Rgb* old_row = &image(0, rows.first + y);
      for (size_t channel = 0; channel < kNumChannels; ++channel) {
        for (size_t x = 0; x < old_width; ++x) line[x] = old_row[x][channel];
        ResizeLine(line.data(), taps, channel, &resized(0, y));
      }
    }
  });
  return resized;
}

RgbImage CopyRows(const RgbImage& image, const Range& rows) {
  RgbImage copy(image.width(), rows.size());
  std::copy_n(&image(0, rows.first), copy.size(), copy.data().begin());
  return copy;
}

// One row per element of `taps`.
RgbImage ResizeHeight(const RgbImage& image, const std::vector<Taps>& taps, int num_threads) {
  RgbImage resized(image.width(), static_cast<int>(taps.size()));
  ParallelFor(resized.height(), num_threads, [&](int64_t y) {
    const auto& [first, weights] = taps[static_cast<size_t>(y)];
    std::vector<int32_t> sums(static_cast<size_t>(image.width()) * kNumChannels);
    for (size_t k = 0; k < weights.size(); ++k) {
      const int32_t weight = weights[k];
      const uint8_t* old_row = image(0, first + static_cast<int>(k)).data();
      for (size_t x = 0; x < sums.size(); ++x) sums[x] += weight * old_row[x];
    }
    std::transform(sums.begin(), sums.end(), resized(0, static_cast<int>(y)).data(), RoundToByte);
  });
  return resized;
}

// The old rows that `taps` use.
Range UsedRows(const std::vector<Taps>& taps) {
  Range used = {std::numeric_limits<int>::max(), 0};
  for (const Taps& tap : taps) {
    used.first = std::min(used.first, tap.first);
    used.end = std::max(used.end, tap.first + static_cast<int>(tap.weights.size()));
  }
  return used;
}

void CheckSizes(const RgbImage& image, int width, int height) {
  constexpr int kMaxPixels = 1 << 30;
  VGTW_CHECK(!image.empty() && width > 0 && height > 0, "an image without pixels");
  VGTW_CHECK(image.width() / width < kMaxShrinking && image.height() / height < kMaxShrinking,
             "an axis shrinks too much");
  VGTW_CHECK(width <= kMaxPixels / std::max(height, image.height()), "the result is too large");
}

}  // namespace

RgbImage PilResize(const RgbImage& image, int width, int height, const PilResizeOptions& options) {
  CheckSizes(image, width, height);
  const int num_rows = options.num_rows == -1 ? height - options.first_row : options.num_rows;
  VGTW_CHECK(options.first_row >= 0 && num_rows > 0 && num_rows <= height - options.first_row,
             "the wanted rows do not exist");
  const Range wanted = {options.first_row, options.first_row + num_rows};

  const auto resize_width = [&](const Range& rows) {
    return width == image.width() ? CopyRows(image, rows)
                                  : ResizeWidth(image, width, rows, options);
  };
  if (height == image.height()) return resize_width(wanted);
  std::vector<Taps> taps = MakeTaps(image.height(), height, wanted, options.filter);
  const Range used = UsedRows(taps);
  for (Taps& tap : taps) tap.first -= used.first;
  return ResizeHeight(resize_width(used), taps, options.num_threads);
}

}  // namespace vgtw
