// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/database_tracks.h"

#include "scene/error.h"

#include <algorithm>
#include <map>
#include <utility>

namespace vgtw {
namespace {

// Keypoints are stored in single precision; models written as text are rounded more.
constexpr double kSamePixel = 0.01;

struct KeypointLists {
  std::vector<Eigen::Vector2f> pixels;
  std::vector<float> scales;
};

KeypointLists ListsOf(const Keypoints& keypoints) {
  KeypointLists lists;
  for (size_t row = 0; row < keypoints.rows; ++row) {
    lists.pixels.emplace_back(keypoints.x(row), keypoints.y(row));
    lists.scales.push_back(keypoints.Scale(row));
  }
  return lists;
}

bool AreKeypoints(const std::vector<Point2D>& points2D, const KeypointLists& keypoints) {
  return points2D.size() == keypoints.pixels.size() &&
         std::equal(points2D.begin(),
                    points2D.end(),
                    keypoints.pixels.begin(),
                    [](const Point2D& point2D, const Eigen::Vector2f& pixel) {
                      return (point2D.xy - pixel.cast<double>()).norm() < kSamePixel;
                    });
}

void SetPoints2D(const std::map<ImageId, KeypointLists>& keypoints, Reconstruction& model) {
  const bool are_kept =
      std::all_of(model.images.begin(), model.images.end(), [&](const auto& entry) {
        return AreKeypoints(entry.second.points2D, keypoints.at(entry.first));
      });
  if (are_kept) return;
  model.points3D.clear();
  for (auto& [image_id, image] : model.images) {
    image.points2D.clear();
    for (const Eigen::Vector2f& pixel : keypoints.at(image_id).pixels) {
      image.points2D.push_back({pixel.cast<double>(), kInvalidPoint3DId});
    }
  }
}

}  // namespace

std::vector<PairMatches> ReadVerifiedMatches(const ColmapDatabase& database,
                                             const Reconstruction& model) {
  std::vector<PairMatches> pairs;
  for (const auto& [image_id1, image_id2] : database.ReadTwoViewPairs()) {
    if (!model.images.contains(image_id1) || !model.images.contains(image_id2)) continue;
    FeatureMatches matches =
        std::move(database.ReadTwoViewGeometry(image_id1, image_id2)->inlier_matches);
    if (!matches.empty()) pairs.push_back({image_id1, image_id2, std::move(matches)});
  }
  if (pairs.empty()) {
    Fail(database.path(),
         "no verified matches between images of the model",
         "some",
         "'vgtw match' or a matcher of colmap makes them");
  }
  return pairs;
}

std::vector<std::vector<TrackElement>> ReadTracks(const ColmapDatabase& database,
                                                  Reconstruction& model) {
  std::map<ImageId, KeypointLists> keypoints;
  std::map<ImageId, TrackImage> images;
  for (const auto& [image_id, image] : model.images) {
    const KeypointLists& lists = keypoints[image_id] =
        ListsOf(database.ReadKeypoints(image_id).value_or(Keypoints()));
    images[image_id] = {{}, lists.pixels, lists.scales};
  }
  SetPoints2D(keypoints, model);
  return BuildTracks(ReadVerifiedMatches(database, model), images).tracks;
}

}  // namespace vgtw
