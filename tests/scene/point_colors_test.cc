// SPDX-License-Identifier: BSD-3-Clause
#include "scene/point_colors.h"

#include "scene/image_io.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Two photos of 4 x 2 pixels; the first pixel of their second row is (10, 20, 30) and (20, 40, 61).
class ColorPointsTest : public testing::Test {
 protected:
  ColorPointsTest() {
    for (const uint32_t id : {1u, 2u}) {
      RgbImage photo(4, 2);
      photo(0, 1) = id == 1 ? Rgb{10, 20, 30} : Rgb{20, 40, 61};
      const std::string name = std::to_string(id) + ".png";
      WriteImage(folder_ / name, photo);
      model_.images[id] = {id, 1, name, {}, {}};
    }
  }

  void Observe(Point3DId point3D_id, ImageId image_id, double x, double y) {
    Image& image = model_.images.at(image_id);
    model_.points3D[point3D_id].track.push_back(
        {image_id, static_cast<uint32_t>(image.points2D.size())});
    image.points2D.push_back({{x, y}, point3D_id});
  }

  const TemporaryFolder folder_;
  Reconstruction model_;
};

TEST_F(ColorPointsTest, AreTheMeansOfThePixelsAtTheObservations) {
  Observe(1, 1, 0.0, 1.0);
  Observe(1, 2, 0.99, 1.99);
  Observe(2, 2, 0.5, 1.5);
  ColorPoints(folder_.path(), model_);
  // Halves are rounded up.
  EXPECT_EQ(model_.points3D.at(1).rgb, (Rgb{15, 30, 46}));
  EXPECT_EQ(model_.points3D.at(2).rgb, (Rgb{20, 40, 61}));
}

TEST_F(ColorPointsTest, WhatIsOutsideOrMissingDoesNotCount) {
  Observe(1, 1, 0.5, 1.5);
  Observe(1, 2, -0.5, 1.5);
  Observe(1, 2, 0.5, 2.0);
  Observe(2, 1, 4.0, 0.5);
  model_.points3D.at(2).rgb = {1, 2, 3};
  model_.images[3] = {3, 1, "missing.png", {}, {}};
  Observe(1, 3, 0.5, 1.5);
  ColorPoints(folder_.path(), model_);
  EXPECT_EQ(model_.points3D.at(1).rgb, (Rgb{10, 20, 30}));
  EXPECT_EQ(model_.points3D.at(2).rgb, (Rgb{1, 2, 3}));
}

}  // namespace
}  // namespace vgtw
