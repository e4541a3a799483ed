// SPDX-License-Identifier: BSD-3-Clause
// Pose priors, rigs and frames of ColmapDatabase.
#include "bridge/colmap_database_impl.h"

#include <limits>
#include <map>

namespace vgtw {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

const char* SelectPosePriors(const DatabaseSchema& schema) {
  if (schema.has_pose_prior_data_ids) {
    return "SELECT corr_data_id, position, coordinate_system, position_covariance "
           "FROM pose_priors WHERE corr_sensor_type = 0 ORDER BY corr_data_id";
  }
  if (schema.has_pose_prior_covariance) {
    return "SELECT image_id, position, coordinate_system, position_covariance "
           "FROM pose_priors ORDER BY image_id";
  }
  return "SELECT image_id, position, coordinate_system, NULL FROM pose_priors ORDER BY image_id";
}

SensorId ReadSensor(const SqliteQuery& query, int type_column, int id_column) {
  return {static_cast<int32_t>(query.Int(type_column)), CheckedId(query, id_column, "sensor")};
}

template <typename Map>
typename Map::mapped_type& FindOwner(Map& by_id, const SqliteQuery& query, const char* table) {
  const uint32_t id = CheckedId(query, 0, table);
  const auto found = by_id.find(id);
  if (found == by_id.end()) {
    Fail(query.path(),
         std::string(table) + " names id " + std::to_string(id) + " that has no row of its own",
         "one row per rig and frame");
  }
  return found->second;
}

template <typename Map>
std::vector<typename Map::mapped_type> Values(Map by_id) {
  std::vector<typename Map::mapped_type> values;
  for (auto& [id, value] : by_id) values.push_back(std::move(value));
  return values;
}

void RequireRigs(const DatabaseSchema& schema, const std::filesystem::path& path) {
  if (schema.has_rigs) return;
  Fail(path,
       "has no tables for rigs and frames (" + schema.Describe() + ")",
       "COLMAP 3.12 or later");
}

}  // namespace

std::vector<DatabasePosePrior> ColmapDatabase::ReadPosePriors() const {
  std::vector<DatabasePosePrior> priors;
  if (!impl_->schema.has_pose_priors) return priors;
  SqliteQuery query(impl_->connection, SelectPosePriors(impl_->schema));
  while (query.Next()) {
    DatabasePosePrior prior;
    prior.image_id = CheckedId(query, 0, "image");
    const std::string owner = "pose prior of image " + std::to_string(prior.image_id);
    const auto position = ReadDoubles<3>(query, 1, owner);
    if (!position || !Eigen::Vector3d(position->data()).allFinite()) continue;
    prior.position = Eigen::Vector3d(position->data());
    prior.coordinate_system = static_cast<int>(query.Int(2));
    const auto covariance = ReadDoubles<9>(query, 3, owner);
    if (covariance && Eigen::Matrix3d(covariance->data()).allFinite()) {
      prior.position_covariance = Eigen::Matrix3d(covariance->data());
    }
    priors.push_back(prior);
  }
  return priors;
}

void ColmapDatabase::WritePosePrior(const DatabasePosePrior& prior) {
  SqliteConnection& connection = impl_->Writable();
  const DatabaseSchema& schema = impl_->schema;
  if (!schema.has_pose_priors) {
    Fail(
        path(), "has no table for pose priors (" + schema.Describe() + ")", "COLMAP 3.10 or later");
  }
  const BlobBytes position = AsBlob(std::span(prior.position.data(), 3));
  const Eigen::Matrix3d matrix =
      prior.position_covariance.value_or(Eigen::Matrix3d::Constant(kNaN));
  const BlobBytes covariance = AsBlob(std::span(matrix.data(), 9));
  if (!schema.has_pose_prior_data_ids) {
    connection.Execute(
        "INSERT OR REPLACE INTO pose_priors (image_id, position, coordinate_system) "
        "VALUES (?, ?, ?)",
        prior.image_id,
        position,
        prior.coordinate_system);
    if (!schema.has_pose_prior_covariance) return;
    connection.Execute("UPDATE pose_priors SET position_covariance = ? WHERE image_id = ?",
                       covariance,
                       prior.image_id);
    return;
  }
  // An existing row may hold a gravity prior that must stay.
  connection.Execute(
      "UPDATE pose_priors SET position = ?, coordinate_system = ?, position_covariance = ? "
      "WHERE corr_sensor_type = 0 AND corr_data_id = ?",
      position,
      prior.coordinate_system,
      covariance,
      prior.image_id);
  if (connection.NumChangedRows() > 0) return;
  const std::array<double, 3> no_gravity = {kNaN, kNaN, kNaN};
  connection.Execute(
      "INSERT INTO pose_priors (corr_data_id, corr_sensor_id, corr_sensor_type, position, "
      "position_covariance, gravity, coordinate_system) "
      "SELECT image_id, camera_id, 0, ?, ?, ?, ? FROM images WHERE image_id = ?",
      position,
      covariance,
      AsBlob(no_gravity),
      prior.coordinate_system,
      prior.image_id);
  VGTW_CHECK(connection.NumChangedRows() == 1, "a pose prior needs its image in the database");
}

