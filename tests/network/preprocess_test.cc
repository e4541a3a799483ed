// SPDX-License-Identifier: BSD-3-Clause
#include "network/preprocess.h"

#include "scene/safetensors.h"
#include "tests/parity/parity_photo.h"
#include "tests/support/shared_data.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ostream>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Ratios of sizes: exact to a rounding of numbers of size 4000.
constexpr double kRounding = 1e-11;

ImageSize SizeOf(const RgbImage& image) {
  return {static_cast<uint64_t>(image.width()), static_cast<uint64_t>(image.height())};
}

RgbImage MakeAlone(const RgbImage& photo, const PreprocessOptions& options) {
  return MakeNetworkImage(photo, PlacePhotos({SizeOf(photo)}, options).front(), options);
}

void ExpectMaps(const PhotoPlacement& placement,
                const Eigen::Vector2d& pixel_in_network,
                const Eigen::Vector2d& pixel_in_original) {
  const PixelMap& map = placement.geometry.original_from_network;
  EXPECT_LT((Apply(map, pixel_in_network) - pixel_in_original).norm(), kRounding)
      << Apply(map, pixel_in_network).transpose();
}

void ExpectPhotoAt(
    const PhotoPlacement& placement, int first_column, int end_column, int first_row, int end_row) {
  EXPECT_EQ(placement.first_column, first_column);
  EXPECT_EQ(placement.end_column, end_column);
  EXPECT_EQ(placement.first_row, first_row);
  EXPECT_EQ(placement.end_row, end_row);
}

struct LoaderCase {
  std::string tensor;
  size_t image_idx;
  std::string photo;
  int width, height;
  PreprocessOptions options;
};
void PrintTo(const LoaderCase& loader, std::ostream* stream) {
  *stream << loader.tensor << " of " << loader.photo;
}
class OfficialLoader : public testing::TestWithParam<LoaderCase> {};

TEST_P(OfficialLoader, GivesTheSameBytes) {
  VGTW_NEED_PARITY_DATA();
  const LoaderCase& loader = GetParam();
  const RgbImage input =
      MakeAlone(ParityPhoto(loader.photo, loader.width, loader.height), loader.options);
  const SafetensorsFile file(ParityData() / "preprocess.safetensors");
  const StoredTensor& official = file.tensors().at(loader.tensor);
  ASSERT_EQ(official.shape[2], static_cast<uint64_t>(input.height()));
  ASSERT_EQ(official.shape[3], static_cast<uint64_t>(input.width()));
  const auto planes = official.bytes.subspan(loader.image_idx * input.size() * 3);
  EXPECT_EQ(input, FromPlanes(planes, input.width(), input.height()));
}

constexpr PreprocessOptions kCrop = {};
constexpr PreprocessOptions kPad = {.policy = ResizePolicy::kPad};
constexpr PreprocessOptions kSquare = {.policy = ResizePolicy::kSquarePad, .side_px = 252};
constexpr PreprocessOptions kStretch = {.policy = ResizePolicy::kStretch, .max_pixels = 80000};

INSTANTIATE_TEST_SUITE_P(
    Cases,
    OfficialLoader,
    testing::Values(LoaderCase{"crop.land", 0, "photo.land", 200, 133, kCrop},
                    LoaderCase{"crop.port", 0, "photo.port", 133, 200, kCrop},
                    LoaderCase{"crop.big", 0, "photo.big", 700, 500, kCrop},
                    LoaderCase{"pad.port", 0, "photo.port", 133, 200, kPad},
                    LoaderCase{"square252", 0, "photo.port", 133, 200, kSquare},
                    LoaderCase{"square252", 1, "photo.big", 700, 500, kSquare},
                    LoaderCase{"pi3.big", 0, "photo.big", 700, 500, kStretch}));

