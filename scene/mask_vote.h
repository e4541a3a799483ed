// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/grid.h"
#include "scene/prediction.h"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Multi-view consistency of distractor masks, after the depth residual |d' - D_j(p')| of VGTW,
// section 3.2. A pixel of view i with known depth, lifted to X, lies at depth z in view j, which
// sees the depth D there; with the relative residual r = (D - z) / z and the tolerance tau
//   |r| <= tau  consistent   j sees the surface that i sees
//   r > tau     see-through  j looks through the place of X: X is not there in j's photo
//   r < -tau    occluded     no vote
// A consistent vote counts only where j itself calls the pixel static, lest two photos of one
// standing person set each other free; a see-through vote counts everywhere, for whatever j sees
// lies behind X. Unknown depth, depth edges and what lies outside of j's map give no vote.
//
// This cannot work where
// - a mover stands still in several of the views: a right mask stays if the others' masks are
//   right, but a missing one is not found;
// - depths are wrong by more than the tolerance and two views agree on that: static pixels are
//   masked;
// - the depth of a masked area is that of the static scene behind the distractor: it agrees with
//   the other views just as static pixels do (see MayRelease);
// - movers touch static surfaces: within the tolerance, feet agree with the ground.
struct MaskVoteOptions {
  // A pixel is masked from this distractor probability on; in (0, 1].
  double distractor_threshold = 0.5;
  // tau is the larger of `max_relative_depth_difference` and `noise_factor` times the noise (sigma)
  // between the depths of the two views, as their residuals on static pixels show it; both are
  // relative, in (0, 1) and [0, 100].
  double max_relative_depth_difference = 0.05;
  double noise_factor = 2.0;
  // A pixel is a depth edge if the depths of its 3x3 neighbours differ relatively by more than
  // this; in (0, 10].
  double max_relative_step = 0.1;
  // What errors of poses and intrinsics amount to: a view looks through X only if it does so
  // everywhere within this many network pixels along x and y; in [0, 1000].
  int position_error_px = 4;
  // A pixel's verdict is "static" with so many consistent votes, if at most this share of its votes
  // looks through, and "distractor" with so many see-through votes, if they outnumber the
  // consistent ones. Both >= 1; the share in [0, 1).
  int min_consistent = 2;
  double max_see_through_share = 0.1;
  int min_see_through = 2;
  // A mask changes where the opposite verdict has the majority of the square of this edge length
  // around the pixel (network pixels), which fills gaps and drops specks; odd, in [1, 1001].
  int window_px = 5;
  // See MayRelease; in [0, 1].
  double min_see_through_masked_share = 0.2;
  // Views that vote on a view; in [1, 1000].
  int max_views = 8;

  void Check() const;
};

// What of a view takes part in votes.
class VoteView {
 public:
  // Depth comes from the depth map, else from the z of the map of points; else no pixel has one.
  // Without a distractor map every pixel is static; a pixel of unknown probability is neither
  // static nor masked.
  VoteView(const ViewPrediction& prediction, const MaskVoteOptions& options);

  const View& view() const { return view_; }
  const DepthMap& depth() const { return depth_; }  // empty if there is none
  bool IsMasked(int x, int y) const { return mask_(x, y) == MaskState::kMasked; }
  bool IsDepthEdge(int x, int y) const;  // or unknown

  // A point as the view sees it. NaN = no vote.
  struct Sighting {
    float residual;   // r to the range of depths of 3x3 pixels: 0 within it
    float clearance;  // r to the nearest depth within the position error
    bool is_static;   // says the view's own mask
  };
  std::optional<Sighting> See(const Eigen::Vector3d& point_in_world) const;

 private:
  enum class MaskState : uint8_t { kUnknown, kStatic, kMasked };

  View view_;
  PixelMap network_from_original_;
  DepthMap depth_;
  DepthMap nearest_;         // of 3x3 pixels; NaN at edges and where depth is unknown
  DepthMap farthest_;        // as above
  DepthMap nearest_around_;  // within the position error; NaN where depth is unknown
  Grid<MaskState> mask_;
};

// Per pixel of one view, [H,W] in its network pixels.
struct Votes {
  Grid<uint16_t> num_consistent;
  Grid<uint16_t> num_see_through;
};

// The votes of `others` on the pixels of `view`; with a stride, only on those whose x and y are
// multiples of it. The order of `others` does not matter.
Votes CountVotes(const VoteView& view,
                 const std::vector<const VoteView*>& others,
                 const MaskVoteOptions& options,
                 int num_threads = 1,
                 int stride = 1);

enum class Verdict : int8_t { kStatic = -1, kNone = 0, kDistractor = 1 };
Verdict Judge(int num_consistent, int num_see_through, const MaskVoteOptions& options);

// Verdicts on masked pixels, summed over views.
struct MaskedVerdicts {
  uint64_t num_static = 0;
  uint64_t num_distractor = 0;

  MaskedVerdicts& operator+=(const MaskedVerdicts& other);
};
MaskedVerdicts JudgeMasked(const VoteView& view,
                           const Votes& votes,
                           const MaskVoteOptions& options);

// A network may see the static scene behind a distractor in place of the distractor. Its masks then
// look all wrong, though the depth has no evidence for that. Hence nothing is released unless at
// least min_see_through_masked_share of the verdicts on the masked pixels of all views is
// "distractor", which shows that depth follows what is masked.
bool MayRelease(const MaskedVerdicts& verdicts, const MaskVoteOptions& options);

struct MaskChanges {
  uint64_t num_released = 0;  // pixels
  uint64_t num_added = 0;
};

// Sets released pixels of `distractor` to 0, added ones to 1, leaves all others as they are. An
// empty one becomes a map of 0 first. Throws std::invalid_argument if it is not of the votes' size.
MaskChanges ApplyVotes(const Votes& votes,
                       const MaskVoteOptions& options,
                       bool may_release,
                       DistractorMask& distractor);

// Indices of the at most max_views other views that share most with the idx-th one, ascending:
// those with the smallest sum of distance / `scene_depth` and angle (radians) between the axes,
// which bounds how far a point of that depth moves between the images.
std::vector<size_t> SelectVoters(const std::vector<View>& views,
                                 size_t idx,
                                 double scene_depth,
                                 int max_views);

// Middle of the known depths; nullopt if none is known.
std::optional<double> MedianDepth(const DepthMap& depth);

}  // namespace vgtw
