// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_apply_rules.h"

#include "bridge/colmap_rows.h"
#include "bridge/mask_undo.h"
#include "bridge/sqlite.h"
#include "scene/disjoint_sets.h"
#include "scene/error.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <string>

namespace vgtw {
namespace {

using ImageIndexById = std::unordered_map<ImageId, size_t>;

// One row of matches or two-view geometries.
struct Pair {
  int64_t pair_id = 0;
  size_t image_idx1 = 0;
  size_t image_idx2 = 0;
  int64_t config = 0;      // of a geometry
  FeatureMatches matches;  // every index is one of a keypoint
};

// Reads the pairs of a table in their order. A pair may be changed once it was read: it keeps its
// place in that order.
class PairReader {
 public:
  PairReader(SqliteConnection& connection,
             const MaskedTable& table,
             const std::vector<MaskedImage>& images)
      : connection_(connection),
        table_(table),
        images_(images),
        query_(connection,
               MaskedTableSql("SELECT pair_id, rows, cols, data, {config} FROM {table} AS t "
                              "ORDER BY pair_id",
                              table)) {
    for (size_t i = 0; i < images.size(); ++i) image_idx_by_id_[images[i].image_id] = i;
  }

  std::optional<Pair> Next() {
    if (!query_.Next()) return std::nullopt;
    Pair pair;
    pair.pair_id = query_.Int(0);
    pair.config = query_.Int(4);
    const auto [image_id1, image_id2] = CheckedImageIds(query_, pair.pair_id);
    const std::string name = std::string(table_.row_label) + " of images " +
                             std::to_string(image_id1) + " and " + std::to_string(image_id2);
    pair.image_idx1 = FindImage(image_id1, name);
    pair.image_idx2 = FindImage(image_id2, name);
    pair.matches = ReadMatchesBlob(query_, 1, name);
    std::array<uint32_t, 2> largest = {0, 0};
    for (const auto& [point2D_idx1, point2D_idx2] : pair.matches) {
      largest = {std::max(largest[0], point2D_idx1), std::max(largest[1], point2D_idx2)};
    }
    if (!pair.matches.empty()) {
      CheckIndex(pair.image_idx1, largest[0], name);
      CheckIndex(pair.image_idx2, largest[1], name);
    }
    return pair;
  }

 private:
  size_t FindImage(ImageId image_id, const std::string& name) const {
    const auto found = image_idx_by_id_.find(image_id);
    if (found == image_idx_by_id_.end()) {
      Fail(connection_.path(), name + ": no image " + std::to_string(image_id), "both images");
    }
    return found->second;
  }

  void CheckIndex(size_t image_idx, uint32_t point2D_idx, const std::string& name) const {
    const MaskedImage& image = images_[image_idx];
    if (point2D_idx < image.is_excluded.size()) return;
    Fail(connection_.path(),
         name + ": keypoint " + std::to_string(point2D_idx) + " of '" + image.summary.image_name +
             "'",
         "less than its " + std::to_string(image.is_excluded.size()) + " keypoints");
  }

  SqliteConnection& connection_;
  const MaskedTable& table_;
  const std::vector<MaskedImage>& images_;
  SqliteQuery query_;
  ImageIndexById image_idx_by_id_;
};

// The connected components of all keypoints under links between two of them.
class Tracks {
 public:
  explicit Tracks(const std::vector<MaskedImage>& images, const std::filesystem::path& path) {
    uint64_t num_keypoints = 0;
    for (const MaskedImage& image : images) {
      first_.push_back(static_cast<uint32_t>(num_keypoints));
      num_keypoints += image.is_excluded.size();
      if (num_keypoints > std::numeric_limits<uint32_t>::max()) {
        Fail(path, "has more than 4294967295 keypoints", "less", "use another --rule");
      }
    }
    sets_ = DisjointSets<uint32_t>(num_keypoints);
  }

  void Link(size_t image_idx1, uint32_t idx1, size_t image_idx2, uint32_t idx2) {
    sets_.Join(first_[image_idx1] + idx1, first_[image_idx2] + idx2);
  }

