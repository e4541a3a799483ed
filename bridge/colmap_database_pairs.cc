// SPDX-License-Identifier: BSD-3-Clause
// Matches and two-view geometries of ColmapDatabase.
#include "bridge/colmap_database_impl.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace vgtw {
namespace {

using RowMajorMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

std::string PairName(const char* table, ImageId image_id1, ImageId image_id2) {
  return std::string(table) + " of images " + std::to_string(image_id1) + " and " +
         std::to_string(image_id2);
}

void SwapColumns(FeatureMatches& matches) {
  for (auto& [point2D_idx1, point2D_idx2] : matches) std::swap(point2D_idx1, point2D_idx2);
}

// The geometry with the images exchanged: x2^T F x1 = 0 becomes x1^T F^T x2 = 0, and x2 ~ H x1
// becomes x1 ~ H^-1 x2.
TwoViewGeometry Swapped(TwoViewGeometry geometry) {
  SwapColumns(geometry.inlier_matches);
  if (geometry.F) geometry.F = geometry.F->transpose().eval();
  if (geometry.E) geometry.E = geometry.E->transpose().eval();
  if (geometry.H) geometry.H = geometry.H->inverse().eval();
  if (geometry.H && !geometry.H->allFinite()) geometry.H.reset();
  if (geometry.cam2_from_cam1) geometry.cam2_from_cam1 = Inverse(*geometry.cam2_from_cam1);
  return geometry;
}

// Up to COLMAP 3.13 a zero matrix stands for one that is not set; from 4.0 NULL does.
std::optional<Eigen::Matrix3d> ReadMatrix(const SqliteQuery& query,
                                          int column,
                                          const std::string& owner) {
  const auto values = ReadDoubles<9>(query, column, owner);
  if (!values) return std::nullopt;
  const Eigen::Matrix3d matrix = Eigen::Map<const RowMajorMatrix3d>(values->data());
  if (!matrix.allFinite() || matrix.isZero(0.0)) return std::nullopt;
  return matrix;
}

// Up to COLMAP 3.13 the identity stands for a pose that is not set.
std::optional<Rigid3d> ReadPose(const SqliteQuery& query,
                                int qvec_column,
                                bool identity_is_unset,
                                const std::string& owner) {
  const auto qvec = ReadDoubles<4>(query, qvec_column, owner);
  const auto tvec = ReadDoubles<3>(query, qvec_column + 1, owner);
  if (!qvec || !tvec) return std::nullopt;
  const Eigen::Quaterniond rotation((*qvec)[0], (*qvec)[1], (*qvec)[2], (*qvec)[3]);
  const Eigen::Vector3d translation(tvec->data());
  const double norm = rotation.norm();
  if (!std::isfinite(norm) || norm == 0.0 || !translation.allFinite()) return std::nullopt;
  if (identity_is_unset && rotation.vec().isZero(0.0) && translation.isZero(0.0)) {
    return std::nullopt;
  }
  return Rigid3d{rotation.normalized(), translation};
}

std::optional<BlobBytes> BindMatrix(const std::optional<Eigen::Matrix3d>& matrix,
                                    bool null_is_unset,
                                    RowMajorMatrix3d& buffer) {
  if (!matrix && null_is_unset) return std::nullopt;
  buffer.setZero();
  if (matrix) buffer = *matrix;
  return std::as_bytes(std::span(buffer.data(), 9));
}

std::vector<std::pair<ImageId, ImageId>> ReadPairs(SqliteConnection& connection,
                                                   std::string_view sql) {
  std::vector<std::pair<ImageId, ImageId>> pairs;
  SqliteQuery query(connection, sql);
  while (query.Next()) pairs.push_back(CheckedImageIds(query, query.Int(0)));
  return pairs;
}

}  // namespace

FeatureMatches ColmapDatabase::ReadMatches(ImageId image_id1, ImageId image_id2) const {
  SqliteQuery query(impl_->connection,
                    "SELECT rows, cols, data FROM matches WHERE pair_id = ?",
                    PairIdFromImageIds(image_id1, image_id2));
  if (!query.Next()) return {};
  FeatureMatches matches = ReadMatchesBlob(query, 0, PairName("matches", image_id1, image_id2));
  if (image_id1 > image_id2) SwapColumns(matches);
  return matches;
}

