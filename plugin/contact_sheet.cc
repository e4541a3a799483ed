// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/contact_sheet.h"

#include "plugin/tile_sheet.h"
#include "scene/drawing.h"
#include "scene/error.h"

namespace vgtw {
namespace {

constexpr Rgb kKept = {30, 200, 60};
constexpr Rgb kDropped = {230, 30, 40};

RgbImage TintExcluded(const RgbImage& photo, const StaticMask& static_mask) {
  RgbImage tinted = photo;
  for (int y = 0; y < photo.height(); ++y) {
    for (int x = 0; x < photo.width(); ++x) {
      if (static_mask(x, y) != 0) continue;
      for (size_t c = 0; c < 3; ++c) {
        tinted(x, y)[c] = static_cast<uint8_t>((photo(x, y)[c] + 2 * kDropped[c]) / 3);
      }
    }
  }
  return tinted;
}

// The photo, faded so that the marks stand out.
RgbImage Faded(const RgbImage& photo) {
  RgbImage faded = photo;
  for (Rgb& pixel : faded.data()) {
    for (uint8_t& value : pixel) value = static_cast<uint8_t>(128 + value / 2);
  }
  return faded;
}

void DrawFeatures(const std::vector<Eigen::Vector2d>& features,
                  double scale,
                  const Rgb& color,
                  RgbImage& tile) {
  for (const Eigen::Vector2d& feature : features) DrawDisc(feature * scale, 1.6, color, tile);
}

}  // namespace

RgbImage MakeContactSheet(const std::vector<ContactSheetRow>& rows, int tile_width) {
  std::vector<std::vector<Tile>> tiles;
  for (const ContactSheetRow& row : rows) {
    VGTW_CHECK(row.static_mask.width() == row.photo.width() &&
                   row.static_mask.height() == row.photo.height(),
               "mask has the photo's size");
    const RgbImage photo = ResizeToWidth(row.photo, tile_width);
    RgbImage features = Faded(photo);
    const double scale = double(tile_width) / double(row.photo.width());
    DrawFeatures(row.kept_features, scale, kKept, features);
    DrawFeatures(row.dropped_features, scale, kDropped, features);
    tiles.push_back({{row.name, photo},
                     {"excluded by the mask",
                      ResizeToWidth(TintExcluded(row.photo, row.static_mask), tile_width)},
                     {std::to_string(row.kept_features.size()) + " features kept, " +
                          std::to_string(row.dropped_features.size()) + " dropped",
                      features}});
  }
  return MakeTileSheet(tiles);
}

}  // namespace vgtw
