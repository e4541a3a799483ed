// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/refine_priors.h"

#include "plugin/progress.h"
#include "plugin/static_views.h"
#include "scene/error.h"
#include "scene/geodetic.h"
#include "scene/parallel.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace vgtw {
namespace {

// The sigma of a depth grows at most by this factor with falling confidence.
constexpr double kMaxSigmaGrowth = 4.0;
// Of the vector between two views, whose errors are independent, each has this share.
const double kShareOfOne = std::sqrt(0.5);

// DatabasePosePrior::coordinate_system.
constexpr int kWgs84 = 0;
constexpr int kCartesian = 1;

// An image of the seed with what is predicted of it.
struct PredictedImage {
  ImageId image_id = 0;
  size_t prediction_idx = 0;
  std::vector<uint32_t> rows;  // keypoints in tracks
  std::vector<DepthPrior> depths;
  double middle_depth = 0.0;  // 0 = unknown
};

std::vector<PredictedImage> ListPredictedImages(const PredictionReader& predictions,
                                                const Reconstruction& seed,
                                                const std::vector<Track>& tracks) {
  std::map<ImageId, std::set<uint32_t>> rows;
  for (const Track& track : tracks) {
    for (const TrackElement& element : track) rows[element.image_id].insert(element.point2D_idx);
  }
  const std::map<std::string, size_t> idx_by_name = IndexByName(predictions);
  std::vector<PredictedImage> images;
  for (const auto& [image_id, image] : seed.images) {
    const auto found = idx_by_name.find(image.name);
    if (found == idx_by_name.end()) continue;
    const std::set<uint32_t>& image_rows = rows[image_id];
    images.push_back({image_id, found->second, {image_rows.begin(), image_rows.end()}, {}, 0.0});
  }
  if (images.empty()) {
    Fail(predictions.folder(),
         "holds none of the " + std::to_string(seed.images.size()) + " images of the model",
         "views of the same names");
  }
  return images;
}

// A network that learned its confidence states it as the inverse of the error that it expects.
double SigmaGrowth(double confidence, double median_confidence) {
  if (!(confidence > 0.0)) return kMaxSigmaGrowth;
  return std::clamp(median_confidence / confidence, 1.0, kMaxSigmaGrowth);
}

struct KeypointDepth {
  uint32_t row = 0;
  double depth = 0.0;
  double confidence = 0.0;
};

std::vector<KeypointDepth> KnownDepths(const PriorOptions& options,
                                       const StaticView& view,
                                       const Image& image,
                                       const std::vector<uint32_t>& rows) {
  const double threshold = ConfidenceThreshold(view, options.keep_percent);
  std::vector<KeypointDepth> depths;
  for (const uint32_t row : rows) {
    const auto sample = view.DepthAt(image.points2D.at(row).xy);
    if (!sample || !(sample->confidence >= threshold)) continue;
    const auto depth = static_cast<double>(sample->depth);
    if (!(depth > 0.0) || !std::isfinite(depth)) continue;
    depths.push_back({row, depth, static_cast<double>(sample->confidence)});
  }
  return depths;
}

// The most confident depth of each cell, the first of equal ones.
std::vector<KeypointDepth> Thin(const std::vector<KeypointDepth>& depths,
                                const Image& image,
                                const Camera& camera,
                                int num_cells) {
  std::map<std::pair<int, int>, KeypointDepth> best;
  for (const KeypointDepth& depth : depths) {
    const Eigen::Vector2d& xy = image.points2D[depth.row].xy;
    const std::pair cell(static_cast<int>(xy.x() * num_cells / static_cast<double>(camera.width)),
                         static_cast<int>(xy.y() * num_cells / static_cast<double>(camera.height)));
    const auto [found, is_new] = best.try_emplace(cell, depth);
    if (!is_new && depth.confidence > found->second.confidence) found->second = depth;
  }
  std::vector<KeypointDepth> thinned;
  for (const auto& [cell, depth] : best) thinned.push_back(depth);
  return thinned;
}

void FindDepths(const PriorOptions& options,
                const StaticView& view,
                const Image& image,
                PredictedImage& predicted) {
  const std::vector<KeypointDepth> known = KnownDepths(options, view, image, predicted.rows);
  if (known.empty()) return;
  std::vector<double> depths, confidences;
  for (const KeypointDepth& depth : known) {
    depths.push_back(depth.depth);
    confidences.push_back(depth.confidence);
  }
  predicted.middle_depth = Median(std::move(depths));
  const double median_confidence = Median(std::move(confidences));
  const double log_sigma = options.errors.depth_percent / 100.0;
  for (const KeypointDepth& depth :
       Thin(known, image, view.view().camera, options.num_depth_cells)) {
    predicted.depths.push_back(
        {depth.row, depth.depth, log_sigma * SigmaGrowth(depth.confidence, median_confidence)});
  }
}

void FindDepths(const PriorOptions& options,
                const PredictionReader& predictions,
                const Reconstruction& seed,
                std::vector<PredictedImage>& images) {
  ProgressDisplay display("priors");
  ParallelFor(
      static_cast<int64_t>(images.size()),
      options.num_threads,
      [&](int64_t i) {
        PredictedImage& image = images[static_cast<size_t>(i)];
        const StaticView view(predictions.Load(image.prediction_idx), options.distractor_threshold);
        FindDepths(options, view, seed.images.at(image.image_id), image);
      },
      display.Callback());
}

PosePriors MakePosePriors(const ExpectedErrors& errors,
                          const std::vector<View>& views,
                          const std::vector<PredictedImage>& images) {
  std::vector<Eigen::Vector3d> centres;
  std::vector<double> middle_depths;
  for (const PredictedImage& image : images) {
    centres.push_back(OriginInSource(views[image.prediction_idx].cam_from_world));
    if (image.middle_depth > 0.0) middle_depths.push_back(image.middle_depth);
  }
  PosePriors priors;
  const double unit = ErrorUnit(centres, std::move(middle_depths));
  if (!(unit > 0.0)) return priors;  // all centres coincide: nothing to measure errors by
  for (const PredictedImage& image : images) {
    priors.by_image[image.image_id] = {views[image.prediction_idx].cam_from_world,
                                       kShareOfOne * errors.rotation_deg,
                                       kShareOfOne * errors.centre_percent / 100.0 * unit};
  }
  return priors;
}

std::map<CameraId, FocalPrior> MakeFocalPriors(const ExpectedErrors& errors,
                                               const std::vector<View>& views,
                                               const std::vector<PredictedImage>& images,
                                               const Reconstruction& seed) {
  std::map<CameraId, std::pair<std::vector<double>, std::vector<double>>> focal_lengths;
  for (const PredictedImage& image : images) {
    const Camera& camera = views[image.prediction_idx].camera;
    auto& [x, y] = focal_lengths[seed.images.at(image.image_id).camera_id];
    x.push_back(camera.FocalLengthX());
    y.push_back(camera.FocalLengthY());
  }
  std::map<CameraId, FocalPrior> priors;
  for (auto& [camera_id, values] : focal_lengths) {
    priors[camera_id] = {Median(std::move(values.first)),
                         Median(std::move(values.second)),
                         errors.focal_percent / 100.0};
  }
  return priors;
}

Eigen::Vector3d SigmasOf(const DatabasePosePrior& prior, double default_sigma) {
  Eigen::Vector3d sigmas = Eigen::Vector3d::Constant(default_sigma);
  if (!prior.position_covariance) return sigmas;
  for (int axis = 0; axis < 3; ++axis) {
    const double variance = (*prior.position_covariance)(axis, axis);
    if (variance > 0.0) sigmas[axis] = std::sqrt(variance);
  }
  return sigmas;
}

void CheckCoordinateSystems(const ColmapDatabase& database,
                            const std::vector<DatabasePosePrior>& priors) {
  const int coordinate_system = priors.front().coordinate_system;
  for (const DatabasePosePrior& prior : priors) {
    const std::string owner = "pose prior of image " + std::to_string(prior.image_id);
    const bool is_geodetic = prior.coordinate_system == kWgs84;
    if (!is_geodetic && prior.coordinate_system != kCartesian) {
      Fail(database.path(),
           owner + " has coordinate_system " + std::to_string(prior.coordinate_system),
           "0 (WGS84) or 1 (cartesian)");
    }
    if (prior.coordinate_system != coordinate_system) {
      Fail(database.path(), owner + " is of another coordinate system", "one for all images");
    }
    if (is_geodetic && std::abs(prior.position.x()) > 90.0) {
      Fail(database.path(),
           owner + " has latitude " + std::to_string(prior.position.x()),
           "at most 90 degrees");
    }
  }
}

GeodeticPosition GeodeticOf(const DatabasePosePrior& prior) {
  return {prior.position.x(), prior.position.y(), prior.position.z()};
}

}  // namespace

