// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/features.h"
#include "scene/reconstruction.h"
#include "scene/rigid3d.h"

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// One row of COLMAP's images table.
struct DatabaseImage {
  ImageId image_id = 0;
  std::string name;
  CameraId camera_id = 0;
};

struct DatabasePosePrior {
  ImageId image_id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // camera centre
  std::optional<Eigen::Matrix3d> position_covariance = {};
  int coordinate_system = 1;  // -1 undefined, 0 WGS84 (lat, lon, alt), 1 cartesian
};

// pair_id = 2147483647 * min(id1, id2) + max(id1, id2).
uint64_t PairIdFromImageIds(ImageId image_id1, ImageId image_id2);
std::pair<ImageId, ImageId> ImageIdsFromPairId(uint64_t pair_id);  // the smaller first

// What the tables of a database say about its version; user_version alone does not tell.
struct DatabaseSchema {
  int user_version = 0;
  bool has_image_priors = false;           // images.prior_qw..prior_tz: 3.8, 3.9
  bool has_pose_priors = false;            // from 3.10
  bool has_pose_prior_covariance = false;  // from 3.11
  bool has_pose_prior_data_ids = false;    // 4.0 layout
  bool has_rigs = false;                   // rigs, rig_sensors, frames, frame_data: from 3.12
  bool has_descriptor_type = false;        // from 4.0
  bool has_two_view_cameras = false;       // 4.2.1
  bool has_two_view_poses = false;         // two_view_geometries.qvec, tvec
  std::string Describe() const;            // for instance "COLMAP 3.12-3.13 (user_version 3900)"
};

// A COLMAP database of any version from 3.8 to 4.2.1. One writer, prepared statements; every write
// happens inside a transaction (see Transaction). Throws Error for a file that is not a database,
// lacks COLMAP's tables, is locked by another process, or holds blobs whose size disagrees with
// their rows and columns.
class ColmapDatabase {
 public:
  enum class Mode { kReadOnly, kReadWrite };
  ColmapDatabase(const std::filesystem::path& path, Mode mode);
  ~ColmapDatabase();
  ColmapDatabase(ColmapDatabase&&) noexcept;

  // A new, empty database with a schema that 3.8, 3.10 and 4.2.1 all open (docs/design.md,
  // "Database schema"). Throws Error if `path` exists.
  static ColmapDatabase Create(const std::filesystem::path& path);

  const DatabaseSchema& schema() const;
  const std::filesystem::path& path() const;

  std::vector<Camera> ReadCameras() const;        // sorted by id
  std::vector<DatabaseImage> ReadImages() const;  // sorted by id
  std::optional<Keypoints> ReadKeypoints(ImageId image_id) const;
  std::optional<Descriptors> ReadDescriptors(ImageId image_id) const;
  // Empty if there is no row. Columns follow the order of the arguments.
  FeatureMatches ReadMatches(ImageId image_id1, ImageId image_id2) const;
  std::optional<TwoViewGeometry> ReadTwoViewGeometry(ImageId image_id1, ImageId image_id2) const;
  // Every pair that has a row, also an empty one; sorted, the smaller id first.
  std::vector<std::pair<ImageId, ImageId>> ReadMatchPairs() const;
  std::vector<std::pair<ImageId, ImageId>> ReadTwoViewPairs() const;
  // Sorted by image id; rows of COLMAP >= 4 without a position (gravity only) are left out.
  std::vector<DatabasePosePrior> ReadPosePriors() const;
  std::vector<Rig> ReadRigs() const;
  std::vector<Frame> ReadFrames() const;  // without poses

  // Commits on Commit(), rolls back otherwise. Writes outside of one throw std::invalid_argument.
  class Transaction {
   public:
    explicit Transaction(ColmapDatabase& database);
    ~Transaction();
    void Commit();

   private:
    ColmapDatabase* database_;
  };

  // Insert or replace, by id.
  void WriteCamera(const Camera& camera);
  void WriteImage(const DatabaseImage& image);
  void WriteKeypoints(ImageId image_id, const Keypoints& keypoints);
  void WriteDescriptors(ImageId image_id, const Descriptors& descriptors);
  void WriteMatches(ImageId image_id1, ImageId image_id2, const FeatureMatches& matches);
  // What is not set is stored as that version does: NULL from 4.0 on, before it zero matrices and
  // an identity pose, which therefore also read as not set, as do non-finite values.
  void WriteTwoViewGeometry(ImageId image_id1, ImageId image_id2, const TwoViewGeometry& geometry);
  void ClearMatches();  // all rows of matches and two-view geometries
  // The covariance is left out where 3.10 has no column for it. Throws Error without the table.
  void WritePosePrior(const DatabasePosePrior& prior);
  // Replaces rigs and frames by the trivial ones: one rig per camera (rig_id = camera_id), one
  // frame per image (frame_id = image_id). No effect where the schema has no rigs.
  void WriteTrivialRigsAndFrames();
  // These throw Error where the schema has no rigs.
  void WriteRig(const Rig& rig);
  void WriteFrame(const Frame& frame);

 private:
  struct Impl;
  explicit ColmapDatabase(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace vgtw