std::optional<TwoViewGeometry> ColmapDatabase::ReadTwoViewGeometry(ImageId image_id1,
                                                                   ImageId image_id2) const {
  SqliteQuery query(
      impl_->connection,
      impl_->schema.has_two_view_poses
          ? "SELECT rows, cols, data, config, F, E, H, qvec, tvec FROM two_view_geometries "
            "WHERE pair_id = ?"
          : "SELECT rows, cols, data, config, F, E, H, NULL, NULL FROM two_view_geometries "
            "WHERE pair_id = ?",
      PairIdFromImageIds(image_id1, image_id2));
  if (!query.Next()) return std::nullopt;
  const std::string owner = PairName("two-view geometry", image_id1, image_id2);
  TwoViewGeometry geometry;
  geometry.inlier_matches = ReadMatchesBlob(query, 0, owner);
  geometry.config = static_cast<int>(query.Int(3));
  geometry.F = ReadMatrix(query, 4, owner);
  geometry.E = ReadMatrix(query, 5, owner);
  geometry.H = ReadMatrix(query, 6, owner);
  geometry.cam2_from_cam1 = ReadPose(query, 7, !impl_->schema.has_pose_prior_data_ids, owner);
  return image_id1 > image_id2 ? Swapped(std::move(geometry)) : geometry;
}

std::vector<std::pair<ImageId, ImageId>> ColmapDatabase::ReadMatchPairs() const {
  return ReadPairs(impl_->connection, "SELECT pair_id FROM matches ORDER BY pair_id");
}

std::vector<std::pair<ImageId, ImageId>> ColmapDatabase::ReadTwoViewPairs() const {
  return ReadPairs(impl_->connection, "SELECT pair_id FROM two_view_geometries ORDER BY pair_id");
}

void ColmapDatabase::WriteMatches(ImageId image_id1,
                                  ImageId image_id2,
                                  const FeatureMatches& matches) {
  SqliteConnection& connection = impl_->Writable();
  const uint64_t pair_id = PairIdFromImageIds(image_id1, image_id2);
  FeatureMatches swapped;
  if (image_id1 > image_id2) {
    swapped = matches;
    SwapColumns(swapped);
  }
  connection.Execute(
      "INSERT OR REPLACE INTO matches (pair_id, rows, cols, data) VALUES (?, ?, 2, ?)",
      pair_id,
      matches.size(),
      AsBlob(image_id1 > image_id2 ? swapped : matches));
}

void ColmapDatabase::WriteTwoViewGeometry(ImageId image_id1,
                                          ImageId image_id2,
                                          const TwoViewGeometry& geometry) {
  if (image_id1 > image_id2) {
    WriteTwoViewGeometry(image_id2, image_id1, Swapped(geometry));
    return;
  }
  SqliteConnection& connection = impl_->Writable();
  const uint64_t pair_id = PairIdFromImageIds(image_id1, image_id2);
  const bool null_is_unset = impl_->schema.has_pose_prior_data_ids;
  std::array<RowMajorMatrix3d, 3> buffers;
  // Replacing the row also resets what a later version derived from the old geometry.
  connection.Execute(
      "INSERT OR REPLACE INTO two_view_geometries (pair_id, rows, cols, data, config, F, E, H) "
      "VALUES (?, ?, 2, ?, ?, ?, ?, ?)",
      pair_id,
      geometry.inlier_matches.size(),
      AsBlob(geometry.inlier_matches),
      geometry.config,
      BindMatrix(geometry.F, null_is_unset, buffers[0]),
      BindMatrix(geometry.E, null_is_unset, buffers[1]),
      BindMatrix(geometry.H, null_is_unset, buffers[2]));
  if (!impl_->schema.has_two_view_poses) return;
  if (!geometry.cam2_from_cam1 && null_is_unset) return;
  const Rigid3d cam2_from_cam1 = geometry.cam2_from_cam1.value_or(Rigid3d());
  const std::array<double, 4> qvec = ToWxyz(cam2_from_cam1.rotation);
  connection.Execute("UPDATE two_view_geometries SET qvec = ?, tvec = ? WHERE pair_id = ?",
                     AsBlob(qvec),
                     AsBlob(std::span(cam2_from_cam1.translation.data(), 3)),
                     pair_id);
}

void ColmapDatabase::ClearMatches() {
  impl_->Writable().Execute("DELETE FROM matches");
  impl_->connection.Execute("DELETE FROM two_view_geometries");
}

}  // namespace vgtw