TEST(NetworkMask, IsThatOfTheOfficialLoader) {
  VGTW_NEED_PARITY_DATA();
  StaticMask photo_mask(200, 133, 255);
  const RgbImage photo = ParityPhoto("photo.mask", 200, 133);
  for (size_t i = 0; i < photo.size(); ++i) {
    photo_mask.data()[i] = photo.data()[i][0] > 127 ? 255 : 0;
  }
  const StaticMask mask =
      MakeNetworkMask(photo_mask, PlacePhotos({{200, 133}}, kCrop).front(), kCrop, /*outside=*/0);
  const SafetensorsFile file(ParityData() / "preprocess.safetensors");
  const StoredTensor& official = file.tensors().at("mask.land");
  ASSERT_EQ(official.bytes.size(), mask.size());
  EXPECT_EQ(std::memcmp(official.bytes.data(), mask.data().data(), mask.size()), 0);
}

// A landscape of 56 x 28 becomes 28 x 14 pixels between bars of 7 rows.
TEST(NetworkMask, IsCroppedAndPaddedAsThePhoto) {
  PreprocessOptions options = kPad;
  options.side_px = 28;
  const auto placements = PlacePhotos({{56, 28}}, options);
  StaticMask upper_half(56, 28, 255);
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 56; ++x) upper_half(x, y) = 0;
  }
  const StaticMask mask = MakeNetworkMask(upper_half, placements[0], options, /*outside=*/9);
  ASSERT_EQ(mask.height(), 28);
  EXPECT_EQ(mask(3, 6), 9);
  EXPECT_EQ(mask(3, 7), 0);
  EXPECT_EQ(mask(3, 13), 0);
  EXPECT_EQ(mask(3, 14), 255);
  EXPECT_EQ(mask(3, 20), 255);
  EXPECT_EQ(mask(3, 21), 9);
}

TEST(NetworkMask, RefusesAMaskOfAnotherSize) {
  const auto placements = PlacePhotos({{200, 133}}, kCrop);
  EXPECT_THROW(MakeNetworkMask(StaticMask(100, 133, 0), placements[0], kCrop, 0),
               std::invalid_argument);
}

// The corners that VGGT's loader reports beside its squares, in float32.
TEST(PlacePhotos, GivesTheCornersOfTheOfficialSquares) {
  VGTW_NEED_PARITY_DATA();
  const SafetensorsFile file(ParityData() / "preprocess.safetensors");
  const std::vector<float> corners = ToFloats(file.tensors().at("square252.coords"));
  const auto placements = PlacePhotos({{133, 200}, {700, 500}}, kSquare);
  for (size_t i = 0; i < 2; ++i) {
    const float* corner = &corners[6 * i];
    const PixelMap network_from_original = Inverse(placements[i].geometry.original_from_network);
    const Eigen::Vector2d begin = Apply(network_from_original, Eigen::Vector2d::Zero());
    const Eigen::Vector2d end = Apply(network_from_original, Eigen::Vector2d(corner[4], corner[5]));
    EXPECT_LT((begin - Eigen::Vector2d(corner[0], corner[1])).norm(), 1e-4);
    EXPECT_LT((end - Eigen::Vector2d(corner[2], corner[3])).norm(), 1e-4);
  }
}

TEST(PlacePhotos, CentresSmallerPhotosOfABatch) {
  // 3000 * 518 / 4000 / 14 = 27.75 rounds to 28 patches; 2000 * 518 / 4000 / 14 = 18.5 to 18, the
  // even neighbour; 140 bar rows, half of them first.
  const auto placements = PlacePhotos({{4000, 3000}, {4000, 2000}}, kCrop);
  for (const PhotoPlacement& placement : placements) {
    EXPECT_EQ(placement.geometry.network_width, 518);
    EXPECT_EQ(placement.geometry.network_height, 392);
  }
  ExpectPhotoAt(placements[0], 0, 518, 0, 392);
  ExpectMaps(placements[0], {0.5, 0.5}, {2000.0 / 518, 1500.0 / 392});
  ExpectPhotoAt(placements[1], 0, 518, 70, 322);
  ExpectMaps(placements[1], {0.5, 70.5}, {2000.0 / 518, 1000.0 / 252});
  ExpectMaps(placements[1], {259.0, 196.0}, {2000.0, 1000.0});
}