  // One keypoint that stands for all of a track.
  uint32_t Root(size_t image_idx, uint32_t idx) { return sets_.Find(first_[image_idx] + idx); }

  size_t num_keypoints() const { return sets_.num_elements(); }

 private:
  std::vector<uint32_t> first_;  // per image, its first keypoint among all
  DisjointSets<uint32_t> sets_{0};
};

template <typename Visit>
void ForEachKeypoint(const std::vector<MaskedImage>& images, const Visit& visit) {
  for (size_t i = 0; i < images.size(); ++i) {
    for (size_t idx = 0; idx < images[i].is_excluded.size(); ++idx) {
      visit(i, static_cast<uint32_t>(idx));
    }
  }
}

// Rewrites the row of an image in `table` without its excluded keypoints.
void RemoveRows(SqliteConnection& connection,
                const MaskedTable& table,
                const MaskedImage& image,
                MaskUndo& undo) {
  std::vector<std::byte> original;
  std::vector<std::byte> kept;
  size_t num_kept = 0;
  {
    SqliteQuery query(
        connection,
        MaskedTableSql("SELECT rows, cols, data FROM {table} WHERE {row_id} = ?", table),
        image.image_id);
    if (!query.Next()) return;
    const std::string owner =
        std::string(table.row_label) + " of image " + std::to_string(image.image_id);
    const MatrixBlob blob = ReadMatrixBlob(query, 0, table.bytes_per_value, owner);
    if (blob.rows == 0) return;  // features without descriptors
    if (blob.rows != image.is_excluded.size()) {
      Fail(connection.path(),
           owner + " has " + std::to_string(blob.rows) + " rows",
           "one per keypoint, " + std::to_string(image.is_excluded.size()));
    }
    original.assign(blob.bytes.begin(), blob.bytes.end());
    const size_t row_bytes = blob.cols * table.bytes_per_value;
    kept.reserve(blob.bytes.size());
    for (size_t row = 0; row < blob.rows; ++row) {
      if (image.is_excluded[row]) continue;
      const auto bytes = blob.bytes.subspan(row * row_bytes, row_bytes);
      kept.insert(kept.end(), bytes.begin(), bytes.end());
      ++num_kept;
    }
  }
  const MaskedRow row = {image.is_excluded.size(), original};
  undo.Rewrite(table, image.image_id, row, num_kept, kept);
}

struct Counts {
  uint64_t before = 0;
  uint64_t after = 0;
};

// How the matches of a table change.
class PairFilter {
 public:
  PairFilter(const std::vector<MaskedImage>& images, bool renumber, uint64_t min_num_rows)
      : images_(images), min_num_rows_(min_num_rows) {
    if (!renumber) return;
    for (const MaskedImage& image : images) {
      new_indices_.push_back(RenumberedIndices(image.is_excluded));
    }
  }

  // What remains of the pair's matches.
  FeatureMatches Filter(const Pair& pair) const {
    const std::vector<bool>& is_excluded1 = images_[pair.image_idx1].is_excluded;
    const std::vector<bool>& is_excluded2 = images_[pair.image_idx2].is_excluded;
    FeatureMatches kept;
    kept.reserve(pair.matches.size());
    for (const auto& match : pair.matches) {
      if (!is_excluded1[match[0]] && !is_excluded2[match[1]]) kept.push_back(match);
    }
    if (kept.size() < pair.matches.size() && kept.size() < min_num_rows_) kept.clear();
    if (new_indices_.empty()) return kept;
    for (auto& [idx1, idx2] : kept) {
      idx1 = new_indices_[pair.image_idx1][idx1];
      idx2 = new_indices_[pair.image_idx2][idx2];
    }
    return kept;
  }

