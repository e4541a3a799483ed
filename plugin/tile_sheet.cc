// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/tile_sheet.h"

#include "scene/drawing.h"
#include "scene/error.h"

#include <algorithm>

namespace vgtw {
namespace {

constexpr Rgb kBackground = {255, 255, 255};
constexpr Rgb kInk = {40, 40, 40};
constexpr int kMarginPx = 8;
constexpr int kCaptionPx = 24;
constexpr double kTextPx = 10.0;

struct RowSize {
  int width = kMarginPx;
  int height = 0;  // of the highest picture
};

RowSize SizeOf(const std::vector<Tile>& row) {
  RowSize size;
  for (const Tile& tile : row) {
    VGTW_CHECK(!tile.picture.empty(), "a tile has pixels");
    size.width += tile.picture.width() + kMarginPx;
    size.height = std::max(size.height, tile.picture.height());
  }
  return size;
}

RgbImage DrawCaption(const std::string& caption, int width) {
  RgbImage line(width, kCaptionPx, kBackground);
  DrawText(caption, 0, kCaptionPx - 8, kTextPx, kInk, line);
  return line;
}

}  // namespace

RgbImage MakeTileSheet(const std::vector<std::vector<Tile>>& rows) {
  int width = kMarginPx;
  int height = kMarginPx;
  for (const std::vector<Tile>& row : rows) {
    const RowSize size = SizeOf(row);
    width = std::max(width, size.width);
    height += kCaptionPx + size.height + kMarginPx;
  }
  RgbImage sheet(width, height, kBackground);
  int y = kMarginPx;
  for (const std::vector<Tile>& row : rows) {
    int x = kMarginPx;
    for (const Tile& tile : row) {
      Paste(DrawCaption(tile.caption, tile.picture.width()), x, y, sheet);
      Paste(tile.picture, x, y + kCaptionPx, sheet);
      x += tile.picture.width() + kMarginPx;
    }
    y += kCaptionPx + SizeOf(row).height + kMarginPx;
  }
  return sheet;
}

}  // namespace vgtw
