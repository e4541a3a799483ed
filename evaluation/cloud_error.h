// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct CloudErrorOptions {
  // Normals are taken from that many nearest points, the point itself among them; >= 3. 30 is what
  // the evaluations of Spann3R, CUT3R and pi3 use.
  int num_normal_neighbours = 30;
  // Distance within which a point counts as right, for precision, recall and F; > 0, scene units.
  double f_distance = 0.05;
  // Larger distances count as this one; 0 = none is limited.
  double clip_distance = 0.0;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

// From every point of one cloud to its nearest in the other.
struct DirectedCloudError {
  size_t num_points = 0;
  size_t num_clipped = 0;
  double mean = 0.0;    // scene units
  double median = 0.0;  // scene units
  double share_within_f_distance = 0.0;
  // |cosine| between the normals of a point and of its nearest, over the pairs where both are
  // defined (see PointTree::Normals); NaN if there are none.
  size_t num_normals = 0;
  double normal_mean = 0.0;
  double normal_median = 0.0;
};

// Law: both clouds moved by one motion leave it as it is; exchanging them exchanges accuracy and
// completeness.
struct CloudError {
  DirectedCloudError accuracy;      // from prediction to reference: Acc, precision, NC1
  DirectedCloudError completeness;  // from reference to prediction: Comp, recall, NC2

  double Overall() const;                  // (Acc + Comp) / 2 of the means
  double NormalConsistencyMean() const;    // (NC1 + NC2) / 2 of the means
  double NormalConsistencyMedian() const;  // of the medians
  double F() const;                        // 2 P R / (P + R), 0 if both are 0
};

// Both clouds in the reference's frame and units. No voxel grid, normals unsigned.
// Throws std::invalid_argument if a cloud is empty or has a point that is not finite.
CloudError CompareClouds(const std::vector<Eigen::Vector3d>& prediction,
                         const std::vector<Eigen::Vector3d>& reference,
                         const CloudErrorOptions& options = {});

}  // namespace vgtw