 private:
  const std::vector<MaskedImage>& images_;
  uint64_t min_num_rows_;
  std::vector<std::vector<uint32_t>> new_indices_;
};

// Counts rows; calls visit(pair, kept) for each pair.
template <typename Visit>
Counts FilterTable(SqliteConnection& connection,
                   const MaskedTable& table,
                   const std::vector<MaskedImage>& images,
                   const PairFilter& filter,
                   MaskUndo& undo,
                   const Visit& visit) {
  Counts counts;
  PairReader reader(connection, table, images);
  while (const auto pair = reader.Next()) {
    const FeatureMatches kept = filter.Filter(*pair);
    if (kept != pair->matches) {
      const MaskedRow original = {pair->matches.size(), AsBlob(pair->matches), pair->config};
      undo.Rewrite(table, pair->pair_id, original, kept.size(), AsBlob(kept));
    }
    counts.before += pair->matches.size();
    counts.after += kept.size();
    visit(*pair, kept);
  }
  return counts;
}

}  // namespace

uint64_t ExcludeTracks(SqliteConnection& connection,
                       std::vector<MaskedImage>& images,
                       ProgressCounter& progress) {
  Tracks tracks(images, connection.path());
  PairReader reader(connection, kTwoViewTable, images);
  while (const auto pair = reader.Next()) {
    for (const auto& [idx1, idx2] : pair->matches) {
      tracks.Link(pair->image_idx1, idx1, pair->image_idx2, idx2);
    }
    progress.Advance(1);
  }
  std::vector<bool> is_excluded_root(tracks.num_keypoints(), false);
  ForEachKeypoint(images, [&](size_t image_idx, uint32_t idx) {
    if (images[image_idx].is_excluded[idx]) is_excluded_root[tracks.Root(image_idx, idx)] = true;
  });
  uint64_t num_linked = 0;
  ForEachKeypoint(images, [&](size_t image_idx, uint32_t idx) {
    auto is_excluded = images[image_idx].is_excluded[idx];
    if (is_excluded || !is_excluded_root[tracks.Root(image_idx, idx)]) return;
    is_excluded = true;
    ++num_linked;
  });
  return num_linked;
}

void RemoveKeypoints(SqliteConnection& connection,
                     const std::vector<MaskedImage>& images,
                     MaskUndo& undo,
                     ProgressCounter& progress) {
  for (const MaskedImage& image : images) {
    if (image.summary.num_excluded_keypoints > 0) {
      RemoveRows(connection, kKeypointsTable, image, undo);
      RemoveRows(connection, kDescriptorsTable, image, undo);
    }
    progress.Advance(1);
  }
}

void FilterPairs(SqliteConnection& connection,
                 const FilterPairsOptions& options,
                 MaskUndo& undo,
                 ProgressCounter& progress,
                 std::vector<MaskedImage>& images,
                 ApplyMasksSummary& summary) {
  const auto filter = [&](const MaskedTable& table, uint64_t min_num_rows, const auto& visit) {
    const PairFilter pair_filter(images, options.renumber, min_num_rows);
    return FilterTable(connection, table, images, pair_filter, undo, visit);
  };
  const Counts matches =
      filter(kMatchesTable, 0, [&](const Pair&, const FeatureMatches&) { progress.Advance(1); });
  const auto visit_geometry = [&](const Pair& pair, const FeatureMatches& kept) {
    for (const size_t image_idx : {pair.image_idx1, pair.image_idx2}) {
      images[image_idx].had_geometry |= !pair.matches.empty();
      images[image_idx].has_geometry |= !kept.empty();
    }
    summary.num_geometries_before += !pair.matches.empty();
    summary.num_geometries_after += !kept.empty();
    progress.Advance(1);
  };
  const Counts inliers = filter(kTwoViewTable, options.min_num_inliers, visit_geometry);
  summary.num_matches_before = matches.before;
  summary.num_matches_after = matches.after;
  summary.num_inlier_matches_before = inliers.before;
  summary.num_inlier_matches_after = inliers.after;
  for (const MaskedImage& image : images) {
    if (image.had_geometry && !image.has_geometry) {
      summary.disconnected_images.push_back(image.summary.image_name);
    }
  }
}

}  // namespace vgtw
