// SPDX-License-Identifier: BSD-3-Clause
// Values of COLMAP's tables, never trusted: each function throws Error for what cannot be. `owner`
// names the row in messages, for instance "descriptors of image 3".
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/sqlite.h"
#include "scene/error.h"

#include <array>
#include <cstring>

namespace vgtw {

// An id in [0, 2^32).
uint32_t CheckedId(const SqliteQuery& query, int column, const char* kind);

// The matrix whose rows, cols and data are the query's columns first_column, +1 and +2; the
// data's size must be rows * cols * bytes_per_value.
struct MatrixBlob {
  uint32_t rows = 0;
  uint32_t cols = 0;
  std::span<const std::byte> bytes;
};
MatrixBlob ReadMatrixBlob(const SqliteQuery& query,
                          int first_column,
                          size_t bytes_per_value,
                          const std::string& owner);

// The same for float32 keypoints, cols = 2, 4 or 6 (any if there is no row).
MatrixBlob ReadKeypointsBlob(const SqliteQuery& query, int first_column, ImageId image_id);

// The same for (uint32, uint32) pairs of keypoint indices, cols = 2.
FeatureMatches ReadMatchesBlob(const SqliteQuery& query,
                               int first_column,
                               const std::string& owner);

// The image ids of a pair id in a table.
std::pair<ImageId, ImageId> CheckedImageIds(const SqliteQuery& query, int64_t pair_id);

// N doubles at `column`; nullopt for NULL or an empty blob.
template <size_t N>
std::optional<std::array<double, N>> ReadDoubles(const SqliteQuery& query,
                                                 int column,
                                                 const std::string& owner) {
  const BlobBytes bytes = query.Blob(column);
  if (bytes.empty()) return std::nullopt;
  std::array<double, N> values;
  if (bytes.size() != sizeof(values)) {
    Fail(query.path(),
         owner + " has a blob of " + std::to_string(bytes.size()) + " bytes",
         std::to_string(sizeof(values)));
  }
  std::memcpy(values.data(), bytes.data(), sizeof(values));
  return values;
}

}  // namespace vgtw