void PriorOptions::Check() const {
  const auto check_share = [](double percent, const char* name) {
    VGTW_CHECK(percent > 0.0 && percent <= 100.0,
               name + std::string(" = ") + std::to_string(percent) + ", must be in (0, 100]");
  };
  check_share(errors.rotation_deg, "expected_rotation_deg");
  check_share(errors.centre_percent, "expected_centre_percent");
  check_share(errors.focal_percent, "expected_focal_percent");
  check_share(errors.depth_percent, "expected_depth_percent");
  check_share(keep_percent, "PriorOptions::keep_percent");
  VGTW_CHECK(distractor_threshold > 0.0 && distractor_threshold <= 1.0,
             "PriorOptions::distractor_threshold");
  VGTW_CHECK(num_depth_cells >= 1, "PriorOptions::num_depth_cells");
  VGTW_CHECK(centre_sigma > 0.0 && std::isfinite(centre_sigma),
             "centre_sigma = " + std::to_string(centre_sigma) + ", must be finite and > 0");
}

nlohmann::json AsJson(const PriorOptions& options) {
  return {{"pose_priors", options.poses},
          {"focal_priors", options.focal_lengths},
          {"depth_priors", options.depths},
          {"centre_priors", options.centres},
          {"expected_rotation_deg", options.errors.rotation_deg},
          {"expected_centre_percent", options.errors.centre_percent},
          {"expected_focal_percent", options.errors.focal_percent},
          {"expected_depth_percent", options.errors.depth_percent},
          {"centre_sigma", options.centre_sigma},
          {"keep_percent", options.keep_percent},
          {"num_depth_cells", options.num_depth_cells},
          {"distractor_threshold", options.distractor_threshold}};
}

