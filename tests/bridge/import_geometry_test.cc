// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_geometry.h"

#include "scene/error.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Products and quotients of small integers: rounding errors of a few 1e-13 px.
constexpr double kTolerancePx = 1e-9;

void ExpectMaps(const NetworkGeometry& geometry,
                const Eigen::Vector2d& in_network,
                const Eigen::Vector2d& in_original) {
  const Eigen::Vector2d mapped = Apply(geometry.original_from_network, in_network);
  EXPECT_NEAR(mapped.x(), in_original.x(), kTolerancePx);
  EXPECT_NEAR(mapped.y(), in_original.y(), kTolerancePx);
}

ResolvedResize Resolve(const std::vector<ImageSize>& photos,
                       const std::vector<MapSize>& maps,
                       ImportResize requested = ImportResize::kAuto) {
  return ResolveResize("maps.npz", photos, maps, requested);
}

std::string MessageOf(const std::vector<ImageSize>& photos,
                      const std::vector<MapSize>& maps,
                      ImportResize requested = ImportResize::kAuto) {
  try {
    Resolve(photos, maps, requested);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ResolveResize, LandscapePhotosInCropMode) {
  // 529 * 518 / 706 = 388.1 = 27.7 patches, so 28 * 14 = 392 rows.
  const ResolvedResize resolved = Resolve({{706, 529}}, {{518, 392}});
  EXPECT_EQ(resolved.resize, ImportResize::kCrop);
  EXPECT_EQ(resolved.warning, "");
  ExpectMaps(resolved.geometries[0], {0, 0}, {0, 0});
  ExpectMaps(resolved.geometries[0], {518, 392}, {706, 529});
  ExpectMaps(resolved.geometries[0], {259, 196}, {353, 264.5});
}

TEST(ResolveResize, BatchOfTwoShapesIsPaddedToTheTallest) {
  // 720 * 518 / 1280 = 291.4 = 20.8 patches: 294 rows, centred in 392 below 49 rows of padding.
  const ResolvedResize resolved = Resolve({{706, 529}, {1280, 720}}, {{518, 392}, {518, 392}});
  EXPECT_EQ(resolved.resize, ImportResize::kCrop);
  EXPECT_EQ(resolved.warning, "");
  ExpectMaps(resolved.geometries[1], {0, 49}, {0, 0});
  ExpectMaps(resolved.geometries[1], {518, 343}, {1280, 720});
}

TEST(ResolveResize, PortraitPhotosAreTakenAsCroppedWithAWarning) {
  // 1600 * 518 / 1200 = 690.7 = 49.3 patches: 686 rows, of which (686 - 518) / 2 = 84.. are kept.
  const ResolvedResize resolved = Resolve({{1200, 1600}}, {{518, 518}});
  EXPECT_EQ(resolved.resize, ImportResize::kCrop);
  EXPECT_NE(resolved.warning.find("--resize"), std::string::npos);
  ExpectMaps(resolved.geometries[0], {0, 0}, {0, 84 * 1600.0 / 686});
  ExpectMaps(resolved.geometries[0], {259, 259}, {600, 800});
}

TEST(ResolveResize, SquarePhotosNeedNoDecision) {
  const ResolvedResize resolved = Resolve({{1000, 1000}}, {{518, 518}});
  EXPECT_EQ(resolved.warning, "");
  ExpectMaps(resolved.geometries[0], {259, 518}, {500, 1000});
}

TEST(ResolveResize, PadAndSquarePadDifferByTheRounding) {
  // pad: 1600x1200 becomes 518 x (388.5 = 27.75 patches = 392), bars of 63 rows.
  const ResolvedResize pad = Resolve({{1600, 1200}}, {{518, 518}}, ImportResize::kPad);
  ExpectMaps(pad.geometries[0], {0, 63}, {0, 0});
  ExpectMaps(pad.geometries[0], {518, 455}, {1600, 1200});
  // square_pad: 200 rows of bars at 1600 pixels, all scaled by 518 / 1600.
  const ResolvedResize square = Resolve({{1600, 1200}}, {{518, 518}}, ImportResize::kSquarePad);
  ExpectMaps(square.geometries[0], {0, 200 * 518.0 / 1600}, {0, 0});
  ExpectMaps(square.geometries[0], {518, 1400 * 518.0 / 1600}, {1600, 1200});
  const std::string message = MessageOf({{1600, 1200}}, {{518, 518}});
  EXPECT_NE(message.find("pad, square_pad can give"), std::string::npos) << message;
  EXPECT_NE(message.find("--resize"), std::string::npos);
}

TEST(ResolveResize, StretchedPhotosKeepTheirAspectWithinAPatch) {
  // pi3's size for 4:3 photos.
  // A crop to this width would cut nothing and give the same map: which name it gets is all one.
  const ResolvedResize resolved = Resolve({{1600, 1200}}, {{574, 434}});
  EXPECT_EQ(resolved.warning, "");
  ExpectMaps(resolved.geometries[0], {287, 434}, {800, 1200});
  // Maps of the photo's own size.
  ExpectMaps(Resolve({{1600, 1200}}, {{1600, 1200}}).geometries[0], {3, 5}, {3, 5});
}

TEST(ResolveResize, OtherSizesAreErrorsUnlessStretchIsAskedFor) {
  const std::string message = MessageOf({{1600, 1200}}, {{504, 280}});
  EXPECT_NE(message.find("504x280 for photos of 1600x1200"), std::string::npos) << message;
  EXPECT_NE(message.find("--resize stretch"), std::string::npos);
  const auto resolved = Resolve({{1600, 1200}}, {{504, 280}}, ImportResize::kStretch);
  ExpectMaps(resolved.geometries[0], {504, 140}, {1600, 600});
}

TEST(ResolveResize, APolicyThatCannotHaveGivenTheSizesIsAnError) {
  EXPECT_NE(MessageOf({{706, 529}}, {{518, 378}}, ImportResize::kCrop), "");
  EXPECT_NE(MessageOf({{706, 529}}, {{518, 406}}, ImportResize::kCrop), "");
  EXPECT_NE(MessageOf({{706, 529}}, {{518, 392}}, ImportResize::kPad), "");
  EXPECT_NE(MessageOf({{20000, 100}}, {{518, 518}}, ImportResize::kSquarePad), "");
}

TEST(ResolveResize, MapsOfDifferentSizesPerPhoto) {
  const ResolvedResize resolved = Resolve({{706, 529}, {1280, 720}}, {{518, 392}, {518, 294}});
  EXPECT_EQ(resolved.resize, ImportResize::kCrop);
  ExpectMaps(resolved.geometries[1], {518, 294}, {1280, 720});
}

}  // namespace
}  // namespace vgtw
