// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/photo_detail.h"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Pixels of two views that show the same surface, relative to the size of their photos.
struct ViewFlow {
  size_t view_a = 0;
  size_t view_b = 0;
  std::vector<Eigen::Vector2d> positions_a;
  std::vector<Eigen::Vector2d> positions_b;
};

// A better assignment of photos to views.
struct PhotoOrder {
  std::vector<size_t> photo_of_view;  // index into `details`
  double correlation = 0.0;           // mean over the flows, by their length
  double correlation_as_read = 0.0;
};

// Views are 0..n-1, and view i was read with details[i]; `details` may hold further photos, that
// `candidates` (assignments to start from) name. Searches by exchanges of two photos, from the
// order as read, the candidates and random orders.
// Returns nullopt unless another order explains the photos far better than the order as read.
std::optional<PhotoOrder> FindBetterPhotoOrder(const std::vector<ViewFlow>& flows,
                                               size_t num_views,
                                               const std::vector<const PhotoDetail*>& details,
                                               const std::vector<std::vector<size_t>>& candidates);

// Indices of `names` in the order of people, in which runs of digits compare as numbers
// (img2 < img10).
std::vector<size_t> NaturalOrder(const std::vector<std::string>& names);

}  // namespace vgtw
