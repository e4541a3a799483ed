// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_apply.h"

#include "bridge/colmap_rows.h"
#include "bridge/colmap_schema.h"
#include "bridge/mask_files.h"
#include "bridge/sqlite.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <unordered_map>

#include <Eigen/Core>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// One image of the database with what its mask says.
struct MaskedImage {
  ImageId image_id = 0;
  uint64_t width = 0;
  uint64_t height = 0;
  std::vector<bool> is_excluded;  // per keypoint
  ApplyMasksImageSummary summary;
};

using MaskedImages = std::unordered_map<ImageId, const MaskedImage*>;
using KeypointPositions = std::vector<Eigen::Vector2f>;

// Counts the units of work of all stages together.
class ProgressCounter {
 public:
  ProgressCounter(ProgressCallback callback, int64_t total)
      : callback_(std::move(callback)), total_(total) {}
  void Advance(int64_t units) {
    done_ += units;
    if (callback_) callback_(done_, total_);
  }

 private:
  ProgressCallback callback_;
  int64_t total_ = 0;
  int64_t done_ = 0;
};

int64_t CountUnits(SqliteConnection& connection) {
  SqliteQuery query(connection,
                    "SELECT (SELECT count(*) FROM images) + (SELECT count(*) FROM matches) + "
                    "(SELECT count(*) FROM two_view_geometries)");
  return query.Next() ? query.Int(0) : 0;
}

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
  if (!fs::is_directory(mask_folder)) {
    Fail(mask_folder, "is not a folder", "masks named <image name>.png");
  }
  fs::path first_missing;
  size_t num_missing = 0;
  for (MaskedImage& image : images) {
    const fs::path path = MaskPath(mask_folder, image.summary.image_name);
    image.summary.has_mask = fs::exists(path);
    if (image.summary.has_mask) continue;
    if (num_missing++ == 0) first_missing = path;
  }
  if (num_missing == 0 || allow_missing) return;
  Fail(first_missing,
       "is missing (" + std::to_string(num_missing) + " of " + std::to_string(images.size()) +
           " images have no mask)",
       "one mask per image",
       "write all-white ones, or allow missing masks");
}

