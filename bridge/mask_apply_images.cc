// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_apply_images.h"

#include "bridge/colmap_rows.h"
#include "bridge/mask_files.h"
#include "bridge/sqlite.h"
#include "scene/distractor_mask.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cstring>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// Where a keypoint is and how far it looks.
struct Spot {
  float x = 0.0f;
  float y = 0.0f;
  float scale = 0.0f;
};

// Only sizes of cameras are read, so that models of COLMAP that Camera does not know do no harm.
std::vector<MaskedImage> ReadImages(SqliteConnection& connection) {
  std::vector<MaskedImage> images;
  SqliteQuery query(connection,
                    "SELECT images.image_id, images.name, cameras.width, cameras.height "
                    "FROM images LEFT JOIN cameras ON cameras.camera_id = images.camera_id "
                    "ORDER BY CAST(images.name AS BLOB)");
  while (query.Next()) {
    MaskedImage image;
    image.image_id = CheckedId(query, 0, "image");
    image.summary.image_name = query.Text(1);
    if (!IsSafeRelativeName(image.summary.image_name)) {
      Fail(query.path(),
           "names an image '" + Printable(image.summary.image_name) + "'",
           "a relative path with '/' inside the image folder");
    }
    if (query.IsNull(2)) {
      Fail(
          query.path(), "has an image without a camera: " + image.summary.image_name, "one camera");
    }
    image.width = static_cast<uint64_t>(query.Int(2));
    image.height = static_cast<uint64_t>(query.Int(3));
    images.push_back(std::move(image));
  }
  return images;
}

void FindMasks(const fs::path& mask_folder, bool allow_missing, std::vector<MaskedImage>& images) {
  std::vector<std::string> names;
  for (const MaskedImage& image : images) names.push_back(image.summary.image_name);
  CheckMasksExist(mask_folder, names, allow_missing);
  for (MaskedImage& image : images) {
    image.summary.has_mask = fs::exists(MaskPath(mask_folder, image.summary.image_name));
  }
}

std::vector<Spot> ReadSpots(SqliteConnection& connection, ImageId image_id, bool needs_scale) {
  SqliteQuery query(
      connection, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?", image_id);
  if (!query.Next()) return {};
  const MatrixBlob blob = ReadKeypointsBlob(query, 0, image_id);
  if (needs_scale && blob.rows > 0 && blob.cols == 2) {
    Fail(query.path(),
         "keypoints of image " + std::to_string(image_id) + " have no scale (2 columns)",
         "4 or 6 columns to dilate by",
         "use --dilate_px instead of --dilate_scale");
  }
  std::vector<Spot> spots(blob.rows);
  std::array<float, 6> row = {};
  const size_t row_bytes = blob.cols * sizeof(float);
  for (size_t i = 0; i < spots.size(); ++i) {
    std::memcpy(row.data(), blob.bytes.data() + i * row_bytes, row_bytes);
    spots[i] = {row[0], row[1], needs_scale ? KeypointScale(row.data(), blob.cols) : 0.0f};
  }
  return spots;
}

void TestKeypoints(const fs::path& mask_folder,
                   const std::vector<Spot>& spots,
                   const ApplyMasksOptions& options,
                   MaskedImage& image) {
  image.summary.num_keypoints = spots.size();
  image.is_excluded.assign(spots.size(), false);
  if (!image.summary.has_mask) return;
  // Any value but 0 is kept; to make it 255 first would be a pass over all pixels for nothing.
  const GrayImage static_mask = ReadMaskValuesOfSize(
      MaskPath(mask_folder, image.summary.image_name), {image.width, image.height});
  const bool dilates = options.dilate_px > 0 || options.dilate_scale > 0.0;
  const Grid<float> distance = dilates ? DistanceToExcluded(static_mask) : Grid<float>();
  for (size_t i = 0; i < spots.size(); ++i) {
    const auto& [x, y, scale] = spots[i];
    image.is_excluded[i] =
        IsExcluded(static_mask, x, y) ||
        (dilates && distance(static_cast<int>(x), static_cast<int>(y)) <=
                        options.dilate_px + options.dilate_scale * static_cast<double>(scale));
  }
  image.summary.num_excluded_keypoints =
      static_cast<uint64_t>(std::count(image.is_excluded.begin(), image.is_excluded.end(), true));
}

}  // namespace

MaskedImagesById ById(const std::vector<MaskedImage>& images) {
  MaskedImagesById by_id;
  for (const MaskedImage& image : images) by_id[image.image_id] = &image;
  return by_id;
}

std::vector<MaskedImage> MaskImages(SqliteConnection& connection,
                                    const fs::path& mask_folder,
                                    const ApplyMasksOptions& options,
                                    ProgressCounter& progress) {
  constexpr size_t kBatchSize = 64;
  std::vector<MaskedImage> images = ReadImages(connection);
  if (!mask_folder.empty()) FindMasks(mask_folder, options.allow_missing_masks, images);
  for (size_t begin = 0; begin < images.size(); begin += kBatchSize) {
    const size_t size = std::min(kBatchSize, images.size() - begin);
    std::vector<std::vector<Spot>> spots;
    for (size_t i = 0; i < size; ++i) {
      spots.push_back(
          ReadSpots(connection, images[begin + i].image_id, options.dilate_scale > 0.0));
    }
    ParallelFor(static_cast<int64_t>(size), options.num_threads, [&](int64_t i) {
      const auto idx = static_cast<size_t>(i);
      TestKeypoints(mask_folder, spots[idx], options, images[begin + idx]);
    });
    progress.Advance(static_cast<int64_t>(size));
  }
  return images;
}

std::vector<uint32_t> RenumberedIndices(const std::vector<bool>& is_excluded) {
  std::vector<uint32_t> indices(is_excluded.size(), kRemovedIdx);
  uint32_t num_kept = 0;
  for (size_t i = 0; i < is_excluded.size(); ++i) {
    if (!is_excluded[i]) indices[i] = num_kept++;
  }
  return indices;
}

}  // namespace vgtw
