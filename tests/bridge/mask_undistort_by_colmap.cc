// SPDX-License-Identifier: BSD-3-Clause
// COLMAP itself as the judge of UndistortMasks: photos of a straight black and white edge are their
// own masks, so that the masks must have the edges that its image_undistorter gives the photos.
#include "bridge/colmap_model.h"
#include "bridge/mask_undistort_folder.h"
#include "scene/mask_undistort.h"
#include "tests/scene/sample_cameras.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr int kNumEdges = 4;

// White where the pixel centre lies on the right of a line that passes the centre at 90 px; all of
// it for edge -1.
GrayImage MakeEdge(int width, int height, int edge_idx) {
  if (edge_idx < 0) return {width, height, 255};
  const double angle = (20.0 + 370.0 * edge_idx / kNumEdges) * std::numbers::pi / 180.0;
  GrayImage image(width, height, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double distance =
          (x + 0.5 - 0.5 * width) * std::cos(angle) + (y + 0.5 - 0.5 * height) * std::sin(angle);
      if (distance > -90.0) image(x, y) = 255;
    }
  }
  return image;
}

std::string EdgeName(CameraModel model, int edge_idx) {
  return "sub/" + std::string(GetCameraModelInfo(model).name) + std::to_string(edge_idx) + ".png";
}

// photos/, masks/ and sparse/ with every model of camera and every edge.
void WriteEdges(const std::filesystem::path& root) {
  Reconstruction model;
  ImageId image_id = 0;
  for (const Camera& camera : SampleCameras()) {
    model.cameras[camera.camera_id] = camera;
    for (int i = -1; i < kNumEdges; ++i) {
      const std::string name = EdgeName(camera.model, i);
      const GrayImage edge =
          MakeEdge(static_cast<int>(camera.width), static_cast<int>(camera.height), i);
      WriteImage(root / "photos" / name, edge);
      WriteImage(MaskPath(root / "masks", name), edge);
      Image& image = model.images[++image_id];
      image.image_id = image_id;
      image.camera_id = camera.camera_id;
      image.name = name;
    }
  }
  WriteModel(model, root / "sparse");
}

// How a mask follows the image of which it should be the mask.
struct EdgeError {
  int num_off_edge = 0;  // pixels that disagree though no pixel beside them does in the image
  // Mean distance between the two edges, towards white, in pixels: the difference of the white
  // areas over the length of the edge.
  double bias_px = 0.0;
};

// `is_inside` tells what both the photo and the image show, more than 3 px from their borders,
// which COLMAP blends with black.
EdgeError CompareEdges(const StaticMask& mask, const RgbImage& image, const StaticMask& is_inside) {
  const auto is_white = [&](int x, int y) { return image(x, y)[0] >= 128; };
  const auto is_edge = [&](int x, int y) {
    bool is_white_around = true;
    bool is_black_around = true;
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        is_white_around &= is_white(x + i, y + j);
        is_black_around &= !is_white(x + i, y + j);
      }
    }
    return !is_white_around && !is_black_around;
  };
  EdgeError error;
  double area = 0.0;
  double edge_length = 0.0;
  for (int y = 1; y + 1 < mask.height(); ++y) {
    for (int x = 1; x + 1 < mask.width(); ++x) {
      if ((mask(x, y) != 0) != is_white(x, y) && !is_edge(x, y)) ++error.num_off_edge;
      if (is_inside(x, y) == 0) continue;
      area += (double(mask(x, y)) - double(image(x, y)[0])) / 255.0;
      edge_length += std::hypot(image(x + 1, y)[0] - image(x - 1, y)[0],
                                image(x, y + 1)[0] - image(x, y - 1)[0]) /
                     (2.0 * 255.0);
    }
  }
  error.bias_px = area / std::max(edge_length, 1.0);
  return error;
}

// Pixels of the mask of an all-white photo that are more than 3 px from the excluded and the
// border.
StaticMask Inside(const StaticMask& mask_of_white) {
  StaticMask inside(mask_of_white.width(), mask_of_white.height(), 0);
  for (int y = 3; y + 3 < inside.height(); ++y) {
    for (int x = 3; x + 3 < inside.width(); ++x) {
      bool is_inside = true;
      for (const int j : {-3, 0, 3}) {
        for (const int i : {-3, 0, 3}) is_inside &= mask_of_white(x + i, y + j) != 0;
      }
      if (is_inside) inside(x, y) = 255;
    }
  }
  return inside;
}