KeypointPositions ReadPositions(SqliteConnection& connection, ImageId image_id) {
  SqliteQuery query(
      connection, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?", image_id);
  if (!query.Next()) return {};
  const MatrixBlob blob = ReadKeypointsBlob(query, 0, image_id);
  KeypointPositions positions(blob.rows);
  const size_t row_bytes = blob.cols * sizeof(float);
  for (size_t row = 0; row < positions.size(); ++row) {
    std::memcpy(positions[row].data(), blob.bytes.data() + row * row_bytes, 2 * sizeof(float));
  }
  return positions;
}

void TestKeypoints(const fs::path& mask_folder,
                   const KeypointPositions& positions,
                   MaskedImage& image) {
  image.summary.num_keypoints = positions.size();
  image.is_excluded.assign(positions.size(), false);
  if (!image.summary.has_mask) return;
  const StaticMask static_mask =
      ReadMaskOfSize(MaskPath(mask_folder, image.summary.image_name), {image.width, image.height});
  for (size_t i = 0; i < positions.size(); ++i) {
    image.is_excluded[i] = IsExcluded(static_mask, positions[i].x(), positions[i].y());
  }
  image.summary.num_excluded_keypoints =
      static_cast<uint64_t>(std::count(image.is_excluded.begin(), image.is_excluded.end(), true));
}

// Images sorted by name. Masks are decoded in parallel, a batch at a time to bound the memory.
std::vector<MaskedImage> MaskImages(SqliteConnection& connection,
                                    const fs::path& mask_folder,
                                    const ApplyMasksOptions& options,
                                    ProgressCounter& progress) {
  constexpr size_t kBatchSize = 64;
  std::vector<MaskedImage> images = ReadImages(connection);
  if (!mask_folder.empty()) FindMasks(mask_folder, options.allow_missing_masks, images);
  for (size_t begin = 0; begin < images.size(); begin += kBatchSize) {
    const size_t size = std::min(kBatchSize, images.size() - begin);
    std::vector<KeypointPositions> positions;
    for (size_t i = 0; i < size; ++i) {
      positions.push_back(ReadPositions(connection, images[begin + i].image_id));
    }
    ParallelFor(static_cast<int64_t>(size), options.num_threads, [&](int64_t i) {
      const auto idx = static_cast<size_t>(i);
      TestKeypoints(mask_folder, positions[idx], images[begin + idx]);
    });
    progress.Advance(static_cast<int64_t>(size));
  }
  return images;
}

// A table of matched keypoints. An emptied geometry becomes what COLMAP stores for a pair without
// one (configuration 0), else the geometry stays.
struct PairTable {
  const char* name;
  const char* select_next;
  const char* update;
};
constexpr PairTable kMatches = {
    "matches",
    "SELECT pair_id, rows, cols, data FROM matches WHERE pair_id > ? ORDER BY pair_id LIMIT 1",
    "UPDATE matches SET rows = ?1, data = ?2 WHERE pair_id = ?3"};
constexpr PairTable kTwoViewGeometries = {
    "two-view geometry",
    "SELECT pair_id, rows, cols, data FROM two_view_geometries WHERE pair_id > ? "
    "ORDER BY pair_id LIMIT 1",
    "UPDATE two_view_geometries SET rows = ?1, data = ?2, "
    "config = CASE ?1 WHEN 0 THEN 0 ELSE config END WHERE pair_id = ?3"};

struct Pair {
  int64_t pair_id = 0;
  std::string name;
  const MaskedImage* image1 = nullptr;
  const MaskedImage* image2 = nullptr;
  FeatureMatches matches;
};

std::optional<Pair> ReadNextPair(SqliteConnection& connection,
                                 const PairTable& table,
                                 int64_t previous_pair_id,
                                 const MaskedImages& images) {
  SqliteQuery query(connection, table.select_next, previous_pair_id);
  if (!query.Next()) return std::nullopt;
  Pair pair;
  pair.pair_id = query.Int(0);
  const auto [image_id1, image_id2] = CheckedImageIds(query, pair.pair_id);
  pair.name = std::string(table.name) + " of images " + std::to_string(image_id1) + " and " +
              std::to_string(image_id2);
  const auto find = [&](ImageId image_id) {
    const auto found = images.find(image_id);
    if (found == images.end()) {
      Fail(query.path(), pair.name + ": no image " + std::to_string(image_id), "both images");
    }
    return found->second;
  };
  pair.image1 = find(image_id1);
  pair.image2 = find(image_id2);
  pair.matches = ReadMatchesBlob(query, 1, pair.name);
  return pair;
}

void RemoveExcluded(const fs::path& path, Pair& pair) {
  const auto is_excluded = [&](const MaskedImage& image, uint32_t point2D_idx) {
    if (point2D_idx >= image.is_excluded.size()) {
      Fail(path,
           pair.name + ": keypoint " + std::to_string(point2D_idx) + " of '" +
               image.summary.image_name + "'",
           "less than its " + std::to_string(image.is_excluded.size()) + " keypoints");
    }
    return image.is_excluded[point2D_idx];
  };
  std::erase_if(pair.matches, [&](const std::array<uint32_t, 2>& match) {
    const bool is_excluded1 = is_excluded(*pair.image1, match[0]);
    return is_excluded(*pair.image2, match[1]) || is_excluded1;
  });
}

struct Counts {
  uint64_t before = 0;
  uint64_t after = 0;
};

Counts FilterTable(SqliteConnection& connection,
                   const PairTable& table,
                   const MaskedImages& images,
                   ProgressCounter& progress) {
  Counts counts;
  int64_t pair_id = std::numeric_limits<int64_t>::min();
  while (auto pair = ReadNextPair(connection, table, pair_id, images)) {
    pair_id = pair->pair_id;
    const size_t num_before = pair->matches.size();
    RemoveExcluded(connection.path(), *pair);
    const size_t num_after = pair->matches.size();
    if (num_after < num_before) {
      connection.Execute(table.update, num_after, AsBlob(pair->matches), pair_id);
    }
    counts.before += num_before;
    counts.after += num_after;
    progress.Advance(1);
  }
  return counts;
}

ApplyMasksSummary FilterPairs(SqliteConnection& connection,
                              const std::vector<MaskedImage>& masked_images,
                              ProgressCounter& progress) {
  MaskedImages images;
  ApplyMasksSummary summary;
  for (const MaskedImage& image : masked_images) {
    images[image.image_id] = &image;
    summary.images.push_back(image.summary);
  }
  const Counts matches = FilterTable(connection, kMatches, images, progress);
  const Counts inliers = FilterTable(connection, kTwoViewGeometries, images, progress);
  summary.num_matches_before = matches.before;
  summary.num_matches_after = matches.after;
  summary.num_inlier_matches_before = inliers.before;
  summary.num_inlier_matches_after = inliers.after;
  return summary;
}

// The database is locked from the first look at its keypoints on.
ApplyMasksSummary ApplyInPlace(const fs::path& database_path,
                               const fs::path& mask_folder,
                               const ApplyMasksOptions& options,
                               const ProgressCallback& callback) {
  SqliteConnection connection(database_path, SqliteConnection::Mode::kReadWrite);
  RecogniseSchema(connection);
  SqliteTransaction transaction(connection);
  ProgressCounter progress(callback, CountUnits(connection));
  const auto images = MaskImages(connection, mask_folder, options, progress);
  const ApplyMasksSummary summary = FilterPairs(connection, images, progress);
  transaction.Commit();
  return summary;
}

ApplyMasksSummary ApplyToCopy(const fs::path& database_path,
                              const fs::path& mask_folder,
                              const fs::path& output_path,
                              const ApplyMasksOptions& options,
                              const ProgressCallback& callback) {
  SqliteConnection source(database_path, SqliteConnection::Mode::kReadOnly);
  RecogniseSchema(source);
  const SqliteTransaction snapshot(source);
  ProgressCounter progress(callback, CountUnits(source));
  const auto images = MaskImages(source, mask_folder, options, progress);

  AtomicDatabase file(output_path, options.overwrite);
  source.CopyTo(file.path());
  ApplyMasksSummary summary;
  {
    SqliteConnection copy(file.path(), SqliteConnection::Mode::kPrivate);
    SqliteTransaction transaction(copy);
    summary = FilterPairs(copy, images, progress);
    transaction.Commit();
  }
  file.Commit();
  return summary;
}

bool IsSameFile(const fs::path& a, const fs::path& b) {
  std::error_code code;
  return fs::equivalent(a, b, code) && !code;
}

}  // namespace

