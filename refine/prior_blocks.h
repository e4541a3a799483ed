// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/bundle_priors.h"
#include "refine/prior_cost.h"

#include <array>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include <ceres/ceres.h>

namespace vgtw {

// An image of the problem; `component` labels the images that it is linked with.
struct LinkedImage {
  Rigid3d cam_from_world;
  size_t component = 0;
};

// The images whose priors tie their component to a reference world.
struct PriorTies {
  std::vector<ImageId> poses;
  std::vector<ImageId> centres;
  std::set<ImageId> anchored;  // all images of components tied to a world that is the model's own
};

// A prior takes part if it and others of its group determine all of reference_from_world in its
// component. Components that one group ties to its world become one.
PriorTies TieComponents(const BundlePriors& priors, std::map<ImageId, LinkedImage>& images);

// The parameter blocks of a bundle problem, in its working frame.
struct PriorTargets {
  std::map<ImageId, double*> poses;
  std::map<CameraId, double*> params;
  std::unordered_map<Point3DId, double*> points;
  Sim3d working_from_world;
};

// The residuals of priors in a bundle problem, and the parameters that only they have.
class PriorBlocks {
 public:
  // Adds to `problem`, which must not own its loss functions and keeps a reference to this.
  // Throws std::invalid_argument if a depth prior names an observation that does not exist.
  PriorBlocks(const BundlePriors& priors,
              const PriorTies& ties,
              const Reconstruction& reconstruction,
              const PriorTargets& targets,
              ceres::Problem& problem);
  PriorBlocks(const PriorBlocks&) = delete;
  PriorBlocks& operator=(const PriorBlocks&) = delete;

  // At the present parameters.
  BundlePriorsSummary Summarize() const;

  using ResidualBlockIds = std::vector<ceres::ResidualBlockId>;
  const ResidualBlockIds& rotations() const { return rotations_.residual_blocks; }
  const ResidualBlockIds& pose_centres() const { return pose_centres_.residual_blocks; }
  const ResidualBlockIds& centres() const { return centres_.residual_blocks; }
  const ResidualBlockIds& focal_lengths() const { return focal_lengths_.residual_blocks; }

 private:
  using SimilarityBlock = std::array<double, kNumSimilarityParams>;
  using ViewBlock = std::array<double, 2>;
  struct Group {
    std::vector<ceres::ResidualBlockId> residual_blocks;
    double initial_rms = 0.0;
    std::string message;
  };
  // An observation with a predicted depth, in the working frame.
  struct UsedDepth {
    DepthPrior prior;
    double* point = nullptr;
    double depth = 0.0;  // of the point at the start
  };

  void AddPoses(const std::vector<ImageId>& members, const Reconstruction& reconstruction);
  void AddCentres(const std::vector<ImageId>& members, const Reconstruction& reconstruction);
  void AddFocalLengths(const Reconstruction& reconstruction);
  void AddDepths(const Reconstruction& reconstruction);
  void AddDepthsOfView(ImageId image_id, const std::vector<UsedDepth>& used);
  void HoldView(double* view);
  std::vector<UsedDepth> UsableDepths(const Image& image, const std::vector<DepthPrior>& priors);
  SimilarityBlock StartOf(PriorWorld world, const std::optional<Sim3d>& reference_from_world) const;
  void HoldSimilarity(PriorWorld world, SimilarityBlock& block);
  void Add(Group& group,
           std::unique_ptr<ceres::CostFunction> cost,
           const std::vector<double*>& blocks);
  std::vector<double> ResidualsOf(const Group& group) const;
  PriorGroupSummary Summarize(const Group& group) const;

  const BundlePriors& priors_;
  const PriorTargets targets_;
  ceres::Problem& problem_;
  ceres::CauchyLoss loss_;
  SimilarityBlock poses_similarity_;    // reference_from_working
  SimilarityBlock centres_similarity_;  // likewise
  double log_depth_scale_ = 0.0;        // depth in the working frame per predicted depth
  std::map<ImageId, ViewBlock> depth_views_;
  Group rotations_, pose_centres_, centres_, focal_lengths_, depths_;
};

}  // namespace vgtw
