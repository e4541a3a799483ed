// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_database.h"

#include "bridge/colmap_database_impl.h"
#include "bridge/colmap_schema.h"

#include <algorithm>

namespace vgtw {
namespace {

constexpr uint64_t kMaxImageId = 2147483647;

std::vector<double> ReadParams(const SqliteQuery& query, int column, const std::string& owner) {
  const BlobBytes bytes = query.Blob(column);
  std::vector<double> params(bytes.size() / sizeof(double));
  if (params.size() * sizeof(double) != bytes.size()) {
    Fail(query.path(),
         owner + " has parameters of " + std::to_string(bytes.size()) + " bytes",
         "a multiple of 8");
  }
  if (!params.empty()) std::memcpy(params.data(), bytes.data(), bytes.size());
  return params;
}

// A row of: camera_id, model, width, height, params, prior_focal_length.
Camera ReadCamera(const SqliteQuery& query) {
  Camera camera;
  camera.camera_id = CheckedId(query, 0, "camera");
  const std::string owner = "camera " + std::to_string(camera.camera_id);
  const int64_t model_id = query.Int(1);
  const bool in_range = model_id >= 0 && model_id < kNumCameraModels;
  const auto model =
      in_range ? FindCameraModel(static_cast<int>(model_id)) : std::optional<CameraModel>();
  if (!model) {
    Fail(query.path(),
         owner + " has model id " + std::to_string(model_id),
         "0 (SIMPLE_PINHOLE) to 10 (THIN_PRISM_FISHEYE)");
  }
  camera.model = *model;
  camera.width = static_cast<uint64_t>(query.Int(2));
  camera.height = static_cast<uint64_t>(query.Int(3));
  camera.params = ReadParams(query, 4, owner);
  camera.has_prior_focal_length = query.Int(5) != 0;
  const std::string fault = FindFault(camera);
  if (!fault.empty()) Fail(query.path(), owner + ": " + fault, "a valid camera");
  return camera;
}

}  // namespace

uint64_t PairIdFromImageIds(ImageId image_id1, ImageId image_id2) {
  VGTW_CHECK(image_id1 != image_id2, "a pair needs two images");
  VGTW_CHECK(std::max(image_id1, image_id2) < kMaxImageId, "image id too large");
  return kMaxImageId * std::min(image_id1, image_id2) + std::max(image_id1, image_id2);
}

std::pair<ImageId, ImageId> ImageIdsFromPairId(uint64_t pair_id) {
  return {static_cast<ImageId>(pair_id / kMaxImageId), static_cast<ImageId>(pair_id % kMaxImageId)};
}

ColmapDatabase::ColmapDatabase(const std::filesystem::path& path, Mode mode)
    : impl_(new Impl{.connection{path,
                                 mode == Mode::kReadOnly ? SqliteConnection::Mode::kReadOnly
                                                         : SqliteConnection::Mode::kReadWrite},
                     .schema{}}) {
  impl_->schema = RecogniseSchema(impl_->connection);
}

ColmapDatabase::~ColmapDatabase() = default;
ColmapDatabase::ColmapDatabase(ColmapDatabase&&) noexcept = default;

ColmapDatabase ColmapDatabase::Create(const std::filesystem::path& path) {
  AtomicDatabase file(path, /*overwrite=*/false);
  {
    SqliteConnection connection(file.path(), SqliteConnection::Mode::kPrivate);
    CreateUniversalSchema(connection);
  }
  file.Commit();
  return {path, Mode::kReadWrite};
}

const DatabaseSchema& ColmapDatabase::schema() const { return impl_->schema; }
const std::filesystem::path& ColmapDatabase::path() const { return impl_->connection.path(); }

std::vector<Camera> ColmapDatabase::ReadCameras() const {
  std::vector<Camera> cameras;
  SqliteQuery query(impl_->connection,
                    "SELECT camera_id, model, width, height, params, prior_focal_length "
                    "FROM cameras ORDER BY camera_id");
  while (query.Next()) cameras.push_back(ReadCamera(query));
  return cameras;
}

std::vector<DatabaseImage> ColmapDatabase::ReadImages() const {
  std::vector<DatabaseImage> images;
  SqliteQuery query(impl_->connection,
                    "SELECT image_id, name, camera_id FROM images ORDER BY image_id");
  while (query.Next()) {
    images.push_back({CheckedId(query, 0, "image"), query.Text(1), CheckedId(query, 2, "camera")});
  }
  return images;
}

std::optional<Keypoints> ColmapDatabase::ReadKeypoints(ImageId image_id) const {
  SqliteQuery query(
      impl_->connection, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?", image_id);
  if (!query.Next()) return std::nullopt;
  const MatrixBlob blob = ReadKeypointsBlob(query, 0, image_id);
  Keypoints keypoints{blob.rows, blob.cols, std::vector<float>(size_t{blob.rows} * blob.cols)};
  if (!blob.bytes.empty()) {
    std::memcpy(keypoints.data.data(), blob.bytes.data(), blob.bytes.size());
  }
  return keypoints;
}

std::optional<Descriptors> ColmapDatabase::ReadDescriptors(ImageId image_id) const {
  const bool has_type = impl_->schema.has_descriptor_type;
  SqliteQuery query(impl_->connection,
                    has_type ? "SELECT rows, cols, data, type FROM descriptors WHERE image_id = ?"
                             : "SELECT rows, cols, data, 0 FROM descriptors WHERE image_id = ?",
                    image_id);
  if (!query.Next()) return std::nullopt;
  const MatrixBlob blob =
      ReadMatrixBlob(query, 0, 1, "descriptors of image " + std::to_string(image_id));
  const auto* data = reinterpret_cast<const uint8_t*>(blob.bytes.data());
  return Descriptors{
      blob.rows, blob.cols, static_cast<int>(query.Int(3)), {data, data + blob.bytes.size()}};
}

ColmapDatabase::Transaction::Transaction(ColmapDatabase& database) : database_(&database) {
  SqliteConnection& connection = database.impl_->connection;
  VGTW_CHECK(!connection.is_read_only(), "the database was opened for reading only");
  VGTW_CHECK(!connection.InTransaction(), "transactions do not nest");
  connection.Execute("BEGIN IMMEDIATE");
}

ColmapDatabase::Transaction::~Transaction() {
  if (database_ != nullptr) database_->impl_->connection.Rollback();
}

void ColmapDatabase::Transaction::Commit() {
  VGTW_CHECK(database_ != nullptr, "the transaction was committed before");
  database_->impl_->connection.Execute("COMMIT");
  database_ = nullptr;
}

void ColmapDatabase::WriteCamera(const Camera& camera) {
  const std::string fault = FindFault(camera);
  VGTW_CHECK(fault.empty(), fault);
  // An upsert keeps columns that a later version may have added.
  impl_->Writable().Execute(
      "INSERT INTO cameras (camera_id, model, width, height, params, prior_focal_length) "
      "VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT (camera_id) DO UPDATE SET "
      "model = excluded.model, width = excluded.width, height = excluded.height, "
      "params = excluded.params, prior_focal_length = excluded.prior_focal_length",
      camera.camera_id,
      static_cast<int>(camera.model),
      camera.width,
      camera.height,
      AsBlob(camera.params),
      camera.has_prior_focal_length);
}

void ColmapDatabase::WriteImage(const DatabaseImage& image) {
  VGTW_CHECK(image.image_id < kMaxImageId, "image id too large");
  VGTW_CHECK(!image.name.empty(), "an image needs a name");
  impl_->Writable().Execute(
      "INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, ?) "
      "ON CONFLICT (image_id) DO UPDATE SET name = excluded.name, camera_id = excluded.camera_id",
      image.image_id,
      std::string_view(image.name),
      image.camera_id);
}

void ColmapDatabase::WriteKeypoints(ImageId image_id, const Keypoints& keypoints) {
  const uint32_t cols = keypoints.cols;
  VGTW_CHECK(cols == 2 || cols == 4 || cols == 6, "keypoints have 2, 4 or 6 columns");
  VGTW_CHECK(keypoints.data.size() == size_t{keypoints.rows} * cols, "data must be rows * cols");
  impl_->Writable().Execute(
      "INSERT OR REPLACE INTO keypoints (image_id, rows, cols, data) VALUES (?, ?, ?, ?)",
      image_id,
      keypoints.rows,
      cols,
      AsBlob(keypoints.data));
}

void ColmapDatabase::WriteDescriptors(ImageId image_id, const Descriptors& descriptors) {
  VGTW_CHECK(descriptors.data.size() == size_t{descriptors.rows} * descriptors.cols,
             "data must be rows * cols");
  SqliteConnection& connection = impl_->Writable();
  const BlobBytes data = AsBlob(descriptors.data);
  if (impl_->schema.has_descriptor_type) {
    connection.Execute(
        "INSERT OR REPLACE INTO descriptors (image_id, rows, cols, data, type) "
        "VALUES (?, ?, ?, ?, ?)",
        image_id,
        descriptors.rows,
        descriptors.cols,
        data,
        descriptors.type);
  } else {
    connection.Execute(
        "INSERT OR REPLACE INTO descriptors (image_id, rows, cols, data) VALUES (?, ?, ?, ?)",
        image_id,
        descriptors.rows,
        descriptors.cols,
        data);
  }
}

}  // namespace vgtw
