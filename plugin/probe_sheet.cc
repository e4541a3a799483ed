// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/probe_sheet.h"

#include "plugin/tile_sheet.h"
#include "scene/drawing.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vgtw {
namespace {

constexpr Rgb kQuery = {230, 30, 40};
constexpr Rgb kQueryRim = {255, 255, 255};
constexpr double kQueryRadiusPx = 4.0;
constexpr double kQueryRimPx = 2.0;

// Even steps of lightness, so that the order of values shows in gray too.
constexpr std::array<Rgb, 5> kRamp = {
    Rgb{10, 10, 70}, Rgb{90, 20, 130}, Rgb{200, 60, 90}, Rgb{250, 150, 40}, Rgb{255, 250, 150}};

Rgb RampColor(float share) {
  const float position = std::clamp(share, 0.0f, 1.0f) * static_cast<float>(kRamp.size() - 1);
  const size_t lower = std::min(static_cast<size_t>(position), kRamp.size() - 2);
  const float upper_weight = position - static_cast<float>(lower);
  Rgb color;
  for (size_t c = 0; c < 3; ++c) {
    color[c] = static_cast<uint8_t>(
        std::lround((1.0f - upper_weight) * static_cast<float>(kRamp[lower][c]) +
                    upper_weight * static_cast<float>(kRamp[lower + 1][c])));
  }
  return color;
}

// The ramp over the photo's lightness; what the network did not see stays gray.
RgbImage Overlay(const RgbImage& tile,
                 const PixelMap& patch_from_tile,
                 const Grid<float>& map,
                 const std::pair<float, float>& range) {
  const float span = std::max(range.second - range.first, 1e-12f);
  RgbImage overlay = tile;
  for (int y = 0; y < tile.height(); ++y) {
    for (int x = 0; x < tile.width(); ++x) {
      const Rgb& pixel = tile(x, y);
      const auto gray = static_cast<uint8_t>((pixel[0] + 2 * pixel[1] + pixel[2]) / 4);
      overlay(x, y) = {gray, gray, gray};
      const Eigen::Vector2d patch = Apply(patch_from_tile, Eigen::Vector2d(x + 0.5, y + 0.5));
      const int column = static_cast<int>(std::floor(patch.x()));
      const int row = static_cast<int>(std::floor(patch.y()));
      if (column < 0 || row < 0 || column >= map.width() || row >= map.height()) continue;
      const Rgb color = RampColor((map(column, row) - range.first) / span);
      for (size_t c = 0; c < 3; ++c) {
        overlay(x, y)[c] = static_cast<uint8_t>((gray + 3 * color[c]) / 4);
      }
    }
  }
  return overlay;
}

}  // namespace

std::pair<float, float> RangeOf(const std::vector<Grid<float>>& maps) {
  std::vector<double> values;
  for (const Grid<float>& map : maps)
    values.insert(values.end(), map.data().begin(), map.data().end());
  const double low = *std::min_element(values.begin(), values.end());
  return {static_cast<float>(low), static_cast<float>(Percentile(std::move(values), 99.5))};
}

RgbImage MakeProbeSheet(const std::vector<ProbePhoto>& photos,
                        const ProbeQuery& query,
                        const std::vector<ProbeColumn>& columns,
                        int tile_width) {
  std::vector<std::vector<Tile>> rows;
  for (size_t view = 0; view < photos.size(); ++view) {
    const ProbePhoto& photo = photos[view];
    const RgbImage tile = ResizeToWidth(photo.photo, tile_width);
    const double original_px_per_tile_px = double(photo.photo.width()) / tile_width;
    RgbImage marked = tile;
    if (view == query.view) {
      const Eigen::Vector2d centre = query.pixel_in_original / original_px_per_tile_px;
      DrawDisc(centre, kQueryRadiusPx + kQueryRimPx, kQueryRim, marked);
      DrawDisc(centre, kQueryRadiusPx, kQuery, marked);
    }
    std::vector<Tile>& row = rows.emplace_back();
    row.push_back({photo.name, std::move(marked)});
    PixelMap patch_from_tile = Inverse(photo.original_from_patch);
    patch_from_tile.leftCols<2>() *= original_px_per_tile_px;
    for (const ProbeColumn& column : columns) {
      VGTW_CHECK(column.maps->size() == photos.size() && column.captions.size() == photos.size(),
                 "a map and a caption per photo");
      row.push_back({column.captions[view],
                     Overlay(tile, patch_from_tile, (*column.maps)[view], column.range)});
    }
  }
  return MakeTileSheet(rows);
}

}  // namespace vgtw