TEST(PlacePhotos, CropsPortraitsInTheMiddle) {
  // 4000 * 518 / 3000 / 14 = 49.33 rounds to 686 rows, of which 84 .. 601 are kept.
  const auto placements = PlacePhotos({{3000, 4000}, {4000, 3000}}, kCrop);
  ExpectPhotoAt(placements[0], 0, 518, 0, 518);
  ExpectMaps(placements[0], {0.5, 0.5}, {1500.0 / 518, 84.5 * 4000 / 686});
  ExpectPhotoAt(placements[1], 0, 518, 63, 455);
}

TEST(PlacePhotos, PadsToASquare) {
  const auto placements = PlacePhotos({{3000, 4000}, {4000, 3000}}, kPad);
  ExpectPhotoAt(placements[0], 63, 455, 0, 518);
  ExpectMaps(placements[0], {63.5, 0.5}, {1500.0 / 392, 2000.0 / 518});
  ExpectPhotoAt(placements[1], 0, 518, 63, 455);
}

TEST(PlacePhotos, CountsCentresWhereBarsEndInsideAPixel) {
  // 133 of 200 columns: 33 bar columns, 41.58 pixels of 252; the photo ends at 209.16.
  ExpectPhotoAt(PlacePhotos({{133, 200}}, kSquare).front(), 42, 209, 0, 252);
}

TEST(PlacePhotos, StretchesAllPhotosToTheSizeOfTheFirst) {
  const PreprocessOptions options = {.policy = ResizePolicy::kStretch};
  // sqrt(255000 / 12e6) * (4000, 3000) / 14 = (41.65, 31.24) rounds to 42 x 31 patches, 255192
  // pixels: too many, and 42 / 31 > 4 / 3, so that a column goes.
  const auto placements = PlacePhotos({{4000, 3000}, {300, 200}}, options);
  for (const PhotoPlacement& placement : placements) {
    EXPECT_EQ(placement.geometry.network_width, 41 * 14);
    EXPECT_EQ(placement.geometry.network_height, 31 * 14);
    ExpectPhotoAt(placement, 0, 574, 0, 434);
  }
  ExpectMaps(placements[1], {0.5, 0.5}, {150.0 / 574, 100.0 / 434});
  const auto portrait = PlacePhotos({{3000, 4000}}, options).front();
  EXPECT_EQ(portrait.geometry.network_width, 31 * 14);
  EXPECT_EQ(portrait.geometry.network_height, 41 * 14);
}

TEST(PlacePhotos, RefusesNothingAndThinPhotos) {
  EXPECT_THROW(PlacePhotos({}, kCrop), std::invalid_argument);
  EXPECT_THROW(PlacePhotos({{4000, 3000}, {4000, 100}}, kCrop), std::invalid_argument);
  EXPECT_THROW(PlacePhotos({{4000, 3000}}, {.side_px = 500}), std::invalid_argument);
  EXPECT_THROW(PlacePhotos({{4000, 3000}}, {.side_px = 0}), std::invalid_argument);
  EXPECT_THROW(PlacePhotos({{4000, 3000}}, {.max_pixels = 195}), std::invalid_argument);
}

TEST(FindFault, AsksForOnePatch) {
  // 109 * 518 / 4000 = 14.1 rows, 108 * 518 / 4000 = 13.99.
  EXPECT_EQ(FindFault({4000, 109}, kCrop), "");
  EXPECT_NE(FindFault({4000, 108}, kCrop).find("4000x108"), std::string::npos);
  EXPECT_NE(FindFault({108, 4000}, kPad), "");
  EXPECT_NE(FindFault({0, 0}, kStretch), "");
  EXPECT_NE(FindFault({0, 10}, kSquare), "");
  // sqrt(80000) = 282.8: 14 / 282.8 of the longer side.
  EXPECT_EQ(FindFault({1000, 50}, kStretch), "");
  EXPECT_NE(FindFault({1000, 49}, kStretch), "");
}

// Red counts columns, green rows: a ramp that resizing keeps, but for pixels near its ends, and
// that shows where every network pixel comes from.
RgbImage MakeRamp(int width, int height) {
  RgbImage photo(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      photo(x, y) = {static_cast<uint8_t>(x), static_cast<uint8_t>(y), 0};
    }
  }
  return photo;
}