BundlePriors PredictionPriors(const PriorOptions& options,
                              const PredictionReader& predictions,
                              const Reconstruction& seed,
                              const std::vector<Track>& tracks) {
  options.Check();
  std::vector<PredictedImage> images = ListPredictedImages(predictions, seed, tracks);
  if (options.poses || options.depths) FindDepths(options, predictions, seed, images);
  BundlePriors priors;
  if (options.poses) priors.poses = MakePosePriors(options.errors, predictions.views(), images);
  if (options.focal_lengths) {
    priors.focal_lengths = MakeFocalPriors(options.errors, predictions.views(), images, seed);
  }
  if (options.depths) {
    for (PredictedImage& image : images) {
      if (image.depths.empty()) continue;
      priors.depths.by_image[image.image_id] = std::move(image.depths);
    }
  }
  return priors;
}

CentrePriors KnownCentres(const ColmapDatabase& database,
                          const Reconstruction& seed,
                          double default_sigma) {
  std::vector<DatabasePosePrior> rows = database.ReadPosePriors();
  std::erase_if(rows,
                [&](const DatabasePosePrior& row) { return !seed.images.contains(row.image_id); });
  if (rows.size() < 3) {
    Fail(database.path(),
         "has pose priors with a position for " + std::to_string(rows.size()) +
             " images of the model",
         "at least 3");
  }
  CheckCoordinateSystems(database, rows);
  CentrePriors priors;
  for (const DatabasePosePrior& row : rows) {
    priors.by_image[row.image_id] = {row.coordinate_system == kWgs84
                                         ? EnuFromGeodetic(GeodeticOf(row), GeodeticOf(rows[0]))
                                         : row.position,
                                     SigmasOf(row, default_sigma)};
  }
  return priors;
}

BundlePriors MakePriors(const PriorOptions& options,
                        const PredictionReader* predictions,
                        const ColmapDatabase* database,
                        const Reconstruction& seed,
                        const std::vector<Track>& tracks) {
  options.Check();
  BundlePriors priors;
  if (options.UsePredictions() && predictions != nullptr) {
    priors = PredictionPriors(options, *predictions, seed, tracks);
  }
  if (options.centres) {
    VGTW_CHECK(database != nullptr, "--centre_priors needs --database_path");
    priors.centres = KnownCentres(*database, seed, options.centre_sigma);
  }
  return priors;
}

}  // namespace vgtw