void WriteAndUndistortEdges(const TemporaryFolder& folder,
                            const std::vector<std::string>& undistorter_options) {
  WriteEdges(folder.path());
  std::vector<std::string> args = {"image_undistorter",
                                   "--image_path",
                                   folder / "photos",
                                   "--input_path",
                                   folder / "sparse",
                                   "--output_path",
                                   folder / "dense"};
  args.insert(args.end(), undistorter_options.begin(), undistorter_options.end());
  const ColmapRun run = RunColmap(args);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  UndistortMasks(folder / "masks", folder / "sparse", folder / "dense", folder / "out");
}

// Nearest neighbours put each pixel of the edge on one side: over 500 px that averages out to 0.15
// px at worst (where the slope is close to 1/2), which half a pixel of offset would exceed.
constexpr double kMaxBiasPx = 0.2;

void ExpectMasksFollowImages(const TemporaryFolder& folder) {
  for (const Camera& camera : SampleCameras()) {
    const StaticMask inside =
        Inside(ReadStaticMask(MaskPath(folder / "out", EdgeName(camera.model, -1))));
    for (int i = -1; i < kNumEdges; ++i) {
      const std::string name = EdgeName(camera.model, i);
      const RgbImage image = ReadRgbImage(folder.path() / "dense/images" / name);
      const StaticMask mask = ReadStaticMask(MaskPath(folder / "out", name));
      ASSERT_EQ(mask.width(), image.width()) << name;
      ASSERT_EQ(mask.height(), image.height()) << name;
      const EdgeError error = CompareEdges(mask, image, inside);
      EXPECT_EQ(error.num_off_edge, 0) << name;
      EXPECT_LT(std::abs(error.bias_px), kMaxBiasPx) << name;
    }
  }
}

// The judge must be able to say no.
void ExpectAWrongCameraIsNoticed(const TemporaryFolder& folder) {
  const std::string name = EdgeName(CameraModel::kOpenCV, 0);
  const Camera photo = SampleCameras()[static_cast<size_t>(CameraModel::kOpenCV)];
  const Camera undistorted = ReadModel(folder / "dense/sparse").cameras.at(photo.camera_id);
  const RgbImage image = ReadRgbImage(folder.path() / "dense/images" / name);
  const StaticMask inside = Inside(UndistortMask(StaticMask(640, 480, 255), photo, undistorted));
  const auto error_of = [&](double offset_px, double k1) {
    Camera wrong = photo;
    wrong.params[2] += offset_px;
    wrong.params[4] += k1;
    const StaticMask edge = MakeEdge(640, 480, 0);
    return CompareEdges(UndistortMask(edge, wrong, undistorted), image, inside);
  };
  EXPECT_EQ(error_of(0.0, 0.0).num_off_edge, 0);
  EXPECT_GT(std::abs(error_of(0.5, 0.0).bias_px), 2.0 * kMaxBiasPx);
  EXPECT_GT(error_of(2.0, 0.0).num_off_edge, 100);
  EXPECT_GT(error_of(0.0, 0.1).num_off_edge, 50);
}

TEST(MaskUndistortByColmap, EdgesFollowTheImages) {
  VGTW_NEED_COLMAP();
  const TemporaryFolder folder;
  WriteAndUndistortEdges(folder, {});
  ExpectMasksFollowImages(folder);
  ExpectAWrongCameraIsNoticed(folder);
}

// The whole photo with what lies around it, which COLMAP paints black, at another size.
TEST(MaskUndistortByColmap, EdgesFollowTheImagesWithBlankPixelsAtAnotherSize) {
  VGTW_NEED_COLMAP();
  const TemporaryFolder folder;
  WriteAndUndistortEdges(folder, {"--blank_pixels", "1", "--max_image_size", "500"});
  ExpectMasksFollowImages(folder);
}

}  // namespace
}  // namespace vgtw