// Mean difference, in photo pixels, of where the inner pixels lie and where the map says.
Eigen::Vector2d MeanMapError(const RgbImage& input, const PhotoPlacement& placement) {
  constexpr int kBorder = 8;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int num_pixels = 0;
  for (int y = placement.first_row + kBorder; y < placement.end_row - kBorder; ++y) {
    for (int x = placement.first_column + kBorder; x < placement.end_column - kBorder; ++x) {
      const Rgb& pixel = input(x, y);
      const Eigen::Vector2d drawn(pixel[0] + 0.5, pixel[1] + 0.5);
      sum += drawn - Apply(placement.geometry.original_from_network, {x + 0.5, y + 0.5});
      ++num_pixels;
    }
  }
  return sum / num_pixels;
}

class PictureAndMap : public testing::TestWithParam<PreprocessOptions> {};

// The roundings to bytes cancel but for ties, which all go up: 1 / 14 of a pixel where 180 columns
// become 70. Half a pixel of the network is at least 0.4 of these photos'.
TEST_P(PictureAndMap, Agree) {
  constexpr double kMaxError = 0.08;
  const std::vector<RgbImage> photos = {
      MakeRamp(230, 180), MakeRamp(180, 230), MakeRamp(230, 100), MakeRamp(70, 90)};
  std::vector<ImageSize> sizes;
  for (const RgbImage& photo : photos) sizes.push_back(SizeOf(photo));
  const auto placements = PlacePhotos(sizes, GetParam());
  for (size_t i = 0; i < photos.size(); ++i) {
    const RgbImage input = MakeNetworkImage(photos[i], placements[i], GetParam());
    const Eigen::Vector2d error = MeanMapError(input, placements[i]);
    EXPECT_LT(error.cwiseAbs().maxCoeff(), kMaxError) << i << ": " << error.transpose();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Policies,
    PictureAndMap,
    testing::Values(PreprocessOptions{.side_px = 84},
                    PreprocessOptions{.policy = ResizePolicy::kPad, .side_px = 84},
                    PreprocessOptions{.policy = ResizePolicy::kSquarePad, .side_px = 84},
                    PreprocessOptions{.policy = ResizePolicy::kStretch, .max_pixels = 7000}));

TEST(MakeNetworkImage, DrawsWhiteBarsInABatchAndWhenPadding) {
  const RgbImage grey(200, 100, {90, 90, 90});
  const PreprocessOptions crop = {.side_px = 112};
  const auto placement = PlacePhotos({{200, 100}, {200, 200}}, crop).front();
  const RgbImage input = MakeNetworkImage(grey, placement, crop);
  ExpectPhotoAt(placement, 0, 112, 28, 84);
  for (int y = 0; y < 112; ++y) {
    const uint8_t expected = y >= 28 && y < 84 ? 90 : 255;
    for (int x = 0; x < 112; ++x) ASSERT_EQ(input(x, y), (Rgb{expected, expected, expected}));
  }
  EXPECT_EQ(MakeAlone(grey, {.policy = ResizePolicy::kPad, .side_px = 112}), input);
}

TEST(MakeNetworkImage, DrawsBlackBarsBeforeTheSquareIsResized) {
  const RgbImage white(200, 100, {255, 255, 255});
  const RgbImage input = MakeAlone(white, {.policy = ResizePolicy::kSquarePad, .side_px = 100});
  ASSERT_EQ(input.height(), 100);
  EXPECT_EQ(input(50, 10), (Rgb{0, 0, 0}));
  EXPECT_EQ(input(50, 50), (Rgb{255, 255, 255}));
  EXPECT_EQ(input(50, 90), (Rgb{0, 0, 0}));
}

TEST(MakeNetworkImage, KeepsAPhotoOfTheNetworksSize) {
  const RgbImage photo = ParityPhoto("photo", 112, 84);
  EXPECT_EQ(MakeAlone(photo, {.side_px = 112}), photo);
}

TEST(MakeNetworkImage, RefusesAnotherPhotoThanWasPlaced) {
  const auto placement = PlacePhotos({{200, 100}}, kCrop).front();
  EXPECT_THROW(MakeNetworkImage(RgbImage(100, 200), placement, kCrop), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
