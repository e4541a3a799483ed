// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "matching/tracks.h"
#include "scene/reconstruction.h"

#include <vector>

namespace vgtw {

// The verified matches between images of the model. Throws Error if there are none.
std::vector<PairMatches> ReadVerifiedMatches(const ColmapDatabase& database,
                                             const Reconstruction& model);

// Lets the model's points2D be the database's keypoints. Points of the model stay if their
// observations are keypoints already (COLMAP's are), else they go. Returns the tracks that the
// database's verified matches form. Throws Error if it has none between the model's images.
std::vector<std::vector<TrackElement>> ReadTracks(const ColmapDatabase& database,
                                                  Reconstruction& model);

}  // namespace vgtw
