// SPDX-License-Identifier: BSD-3-Clause
#include "scene/perturb.h"

#include "scene/error.h"
#include "scene/random.h"
#include "scene/sim3d.h"
#include "scene/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace vgtw {
namespace {

enum Stream : uint64_t { kWorld = 1, kPose, kIntrinsics, kDepthScale, kDepthNoise, kBlobs, kEdges };

RandomStream MakeStream(const PerturbOptions& options, Stream stream, size_t view_idx = 0) {
  return RandomStream(HashKey({options.seed, stream, view_idx}));
}

// A smooth random function of the image position with mean 0 and sigma 1 (over its draws): a sum of
// waves, at most `kMaxWaves` of them across the longer side.
class SmoothField {
 public:
  SmoothField(RandomStream random, double longer_side) {
    constexpr double kMaxWaves = 3.0;
    for (Wave& wave : waves_) {
      const double angle_rad = random.Uniform(0.0, 2.0 * std::numbers::pi);
      const double frequency =
          2.0 * std::numbers::pi * random.Uniform(0.5, kMaxWaves) / longer_side;
      wave.frequency = frequency * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
      wave.phase_rad = random.Uniform(0.0, 2.0 * std::numbers::pi);
    }
  }

  double At(const Eigen::Vector2d& pixel) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) sum += std::cos(wave.frequency.dot(pixel) + wave.phase_rad);
    return sum * std::sqrt(2.0 / waves_.size());  // a wave's mean square is 1/2
  }

 private:
  struct Wave {
    Eigen::Vector2d frequency;  // radians per pixel
    double phase_rad = 0.0;
  };
  std::array<Wave, 8> waves_;
};

double LongerSide(const View& view) {
  return static_cast<double>(std::max(view.camera.width, view.camera.height));
}

double CameraExtent(const Prediction& prediction) {
  std::vector<Eigen::Vector3d> centres;
  for (const ViewPrediction& view : prediction.views) {
    centres.push_back(OriginInSource(view.view.cam_from_world));
  }
  return Diameter(centres);
}

Sim3d RandomWorld(const PerturbOptions& options, double extent) {
  RandomStream random = MakeStream(options, kWorld);
  constexpr double kMaxScale = 4.0;
  Sim3d new_from_old;
  new_from_old.scale = std::exp(std::log(kMaxScale) * random.Uniform(-1.0, 1.0));
  new_from_old.rotation = random.Rotation();
  new_from_old.translation = new_from_old.scale * extent * random.NormalVector();
  return new_from_old;
}

void PerturbPose(const PerturbOptions& options, double extent, size_t view_idx, View& view) {
  RandomStream random = MakeStream(options, kPose, view_idx);
  const double angle_deg = options.rotation_deg * random.Normal();
  const Eigen::Quaterniond turn = RotationAboutAxis(random.NormalVector().normalized(), angle_deg);
  const double sigma_per_axis = 0.01 * options.centre_percent * extent / std::numbers::sqrt3;
  const Eigen::Vector3d centre =
      OriginInSource(view.cam_from_world) + sigma_per_axis * random.NormalVector();
  view.cam_from_world.rotation = (turn * view.cam_from_world.rotation).normalized();
  view.cam_from_world.translation = -(view.cam_from_world.rotation * centre);
}

// Relative errors are applied as exp(error), so that nothing turns negative.
double RelativeFactor(double sigma_percent, double normal) {
  return std::exp(0.01 * sigma_percent * normal);
}

void PerturbFocalLength(const PerturbOptions& options, size_t view_idx, Camera& camera) {
  const double normal = MakeStream(options, kIntrinsics, view_idx).Normal();
  const double factor = RelativeFactor(options.focal_percent, normal);
  camera.SetFocalLength(factor * camera.FocalLengthX(), factor * camera.FocalLengthY());
}

// Relative error of depth as a function of the original pixel.
class DepthFactor {
 public:
  DepthFactor(const PerturbOptions& options, size_t view_idx, const View& view, double world_scale)
      : noise_percent_(options.depth_noise_percent),
        view_factor_(world_scale *
                     RelativeFactor(options.depth_scale_percent,
                                    MakeStream(options, kDepthScale, view_idx).Normal())),
        field_(MakeStream(options, kDepthNoise, view_idx), LongerSide(view)) {}

