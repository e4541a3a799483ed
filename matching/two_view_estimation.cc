// SPDX-License-Identifier: BSD-3-Clause
#include "matching/two_view_estimation.h"

#include "matching/relative_pose.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/LU>
#include <opencv2/calib3d.hpp>

namespace vgtw {
namespace {

constexpr int kMaxNumRefinements = 5;

// Matches in both units, as the estimators want them.
struct Correspondences {
  FeatureMatches matches;
  std::vector<RayPair> rays;
  std::vector<cv::Point2d> pixels1, pixels2;
  double focal_length = 1.0;  // turns distances of rays into pixels

  size_t size() const { return matches.size(); }
};

Correspondences Collect(const ViewFeatures& view1,
                        const ViewFeatures& view2,
                        const FeatureMatches& matches) {
  Correspondences result;
  result.focal_length =
      0.5 * (view1.view.camera.MeanFocalLength() + view2.view.camera.MeanFocalLength());
  for (const auto& match : matches) {
    VGTW_CHECK(match[0] < view1.size() && match[1] < view2.size(), "matches of other views");
    const RayPair pair = {view1.rays[match[0]].cast<double>(), view2.rays[match[1]].cast<double>()};
    if (!pair.ray1.allFinite() || !pair.ray2.allFinite()) continue;
    result.matches.push_back(match);
    result.rays.push_back(pair);
    const Eigen::Vector2f& pixel1 = view1.pixels[match[0]];
    const Eigen::Vector2f& pixel2 = view2.pixels[match[1]];
    result.pixels1.emplace_back(pixel1.x(), pixel1.y());
    result.pixels2.emplace_back(pixel2.x(), pixel2.y());
  }
  return result;
}

cv::UsacParams SamplingParams(const TwoViewOptions& options) {
  cv::UsacParams params;
  params.confidence = 0.9999;
  params.isParallel = false;
  params.loMethod = cv::LOCAL_OPTIM_INNER_LO;
  params.loIterations = 10;
  params.loSampleSize = 20;
  params.maxIterations = options.max_num_iterations;
  params.neighborsSearch = cv::NEIGH_GRID;
  params.randomGeneratorState = 0;
  params.sampler = cv::SAMPLING_UNIFORM;
  params.score = cv::SCORE_METHOD_MSAC;
  params.threshold = options.max_error_px;
  return params;
}

std::optional<Eigen::Matrix3d> AsEigen(const cv::Mat& matrix) {
  if (matrix.rows != 3 || matrix.cols != 3 || matrix.type() != CV_64F) return std::nullopt;
  Eigen::Matrix3d result;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) result(row, col) = matrix.at<double>(row, col);
  }
  if (!result.allFinite() || result.isZero()) return std::nullopt;
  return result;
}

// The estimate and which correspondences fulfil it.
struct Estimate {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  std::vector<bool> is_inlier;
  size_t num_inliers = 0;

  void Count(size_t size, const std::function<bool(size_t)>& fulfils) {
    is_inlier.assign(size, false);
    for (size_t i = 0; i < size; ++i) is_inlier[i] = fulfils(i);
    num_inliers = static_cast<size_t>(std::count(is_inlier.begin(), is_inlier.end(), true));
  }
};

