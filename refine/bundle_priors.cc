// SPDX-License-Identifier: BSD-3-Clause
#include "refine/bundle_priors.h"

#include "refine/align.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vgtw {
namespace {

void CheckPositive(double value, const std::string& name) {
  VGTW_CHECK(value > 0.0 && std::isfinite(value),
             name + " = " + std::to_string(value) + ", must be finite and > 0");
}

bool AreAllEqual(const std::map<ImageId, Image>& images) {
  const auto first = OriginInSource(images.begin()->second.cam_from_world);
  return std::all_of(images.begin(), images.end(), [&](const auto& image) {
    return OriginInSource(image.second.cam_from_world) == first;
  });
}

}  // namespace

void BundlePriors::Check() const {
  CheckPositive(sigma_px, "BundlePriors::sigma_px");
  CheckPositive(loss_scale, "BundlePriors::loss_scale");
  CheckPositive(depths.view_scale_log_sigma, "DepthPriors::view_scale_log_sigma");
  CheckPositive(depths.view_shift_sigma, "DepthPriors::view_shift_sigma");
  for (const auto& [image_id, prior] : poses.by_image) {
    const std::string fault = FindFault(prior.cam_from_reference);
    VGTW_CHECK(fault.empty(), "PosePrior::cam_from_reference: " + fault);
    CheckPositive(prior.rotation_sigma_deg, "PosePrior::rotation_sigma_deg");
    CheckPositive(prior.centre_sigma, "PosePrior::centre_sigma");
  }
  for (const auto& [image_id, prior] : centres.by_image) {
    VGTW_CHECK(prior.centre_in_reference.allFinite(), "CentrePrior::centre_in_reference");
    for (int axis = 0; axis < 3; ++axis) CheckPositive(prior.sigma[axis], "CentrePrior::sigma");
  }
  for (const auto& [camera_id, prior] : focal_lengths) {
    CheckPositive(prior.focal_length_x, "FocalPrior::focal_length_x");
    CheckPositive(prior.focal_length_y, "FocalPrior::focal_length_y");
    CheckPositive(prior.log_sigma, "FocalPrior::log_sigma");
  }
  for (const auto& [image_id, priors] : depths.by_image) {
    for (const DepthPrior& prior : priors) {
      CheckPositive(prior.depth, "DepthPrior::depth");
      CheckPositive(prior.log_sigma, "DepthPrior::log_sigma");
    }
  }
}

std::optional<Sim3d> EstimateReferenceFromWorld(const PosePriors& priors,
                                                const std::map<ImageId, Rigid3d>& cam_from_world) {
  Reconstruction model, reference;
  for (const auto& [image_id, prior] : priors.by_image) {
    const auto found = cam_from_world.find(image_id);
    if (found == cam_from_world.end()) continue;
    model.images[image_id].cam_from_world = found->second;
    reference.images[image_id].cam_from_world = prior.cam_from_reference;
  }
  if (model.images.size() < 2 || AreAllEqual(model.images) || AreAllEqual(reference.images)) {
    return std::nullopt;
  }
  return AlignPoses(model, reference);
}

std::optional<Sim3d> EstimateReferenceFromWorld(const CentrePriors& priors,
                                                const std::map<ImageId, Rigid3d>& cam_from_world) {
  std::vector<Eigen::Vector3d> centres, reference_centres;
  for (const auto& [image_id, prior] : priors.by_image) {
    const auto found = cam_from_world.find(image_id);
    if (found == cam_from_world.end()) continue;
    centres.push_back(OriginInSource(found->second));
    reference_centres.push_back(prior.centre_in_reference);
  }
  const auto robust = EstimateSim3dRobust(centres, reference_centres);
  if (!robust) return std::nullopt;
  return robust->b_from_a;
}

void MeasuredSigmaOptions::Check() const {
  CheckPositive(min_factor, "MeasuredSigmaOptions::min_factor");
  VGTW_CHECK(num_stated_residuals >= 0.0,
             "MeasuredSigmaOptions::num_stated_residuals = " +
                 std::to_string(num_stated_residuals) + ", must be >= 0");
  VGTW_CHECK(
      redundancy >= 0.0 && redundancy <= 1.0,
      "MeasuredSigmaOptions::redundancy = " + std::to_string(redundancy) + ", must be in [0, 1]");
}

double MeasuredSigmaFactor(const std::vector<double>& residuals,
                           const MeasuredSigmaOptions& options) {
  options.Check();
  const double n = options.redundancy * static_cast<double>(residuals.size());
  if (!(n > 0.0)) return 1.0;
  std::vector<double> sizes;
  for (const double residual : residuals) sizes.push_back(std::abs(residual));
  // 1.4826: the sigma of a Gaussian by the median of its absolute values.
  const double measured = std::max(
      options.min_factor, 1.4826 * Median(std::move(sizes)) / std::sqrt(options.redundancy));
  const double n0 = options.num_stated_residuals;
  return std::sqrt((n * measured * measured + n0) / (n + n0));
}

}  // namespace vgtw
