// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/importer.h"
#include "bridge/photo_detail.h"
#include "bridge/photo_order.h"

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Detectors of the four classic mistakes: poses taken the wrong way round, OpenGL camera axes, the
// other order of quaternions, photos in another order. They change nothing. Each compares what was
// read with what an alternative would give, and speaks only where the alternative is far better:
//   anchors   points that the file ties to pixels of a view, projected into that view
//   flow      depth of a view, carried into another view, against the depth there, and the photos'
//             detail at both ends
//   order     detail at both ends of the flow under other assignments of photos to views
// Without depth and anchors (trajectories, LLFF) nothing can be decided here. Where the cameras
// hardly move, or look alike under an alternative, the data do not decide and nothing is said.
// Views that carry shuffled poses but their own depth and photo are not recognised as shuffled.

// What the detectors keep of one view.
struct ConventionProbe {
  View view;
  FilePose pose;
  std::vector<Anchor> anchors;
  // Camera coordinates of some depth samples, and their pixels relative to the photo's size.
  std::vector<Eigen::Vector3d> points_in_cam;
  std::vector<Eigen::Vector2d> positions;
  DepthMap depth;  // empty where only samples are known
};

// How well the views agree under one reading of the poses.
struct FlowAgreement {
  size_t num_samples = 0;   // samples times other views
  size_t num_hits = 0;      // that fall into the other view
  size_t num_agreeing = 0;  // and agree with its depth, where that is known
  double correlation =
      0.0;  // of the detail at both ends, mean over pairs of views by agreeing hits
};

class ConventionCheck {
 public:
  explicit ConventionCheck(const ImportJob& job);

  // Reads the photo of a view if the view is one of those to look at (16, in runs of neighbours).
  void Add(const ImportedView& imported);

  // One line a mistake, with the option that mends it; empty if nothing is suspicious.
  std::vector<std::string> FindMistakes();

 private:
  void ReadDetail(size_t photo_idx);
  std::vector<const PhotoDetail*> DetailsOfProbes() const;
  std::optional<std::string> FindWrongPoses() const;
  std::optional<std::string> FindWrongOrder();
  std::string OrderText(const PhotoOrder& order,
                        bool is_natural,
                        const std::vector<size_t>& photos) const;

  const ImportJob& job_;
  std::vector<bool> is_probed_;  // by photo
  std::vector<ConventionProbe> probes_;
  std::map<size_t, PhotoDetail> details_;  // by photo
  std::vector<size_t> photo_indices_;      // by probe
};

// The median distance of the anchors of a view from their median offset, in pixels: a constant
// shift of an exporter does not count. Infinite if most are behind the camera or there are none.
double AnchorSpread(const ConventionProbe& probe, const ConventionRepair& repair);

FlowAgreement MeasureFlow(const std::vector<ConventionProbe>& probes,
                          const std::vector<const PhotoDetail*>& details,
                          const ConventionRepair& repair);

// The reading under which poses agree far better than as read, or nullopt. Needs one probe at
// least.
std::optional<ConventionRepair> FindBetterReading(const std::vector<ConventionProbe>& probes,
                                                  const std::vector<const PhotoDetail*>& details,
                                                  const ConventionRepair& as_read);

}  // namespace vgtw