// OpenCV throws for samples that it cannot use; they support nothing.
std::optional<Eigen::Matrix3d> Sample(const std::function<cv::Mat()>& find) {
  try {
    return AsEigen(find());
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
}

std::vector<RayPair> InliersOf(const Estimate& estimate, const Correspondences& all) {
  std::vector<RayPair> inliers;
  for (size_t i = 0; i < all.size(); ++i) {
    if (estimate.is_inlier[i]) inliers.push_back(all.rays[i]);
  }
  return inliers;
}

// How well a pose explains the correspondences: each counts the less the farther it is off. The
// number of inliers would prefer a worse pose that one more wrong match happens to fulfil.
double MsacScore(const Eigen::Matrix3d& E, const Correspondences& all, double max_error_px) {
  double score = 0.0;
  for (const RayPair& pair : all.rays) {
    const double error = SampsonDistance(E, pair.ray1, pair.ray2) * all.focal_length / max_error_px;
    score += std::max(0.0, 1.0 - error * error);
  }
  return score;
}

// Sampled, then refined on its inliers; fills the pose.
Estimate EstimateEssential(const Correspondences& all,
                           const TwoViewOptions& options,
                           Rigid3d& cam2_from_cam1) {
  std::vector<cv::Point2d> points1, points2;
  for (const RayPair& pair : all.rays) {
    points1.emplace_back(pair.ray1.x() * all.focal_length, pair.ray1.y() * all.focal_length);
    points2.emplace_back(pair.ray2.x() * all.focal_length, pair.ray2.y() * all.focal_length);
  }
  const cv::Matx33d K(all.focal_length, 0, 0, 0, all.focal_length, 0, 0, 0, 1);
  Estimate estimate;
  const auto sampled = Sample([&] {
    return cv::findEssentialMat(points1,
                                points2,
                                K,
                                K,
                                cv::noArray(),
                                cv::noArray(),
                                cv::noArray(),
                                SamplingParams(options));
  });
  if (!sampled) return estimate;
  const auto count = [&](const Eigen::Matrix3d& E) {
    estimate.matrix = E;
    estimate.Count(all.size(), [&](size_t i) {
      return SampsonDistance(E, all.rays[i].ray1, all.rays[i].ray2) * all.focal_length <=
             options.max_error_px;
    });
  };
  count(*sampled);
  cam2_from_cam1 = RelativePoseFromEssential(*sampled, InliersOf(estimate, all));
  const double scale = 0.25 * options.max_error_px / all.focal_length;
  // The inliers of a sample are those near a pose that is a little wrong.
  for (int i = 0; i < kMaxNumRefinements; ++i) {
    const Estimate before = estimate;
    const Rigid3d refined = RefineRelativePose(InliersOf(estimate, all), scale, cam2_from_cam1);
    count(EssentialMatrix(refined));
    if (MsacScore(estimate.matrix, all, options.max_error_px) <
        MsacScore(before.matrix, all, options.max_error_px)) {
      return before;
    }
    cam2_from_cam1 = refined;
    if (estimate.is_inlier == before.is_inlier) break;
  }
  return estimate;
}

Estimate EstimateFundamental(const Correspondences& all, const TwoViewOptions& options) {
  Estimate estimate;
  const auto sampled = Sample([&] {
    return cv::findFundamentalMat(all.pixels1, all.pixels2, cv::noArray(), SamplingParams(options));
  });
  if (!sampled) return estimate;
  estimate.matrix = *sampled;
  estimate.Count(all.size(), [&](size_t i) {
    const Eigen::Vector2d x1(all.pixels1[i].x, all.pixels1[i].y);
    const Eigen::Vector2d x2(all.pixels2[i].x, all.pixels2[i].y);
    return SampsonDistance(*sampled, x1, x2) <= options.max_error_px;
  });
  return estimate;
}

Estimate EstimateHomography(const Correspondences& all, const TwoViewOptions& options) {
  Estimate estimate;
  const auto sampled = Sample([&] {
    return cv::findHomography(all.pixels1, all.pixels2, cv::noArray(), SamplingParams(options));
  });
  if (!sampled) return estimate;
  estimate.matrix = *sampled;
  estimate.Count(all.size(), [&](size_t i) {
    const Eigen::Vector3d x1(all.pixels1[i].x, all.pixels1[i].y, 1.0);
    const Eigen::Vector2d x2(all.pixels2[i].x, all.pixels2[i].y);
    return ((*sampled * x1).hnormalized() - x2).norm() <= options.max_error_px;
  });
  return estimate;
}

// Whether turning on the spot explains the estimate's inliers nearly as well; fills the rotation.
bool IsPanoramic(const Estimate& homography,
                 const Correspondences& all,
                 const TwoViewOptions& options,
                 Rigid3d& cam2_from_cam1) {
  const Eigen::Quaterniond rotation = RotationBetween(InliersOf(homography, all));
  Estimate turned;
  turned.Count(all.size(), [&](size_t i) {
    const Eigen::Vector3d ray = rotation * all.rays[i].ray1.homogeneous();
    return ray.z() > 0.0 &&
           (ray.hnormalized() - all.rays[i].ray2).norm() * all.focal_length <= options.max_error_px;
  });
  if (static_cast<double>(turned.num_inliers) <
      options.min_E_F_inlier_ratio * static_cast<double>(homography.num_inliers)) {
    return false;
  }
  cam2_from_cam1 = {rotation, Eigen::Vector3d::Zero()};
  return true;
}

}  // namespace