  double At(const Eigen::Vector2d& pixel_in_original) const {
    return view_factor_ * RelativeFactor(noise_percent_, field_.At(pixel_in_original));
  }

 private:
  double noise_percent_;
  double view_factor_;
  SmoothField field_;
};

Eigen::Vector2d CentreInOriginal(const View& view, int x, int y) {
  return Apply(view.original_from_network, {x + 0.5, y + 0.5});
}

// The point of the changed depth on the ray of the changed camera.
Eigen::Vector3f MovePoint(const View& old_view,
                          const View& new_view,
                          const Eigen::Vector2d& pixel,
                          double depth_factor,
                          const Eigen::Vector3f& point_in_old_world) {
  const double depth =
      depth_factor * (old_view.cam_from_world * point_in_old_world.cast<double>()).z();
  const auto ray = Unproject(new_view.camera, pixel);
  if (!ray) return Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  return (Inverse(new_view.cam_from_world) * (depth * ray->homogeneous())).cast<float>();
}

void PerturbDepths(const View& old_view, const DepthFactor& factor, ViewPrediction& prediction) {
  for (int y = 0; y < prediction.depth.height(); ++y) {
    for (int x = 0; x < prediction.depth.width(); ++x) {
      float& depth = prediction.depth(x, y);
      depth = static_cast<float>(depth * factor.At(CentreInOriginal(old_view, x, y)));
    }
  }
  for (int y = 0; y < prediction.points.height(); ++y) {
    for (int x = 0; x < prediction.points.width(); ++x) {
      const Eigen::Vector2d pixel = CentreInOriginal(old_view, x, y);
      Eigen::Vector3f& point = prediction.points(x, y);
      point = MovePoint(old_view, prediction.view, pixel, factor.At(pixel), point);
    }
  }
  for (DepthSample& sample : prediction.depth_samples) {
    const Eigen::Vector2d pixel = sample.pixel_in_original.cast<double>();
    sample.depth = static_cast<float>(sample.depth * factor.At(pixel));
  }
}

cv::Mat IsDistractor(const DistractorMask& distractor) {
  cv::Mat is_distractor(distractor.height(), distractor.width(), CV_8UC1);
  std::transform(
      distractor.data().begin(),
      distractor.data().end(),
      is_distractor.begin<uchar>(),
      [](float probability) { return static_cast<uchar>(probability > 0.5f ? 255 : 0); });
  return is_distractor;
}

// Pixels of one connected distractor area.
using Blob = std::vector<cv::Point>;

std::vector<Blob> FindBlobs(const DistractorMask& distractor) {
  cv::Mat labels;
  const int num_labels = cv::connectedComponents(IsDistractor(distractor), labels, 8, CV_32S);
  std::vector<Blob> blobs(static_cast<size_t>(num_labels) - 1);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int label = labels.at<int>(y, x);
      if (label > 0) blobs[static_cast<size_t>(label) - 1].emplace_back(x, y);
    }
  }
  return blobs;
}

// Marks static pixels in the shape of `blob` somewhere else inside the image.
void StampElsewhere(const Blob& blob, RandomStream& random, DistractorMask& distractor) {
  const cv::Rect box = cv::boundingRect(blob);
  const auto draw = [&random](int free_length) {
    return static_cast<int>(random.Uniform(0.0, free_length + 1.0));
  };
  const int shift_x = draw(distractor.width() - box.width) - box.x;
  const int shift_y = draw(distractor.height() - box.height) - box.y;
  for (const cv::Point& pixel : blob) {
    float& probability = distractor(pixel.x + shift_x, pixel.y + shift_y);
    if (!std::isnan(probability)) probability = 1.0f;
  }
}

