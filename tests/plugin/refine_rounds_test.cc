// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/refine_rounds.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A point that the given images see.
void AddPoint(const std::vector<ImageId>& image_ids, Reconstruction& model) {
  Point3D& point3D = model.points3D[model.points3D.size() + 1];
  for (const ImageId id : image_ids) {
    Image& image = model.images[id];
    point3D.track.push_back({id, static_cast<uint32_t>(image.points2D.size())});
    image.points2D.push_back({{1.0, 1.0}, model.points3D.size()});
  }
}

TEST(NumSupportingObservations, CountsPointsThatThreeImagesSee) {
  Reconstruction model;
  AddPoint({1, 2}, model);
  AddPoint({1, 2, 3}, model);
  AddPoint({2, 3, 4, 5}, model);
  model.images[6];
  EXPECT_EQ(NumSupportingObservations(model),
            (std::map<ImageId, size_t>{{1, 1}, {2, 2}, {3, 2}, {4, 1}, {5, 1}, {6, 0}}));
}

TEST(NumSupportingObservations, OfTwoImagesEveryPointCounts) {
  Reconstruction model;
  AddPoint({1, 2}, model);
  AddPoint({1, 2}, model);
  EXPECT_EQ(NumSupportingObservations(model), (std::map<ImageId, size_t>{{1, 2}, {2, 2}}));
}

}  // namespace
}  // namespace vgtw
