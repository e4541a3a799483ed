// SPDX-License-Identifier: BSD-3-Clause
// COLMAP's feature_extractor as the judge: it stores the size and the focal length that it takes
// from a file.
#include "scene/exif_focal_length.h"

#include "bridge/colmap_database.h"
#include "scene/files.h"
#include "tests/scene/exif_jpeg.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <map>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

struct Case {
  std::string name;
  ExifTags tags;
};

std::vector<Case> Cases() {
  const auto plane = [](std::optional<uint32_t> unit, ExifTags::Rational resolution) {
    return ExifTags{.focal_length_mm = {{240, 10}},
                    .pixel_x_dimension = 6000,
                    .focal_plane_x_resolution = resolution,
                    .focal_plane_resolution_unit = unit};
  };
  const auto length = [](uint32_t micrometres) {
    return ExifTags{.focal_length_mm = {{micrometres, 1000}},
                    .pixel_x_dimension = 4000,
                    .focal_plane_x_resolution = {{16000, 1}},
                    .focal_plane_resolution_unit = 2};
  };
  return {{"none.jpg", {}},
          {"film.jpg", {.focal_length_35mm = 28}},
          {"film_zero.jpg", {.focal_length_mm = {{50, 10}}, .focal_length_35mm = 0}},
          {"film_first.jpg",
           {.focal_length_mm = {{240, 10}},
            .focal_length_35mm = 50,
            .pixel_x_dimension = 6000,
            .focal_plane_x_resolution = {{6000, 1}},
            .focal_plane_resolution_unit = 2}},
          {"length_only.jpg", {.focal_length_mm = {{50, 10}}}},
          {"plane_inch.jpg", plane(2, {4000000, 1000})},
          {"plane_inch_int.jpg", plane(2, {4000, 1})},
          {"plane_cm.jpg", plane(3, {1600000, 1000})},
          {"plane_mm.jpg", plane(4, {160, 1})},
          {"plane_um.jpg", plane(5, {160, 1000})},
          {"plane_none.jpg", plane(1, {4000, 1})},
          {"plane_no_unit.jpg", plane(std::nullopt, {4000, 1})},
          {"plane_unreduced.jpg", plane(2, {8000000, 2001})},
          {"turned.jpg", {.orientation = 6, .focal_length_35mm = 28}},
          {"length_4237.jpg", length(4237)},
          // Halves of a tenth, which binary numbers hold a little above or below.
          {"length_4250.jpg", length(4250)},
          {"length_4350.jpg", length(4350)},
          {"length_4450.jpg", length(4450)},
          {"length_50.jpg", length(50)},
          {"length_40.jpg", length(40)}};
}

std::span<const std::byte> Bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

// The camera that feature_extractor made for every image.
std::map<std::string, Camera> CamerasOfColmap(const TemporaryFolder& folder) {
  const std::string database_path = folder / "database.db";
  const ColmapRun run = RunColmap({"feature_extractor",
                                   "--database_path",
                                   database_path,
                                   "--image_path",
                                   folder / "images",
                                   "--ImageReader.camera_model",
                                   "SIMPLE_PINHOLE",
                                   UseGpuFlag("feature_extractor"),
                                   "0"});
  EXPECT_EQ(run.exit_code, 0) << run.output;
  const ColmapDatabase database(database_path, ColmapDatabase::Mode::kReadOnly);
  std::map<CameraId, Camera> cameras;
  for (const Camera& camera : database.ReadCameras()) cameras[camera.camera_id] = camera;
  std::map<std::string, Camera> camera_by_name;
  for (const DatabaseImage& image : database.ReadImages()) {
    camera_by_name[image.name] = cameras.at(image.camera_id);
  }
  return camera_by_name;
}

TEST(ExifFocalLength, EqualsColmaps) {
  VGTW_NEED_COLMAP();
  const TemporaryFolder folder;
  WriteImage(folder / "plain.jpg", GrayImage(96, 128, 128));
  const std::string jpeg = ReadFile(folder / "plain.jpg");
  std::filesystem::create_directory(folder / "images");
  for (const auto& [name, tags] : Cases()) {
    WriteFileAtomically(folder / "images" / name, InsertExif(jpeg, MakeExif(tags)));
  }
  const auto camera_by_name = CamerasOfColmap(folder);
  int num_priors = 0;
  for (const auto& [name, tags] : Cases()) {
    ASSERT_TRUE(camera_by_name.contains(name)) << name;
    const Camera& camera = camera_by_name.at(name);
    const ImageSize size = ReadImageSize(folder / "images" / name);
    EXPECT_EQ(size, (ImageSize{camera.width, camera.height})) << name;
    const auto ours = ReadExifFocalLength(folder / "images" / name, size);
    EXPECT_EQ(ours.has_value(), camera.has_prior_focal_length) << name;
    if (!ours) continue;
    EXPECT_NEAR(*ours, camera.FocalLengthX(), 1e-9 * camera.FocalLengthX()) << name;
    ++num_priors;
  }
  EXPECT_EQ(num_priors, 12);
}

// Without COLMAP: 24 mm before 6000 pixels at 4000 per inch, 38.1 mm, and 128 pixels.
TEST(ExifFocalLength, FollowsTheFocalPlane) {
  const std::string exif = MakeExif({.focal_length_mm = {{240, 10}},
                                     .pixel_x_dimension = 6000,
                                     .focal_plane_x_resolution = {{4000, 1}},
                                     .focal_plane_resolution_unit = 2});
  EXPECT_DOUBLE_EQ(ParseExifFocalLength(Bytes(exif), {96, 128}).value(), 24.0 / 38.1 * 128.0);
}

// COLMAP takes an infinite sensor and a focal length of 0 from this.
TEST(ExifFocalLength, IsUnknownForAnEmptyResolution) {
  const std::string exif = MakeExif({.focal_length_mm = {{240, 10}},
                                     .pixel_x_dimension = 6000,
                                     .focal_plane_x_resolution = {{0, 1}},
                                     .focal_plane_resolution_unit = 2});
  EXPECT_EQ(ParseExifFocalLength(Bytes(exif), {96, 128}), std::nullopt);
}

TEST(ExifFocalLength, SurvivesDamage) {
  const std::string exif = MakeExif({.orientation = 1,
                                     .focal_length_mm = {{240, 10}},
                                     .focal_length_35mm = 28,
                                     .pixel_x_dimension = 6000});
  for (size_t size = 0; size < exif.size(); ++size) {
    ParseExifFocalLength(Bytes(exif).first(size), {96, 128});
  }
  for (size_t i = 0; i < exif.size(); ++i) {
    for (const int value : {0, 1, 0x7f, 0xff}) {
      std::string changed = exif;
      changed[i] = static_cast<char>(value);
      const auto focal_length = ParseExifFocalLength(Bytes(changed), {96, 128});
      if (focal_length) {
        EXPECT_GT(*focal_length, 0.0);
      }
    }
  }
}

}  // namespace
}  // namespace vgtw