void FlipBlobs(const PerturbOptions& options, size_t view_idx, DistractorMask& distractor) {
  RandomStream random = MakeStream(options, kBlobs, view_idx);
  const double share = 0.01 * options.mask_flip_percent;
  const std::vector<Blob> blobs = FindBlobs(distractor);
  for (const Blob& blob : blobs) {
    if (random.Uniform() >= share) continue;
    for (const cv::Point& pixel : blob) distractor(pixel.x, pixel.y) = 0.0f;
  }
  for (const Blob& blob : blobs) {
    if (random.Uniform() < share) StampElsewhere(blob, random, distractor);
  }
}

// Moves the edge between the two states in and out along a smooth curve; probabilities become 0 or
// 1, unknown stays unknown.
void ShiftEdges(const PerturbOptions& options, size_t view_idx, DistractorMask& distractor) {
  const cv::Mat is_distractor = IsDistractor(distractor);
  const int num_distractors = cv::countNonZero(is_distractor);
  if (num_distractors == 0 || num_distractors == is_distractor.size().area()) return;
  cv::Mat inside;   // distance to the nearest static centre
  cv::Mat outside;  // distance to the nearest distractor centre
  cv::distanceTransform(is_distractor, inside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  cv::distanceTransform(~is_distractor, outside, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const SmoothField field(MakeStream(options, kEdges, view_idx),
                          std::max(distractor.width(), distractor.height()));
  for (int y = 0; y < distractor.height(); ++y) {
    for (int x = 0; x < distractor.width(); ++x) {
      float& probability = distractor(x, y);
      if (std::isnan(probability)) continue;
      // The edge runs half a pixel from both centres.
      const double depth_inside = inside.at<float>(y, x) > 0.0f ? inside.at<float>(y, x) - 0.5
                                                                : 0.5 - outside.at<float>(y, x);
      const double shift = options.mask_edge_px * field.At({x + 0.5, y + 0.5});
      probability = depth_inside + shift > 0.0 ? 1.0f : 0.0f;
    }
  }
}

ViewPrediction PerturbView(const ViewPrediction& truth,
                           const PerturbOptions& options,
                           double extent,
                           const Sim3d& new_from_old,
                           size_t view_idx) {
  ViewPrediction prediction = truth;
  View& view = prediction.view;
  PerturbPose(options, extent, view_idx, view);
  view.cam_from_world = TransformCamera(new_from_old, view.cam_from_world);
  PerturbFocalLength(options, view_idx, view.camera);
  PerturbDepths(
      truth.view, DepthFactor(options, view_idx, truth.view, new_from_old.scale), prediction);
  if (prediction.distractor.empty()) return prediction;
  if (options.mask_flip_percent > 0.0) FlipBlobs(options, view_idx, prediction.distractor);
  if (options.mask_edge_px > 0.0) ShiftEdges(options, view_idx, prediction.distractor);
  return prediction;
}

}  // namespace

void PerturbOptions::Check() const {
  const auto check = [](double value, double max, const std::string& name) {
    VGTW_CHECK(value >= 0.0 && value <= max,
               "PerturbOptions::" + name + " = " + std::to_string(value) + ", must be in [0, " +
                   std::to_string(max) + "]");
  };
  check(rotation_deg, 180.0, "rotation_deg");
  check(centre_percent, 1000.0, "centre_percent");
  check(focal_percent, 100.0, "focal_percent");
  check(depth_scale_percent, 100.0, "depth_scale_percent");
  check(depth_noise_percent, 100.0, "depth_noise_percent");
  check(mask_flip_percent, 100.0, "mask_flip_percent");
  check(mask_edge_px, 1000.0, "mask_edge_px");
}

Prediction Perturb(const Prediction& truth, const PerturbOptions& options) {
  options.Check();
  const double extent = CameraExtent(truth);
  const Sim3d new_from_old = options.random_world ? RandomWorld(options, extent) : Sim3d();
  Prediction prediction;
  prediction.producer = truth.producer + ", perturbed";
  prediction.weights_hash = truth.weights_hash;
  for (size_t i = 0; i < truth.views.size(); ++i) {
    prediction.views.push_back(PerturbView(truth.views[i], options, extent, new_from_old, i));
  }
  return prediction;
}

}  // namespace vgtw