ApplyMasksSummary ApplyMasks(const fs::path& database_path,
                             const fs::path& mask_folder,
                             const fs::path& output_path,
                             const ApplyMasksOptions& options,
                             const ProgressCallback& progress) {
  VGTW_CHECK(!mask_folder.empty(), "masks need a folder");
  const bool is_same = IsSameFile(database_path, output_path);
  if (options.in_place) {
    VGTW_CHECK(output_path.empty() || is_same, "in_place writes to database_path alone");
    return ApplyInPlace(database_path, mask_folder, options, progress);
  }
  if (is_same) {
    Fail(output_path, "is the database to be read", "another file", "or ask for in-place changes");
  }
  return ApplyToCopy(database_path, mask_folder, output_path, options, progress);
}

std::vector<ApplyMasksImageSummary> CountExcludedKeypoints(const fs::path& database_path,
                                                           const fs::path& mask_folder,
                                                           int num_threads) {
  SqliteConnection connection(database_path, SqliteConnection::Mode::kReadOnly);
  RecogniseSchema(connection);
  const SqliteTransaction snapshot(connection);
  const ApplyMasksOptions options{.allow_missing_masks = true, .num_threads = num_threads};
  ProgressCounter progress({}, 0);
  std::vector<ApplyMasksImageSummary> summaries;
  for (MaskedImage& image : MaskImages(connection, mask_folder, options, progress)) {
    summaries.push_back(std::move(image.summary));
  }
  return summaries;
}

}  // namespace vgtw
