// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/mask_preview.h"

#include "bridge/mask_files.h"
#include "plugin/table.h"
#include "plugin/tile_sheet.h"
#include "scene/drawing.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr Rgb kExcluded = {235, 0, 190};  // magenta: few things are
constexpr Rgb kLine = {255, 255, 255};

StaticMask ResizeNearest(const StaticMask& mask, int width, int height) {
  StaticMask resized(width, height);
  for (int y = 0; y < height; ++y) {
    const auto source_y = static_cast<int>((y + 0.5) * mask.height() / height);
    for (int x = 0; x < width; ++x) {
      resized(x, y) = mask(static_cast<int>((x + 0.5) * mask.width() / width), source_y);
    }
  }
  return resized;
}

bool TouchesKept(const StaticMask& mask, int x, int y) {
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i) {
      if (mask.Contains(x + i, y + j) && mask(x + i, y + j) != 0) return true;
    }
  }
  return false;
}

std::vector<fs::path> PagePaths(const fs::path& output_path, size_t num_pages) {
  if (num_pages == 1) return {output_path};
  std::vector<fs::path> pages;
  const size_t num_digits = std::to_string(num_pages).size();
  for (size_t i = 1; i <= num_pages; ++i) {
    std::string number = std::to_string(i);
    number.insert(0, num_digits - number.size(), '0');
    fs::path name = output_path.stem();
    name += "_" + number + output_path.extension().string();
    pages.push_back(output_path.parent_path() / name);
  }
  return pages;
}

void CheckPages(const std::vector<fs::path>& pages, bool overwrite) {
  for (const fs::path& page : pages) {
    if (!overwrite && fs::exists(page)) {
      Fail(page, "exists", "a new file", "name another or add --overwrite");
    }
  }
}

// The tile, and what `image` tells of it.
Tile DrawTile(const fs::path& image_folder,
              const fs::path& mask_folder,
              int width,
              PreviewedMask& image) {
  const RgbImage photo = ReadRgbImage(image_folder / image.image_name);
  const fs::path path = MaskPath(mask_folder, image.image_name);
  image.has_mask = fs::exists(path);
  if (!image.has_mask) {
    return {"no mask  " + image.image_name, ResizeToWidth(photo, width)};
  }
  const ImageSize size = {static_cast<uint64_t>(photo.width()),
                          static_cast<uint64_t>(photo.height())};
  const StaticMask mask = ReadMaskOfSize(path, size);
  image.excluded_share = ExcludedShare(mask);
  return {FormatNumber(100.0 * image.excluded_share, 1) + " % excluded  " + image.image_name,
          DrawMaskOverlay(photo, mask, width)};
}

}  // namespace

void MaskPreviewOptions::Check() const {
  const auto check = [](int value, const std::string& name) {
    VGTW_CHECK(value > 0,
               "MaskPreviewOptions::" + name + " = " + std::to_string(value) + ", must be > 0");
  };
  check(num_columns, "num_columns");
  check(num_rows, "num_rows");
  check(tile_width_px, "tile_width_px");
  constexpr int64_t kMaxWidthPx = 30000;  // JPEG ends at 65535; a page is as high as wide, or more
  VGTW_CHECK(int64_t{num_columns} * tile_width_px <= kMaxWidthPx &&
                 int64_t{num_rows} * tile_width_px <= kMaxWidthPx,
             "MaskPreviewOptions: a page is larger than 30000 pixels");
}

RgbImage DrawMaskOverlay(const RgbImage& photo, const StaticMask& static_mask, int width) {
  VGTW_CHECK(static_mask.width() == photo.width() && static_mask.height() == photo.height(),
             "mask has the photo's size");
  RgbImage overlay = ResizeToWidth(photo, width);
  const StaticMask mask = ResizeNearest(static_mask, overlay.width(), overlay.height());
  for (int y = 0; y < overlay.height(); ++y) {
    for (int x = 0; x < overlay.width(); ++x) {
      if (mask(x, y) != 0) continue;
      Rgb& pixel = overlay(x, y);
      if (TouchesKept(mask, x, y)) {
        pixel = kLine;
        continue;
      }
      for (size_t c = 0; c < 3; ++c) {
        pixel[c] = static_cast<uint8_t>((pixel[c] + kExcluded[c]) / 2);
      }
    }
  }
  return overlay;
}

MaskPreview WriteMaskPreview(const fs::path& image_folder,
                             const fs::path& mask_folder,
                             const fs::path& output_path,
                             const MaskPreviewOptions& options,
                             const ProgressCallback& progress) {
  options.Check();
  CheckMasksExist(mask_folder, {}, /*allow_missing=*/true);
  MaskPreview preview;
  for (const std::string& name : ListImages(image_folder)) {
    preview.images.push_back({.image_name = name});
  }
  const auto num_columns = static_cast<size_t>(options.num_columns);
  const size_t page_size = num_columns * static_cast<size_t>(options.num_rows);
  const size_t num_images = preview.images.size();
  preview.pages = PagePaths(output_path, (num_images + page_size - 1) / page_size);
  CheckPages(preview.pages, options.overwrite);
  for (size_t page = 0; page < preview.pages.size(); ++page) {
    const size_t first = page * page_size;
    std::vector<Tile> tiles(std::min(page_size, num_images - first));
    const auto draw = [&](int64_t i) {
      const auto idx = static_cast<size_t>(i);
      tiles[idx] =
          DrawTile(image_folder, mask_folder, options.tile_width_px, preview.images[first + idx]);
    };
    const auto show = [&](int64_t done, int64_t) {
      if (progress) progress(static_cast<int64_t>(first) + done, static_cast<int64_t>(num_images));
    };
    ParallelFor(static_cast<int64_t>(tiles.size()), options.num_threads, draw, show);
    std::vector<std::vector<Tile>> rows((tiles.size() + num_columns - 1) / num_columns);
    for (size_t i = 0; i < tiles.size(); ++i) {
      rows[i / num_columns].push_back(std::move(tiles[i]));
    }
    WriteImage(preview.pages[page], MakeTileSheet(rows));
  }
  return preview;
}

}  // namespace vgtw