void TwoViewOptions::Check() const {
  VGTW_CHECK(max_error_px > 0.0 && std::isfinite(max_error_px), "TwoViewOptions::max_error_px");
  VGTW_CHECK(min_num_inliers >= 5, "TwoViewOptions::min_num_inliers");
  VGTW_CHECK(min_E_F_inlier_ratio >= 0.0 && min_E_F_inlier_ratio <= 1.0,
             "TwoViewOptions::min_E_F_inlier_ratio");
  VGTW_CHECK(max_H_inlier_ratio >= 0.0, "TwoViewOptions::max_H_inlier_ratio");
  VGTW_CHECK(max_num_iterations >= 1, "TwoViewOptions::max_num_iterations");
}

TwoViewGeometry EstimateTwoViewGeometry(const ViewFeatures& view1,
                                        const ViewFeatures& view2,
                                        const FeatureMatches& matches,
                                        const TwoViewOptions& options) {
  options.Check();
  const Correspondences all = Collect(view1, view2, matches);
  const auto min_num_inliers = static_cast<size_t>(options.min_num_inliers);
  TwoViewGeometry geometry;
  geometry.config = kTwoViewDegenerate;
  if (all.size() < min_num_inliers) return geometry;
  Rigid3d cam2_from_cam1;
  const Estimate essential = EstimateEssential(all, options, cam2_from_cam1);
  const Estimate fundamental = EstimateFundamental(all, options);
  const Estimate homography = EstimateHomography(all, options);
  if (std::max({essential.num_inliers, fundamental.num_inliers, homography.num_inliers}) <
      min_num_inliers) {
    return geometry;
  }
  const bool is_calibrated =
      essential.num_inliers >= min_num_inliers &&
      static_cast<double>(essential.num_inliers) >=
          options.min_E_F_inlier_ratio * static_cast<double>(fundamental.num_inliers);
  const Estimate* best = is_calibrated ? &essential : &fundamental;
  geometry.config = is_calibrated ? kTwoViewCalibrated : kTwoViewUncalibrated;
  if (is_calibrated) geometry.cam2_from_cam1 = cam2_from_cam1;
  if (homography.num_inliers >= min_num_inliers &&
      static_cast<double>(homography.num_inliers) >
          options.max_H_inlier_ratio * static_cast<double>(best->num_inliers)) {
    const bool is_panoramic = IsPanoramic(homography, all, options, cam2_from_cam1);
    geometry.config = is_panoramic ? kTwoViewPanoramic : kTwoViewPlanar;
    if (is_panoramic) geometry.cam2_from_cam1 = cam2_from_cam1;
    if (homography.num_inliers > best->num_inliers) best = &homography;
  }
  if (essential.num_inliers >= min_num_inliers) geometry.E = essential.matrix;
  if (fundamental.num_inliers >= min_num_inliers) geometry.F = fundamental.matrix;
  if (homography.num_inliers >= min_num_inliers) geometry.H = homography.matrix;
  for (size_t i = 0; i < all.size(); ++i) {
    if (best->is_inlier[i]) geometry.inlier_matches.push_back(all.matches[i]);
  }
  return geometry;
}

}  // namespace vgtw