std::vector<Rig> ColmapDatabase::ReadRigs() const {
  if (!impl_->schema.has_rigs) return {};
  std::map<RigId, Rig> rigs;
  {
    SqliteQuery query(impl_->connection, "SELECT rig_id, ref_sensor_type, ref_sensor_id FROM rigs");
    while (query.Next()) {
      const RigId rig_id = CheckedId(query, 0, "rig");
      rigs[rig_id] = {rig_id, ReadSensor(query, 1, 2), {}};
    }
  }
  SqliteQuery query(impl_->connection,
                    "SELECT rig_id, sensor_type, sensor_id, sensor_from_rig FROM rig_sensors");
  while (query.Next()) {
    Rig& rig = FindOwner(rigs, query, "rig_sensors");
    std::optional<Rigid3d> sensor_from_rig;
    if (const auto p = ReadDoubles<7>(query, 3, "sensor of rig " + std::to_string(rig.rig_id))) {
      const Eigen::Quaterniond rotation((*p)[0], (*p)[1], (*p)[2], (*p)[3]);
      const Eigen::Vector3d translation((*p)[4], (*p)[5], (*p)[6]);
      if (!(rotation.norm() > 0.0) || !rotation.coeffs().allFinite() || !translation.allFinite()) {
        Fail(
            path(), "rig " + std::to_string(rig.rig_id) + " has an invalid pose", "finite numbers");
      }
      sensor_from_rig = Rigid3d{rotation.normalized(), translation};
    }
    rig.sensor_from_rig[ReadSensor(query, 1, 2)] = sensor_from_rig;
  }
  return Values(std::move(rigs));
}

std::vector<Frame> ColmapDatabase::ReadFrames() const {
  if (!impl_->schema.has_rigs) return {};
  std::map<FrameId, Frame> frames;
  {
    SqliteQuery query(impl_->connection, "SELECT frame_id, rig_id FROM frames");
    while (query.Next()) {
      Frame frame;
      frame.frame_id = CheckedId(query, 0, "frame");
      frame.rig_id = CheckedId(query, 1, "rig");
      frames[frame.frame_id] = std::move(frame);
    }
  }
  SqliteQuery query(impl_->connection,
                    "SELECT frame_id, sensor_type, sensor_id, data_id FROM frame_data "
                    "ORDER BY frame_id, sensor_type, sensor_id, data_id");
  while (query.Next()) {
    Frame& frame = FindOwner(frames, query, "frame_data");
    frame.data.push_back({ReadSensor(query, 1, 2), static_cast<uint64_t>(query.Int(3))});
  }
  return Values(std::move(frames));
}

void ColmapDatabase::WriteTrivialRigsAndFrames() {
  SqliteConnection& connection = impl_->Writable();
  if (!impl_->schema.has_rigs) return;
  for (const char* table : {"frame_data", "frames", "rig_sensors", "rigs"}) {
    connection.Execute(std::string("DELETE FROM ") + table);
  }
  connection.Execute(
      "INSERT INTO rigs (rig_id, ref_sensor_id, ref_sensor_type) "
      "SELECT camera_id, camera_id, 0 FROM cameras");
  connection.Execute(
      "INSERT INTO frames (frame_id, rig_id) SELECT image_id, camera_id FROM images");
  connection.Execute(
      "INSERT INTO frame_data (frame_id, data_id, sensor_id, sensor_type) "
      "SELECT image_id, image_id, camera_id, 0 FROM images");
}

void ColmapDatabase::WriteRig(const Rig& rig) {
  SqliteConnection& connection = impl_->Writable();
  RequireRigs(impl_->schema, path());
  connection.Execute("DELETE FROM rig_sensors WHERE rig_id = ?", rig.rig_id);
  connection.Execute(
      "INSERT OR REPLACE INTO rigs (rig_id, ref_sensor_id, ref_sensor_type) VALUES (?, ?, ?)",
      rig.rig_id,
      rig.reference.id,
      rig.reference.type);
  for (const auto& [sensor, sensor_from_rig] : rig.sensor_from_rig) {
    std::array<double, 7> pose = {};
    std::optional<BlobBytes> blob;
    if (sensor_from_rig) {
      const auto [w, x, y, z] = ToWxyz(sensor_from_rig->rotation);
      const Eigen::Vector3d& t = sensor_from_rig->translation;
      pose = {w, x, y, z, t.x(), t.y(), t.z()};
      blob = AsBlob(pose);
    }
    connection.Execute(
        "INSERT INTO rig_sensors (rig_id, sensor_id, sensor_type, sensor_from_rig) "
        "VALUES (?, ?, ?, ?)",
        rig.rig_id,
        sensor.id,
        sensor.type,
        blob);
  }
}

void ColmapDatabase::WriteFrame(const Frame& frame) {
  SqliteConnection& connection = impl_->Writable();
  RequireRigs(impl_->schema, path());
  connection.Execute("DELETE FROM frame_data WHERE frame_id = ?", frame.frame_id);
  connection.Execute("INSERT OR REPLACE INTO frames (frame_id, rig_id) VALUES (?, ?)",
                     frame.frame_id,
                     frame.rig_id);
  for (const FrameData& data : frame.data) {
    connection.Execute(
        "INSERT INTO frame_data (frame_id, data_id, sensor_id, sensor_type) VALUES (?, ?, ?, ?)",
        frame.frame_id,
        data.data_id,
        data.sensor.id,
        data.sensor.type);
  }
}

}  // namespace vgtw
