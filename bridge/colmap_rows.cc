// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_rows.h"

#include <limits>

namespace vgtw {

uint32_t CheckedId(const SqliteQuery& query, int column, const char* kind) {
  const int64_t id = query.Int(column);
  if (id < 0 || id > std::numeric_limits<uint32_t>::max()) {
    Fail(query.path(),
         std::string("holds ") + kind + " id " + std::to_string(id),
         "0 to 4294967295");
  }
  return static_cast<uint32_t>(id);
}

MatrixBlob ReadMatrixBlob(const SqliteQuery& query,
                          int first_column,
                          size_t bytes_per_value,
                          const std::string& owner) {
  // More than any blob can hold (SQLite's limit is 2^31 bytes), and small enough that products of
  // two of them do not overflow.
  constexpr int64_t kMaxCount = int64_t{1} << 31;
  const int64_t rows = query.Int(first_column);
  const int64_t cols = query.Int(first_column + 1);
  const BlobBytes bytes = query.Blob(first_column + 2);
  const bool sane = rows >= 0 && rows < kMaxCount && cols >= 0 && cols < kMaxCount / 8;
  if (!sane || static_cast<uint64_t>(rows * cols) * bytes_per_value != bytes.size()) {
    Fail(query.path(),
         owner + " has " + std::to_string(rows) + " rows, " + std::to_string(cols) +
             " columns and " + std::to_string(bytes.size()) + " bytes",
         "rows * columns * " + std::to_string(bytes_per_value) + " bytes");
  }
  return {static_cast<uint32_t>(rows), static_cast<uint32_t>(cols), bytes};
}

MatrixBlob ReadKeypointsBlob(const SqliteQuery& query, int first_column, ImageId image_id) {
  const std::string owner = "keypoints of image " + std::to_string(image_id);
  const MatrixBlob blob = ReadMatrixBlob(query, first_column, sizeof(float), owner);
  if (blob.rows > 0 && blob.cols != 2 && blob.cols != 4 && blob.cols != 6) {
    Fail(query.path(), owner + " have " + std::to_string(blob.cols) + " columns", "2, 4 or 6");
  }
  return blob;
}

FeatureMatches ReadMatchesBlob(const SqliteQuery& query,
                               int first_column,
                               const std::string& owner) {
  const MatrixBlob blob = ReadMatrixBlob(query, first_column, sizeof(uint32_t), owner);
  if (blob.rows > 0 && blob.cols != 2) {
    Fail(query.path(), owner + " has " + std::to_string(blob.cols) + " columns", "2");
  }
  FeatureMatches matches(blob.rows);
  if (blob.rows > 0) std::memcpy(matches.data(), blob.bytes.data(), blob.bytes.size());
  return matches;
}

std::pair<ImageId, ImageId> CheckedImageIds(const SqliteQuery& query, int64_t pair_id) {
  constexpr int64_t kMaxImageId = 2147483647;
  if (pair_id < 0 || pair_id / kMaxImageId >= pair_id % kMaxImageId) {
    Fail(query.path(),
         "holds pair id " + std::to_string(pair_id),
         "2147483647 * smaller image id + larger image id");
  }
  return ImageIdsFromPairId(static_cast<uint64_t>(pair_id));
}

}  // namespace vgtw
