// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/distractor_points.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Two images of 10x10; the left half of "a" is a distractor, nothing in "b".
Reconstruction MakeModel() {
  Reconstruction model;
  for (ImageId id : {1u, 2u}) {
    Image& image = model.images[id];
    image.image_id = id;
    image.name = id == 1 ? "a" : "b";
  }
  const auto add = [&](Point3DId point3D_id, double x_in_a) {
    for (auto& [id, image] : model.images) {
      model.points3D[point3D_id].track.push_back(
          {id, static_cast<uint32_t>(image.points2D.size())});
      image.points2D.push_back({{id == 1 ? x_in_a : 2.0, 5.0}, point3D_id});
    }
  };
  add(7, 4.99);
  add(8, 5.0);
  add(9, 0.0);
  model.images[1].points2D.push_back({{1.0, 1.0}, kInvalidPoint3DId});
  return model;
}

StaticMask MaskOf(const std::string& name) {
  StaticMask mask(10, 10, 255);
  for (int y = 0; y < 10 && name == "a"; ++y) {
    for (int x = 0; x < 5; ++x) mask(x, y) = 0;
  }
  return mask;
}

TEST(CountOnDistractors, CountsPointsWithAnObservationInExcludedPixels) {
  const DistractorCount count = CountOnDistractors(MakeModel(), MaskOf);
  EXPECT_EQ(count.num_observations, 2u);
  EXPECT_EQ(count.num_points3D, 2u);
  EXPECT_EQ(count.num_observations_by_image, (std::map<ImageId, size_t>{{1, 2}, {2, 0}}));
}

TEST(CountOnDistractors, PixelsOutsideTheMaskAreExcluded) {
  Reconstruction model = MakeModel();
  model.images[2].points2D[0].xy.x() = 10.0;
  EXPECT_EQ(CountOnDistractors(model, MaskOf).num_observations, 3u);
}

}  // namespace
}  // namespace vgtw
