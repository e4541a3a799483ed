// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/held_out.h"
#include "refine/refine_model.h"
#include "refine/refine_round.h"

#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace vgtw {

// Poses and intrinsics with the errors of what is held out under them.
struct Judged {
  Reconstruction model;
  HeldOutJudge::Errors errors;
  double mean_px = 0.0;
};

// Views that take no part in a round.
struct ExcludedViews {
  std::set<ImageId> held;
  std::map<ImageId, double> refined_px;  // error of those that were worse when they took part
  std::set<ImageId> trusted;             // take part, whatever is found
};

// Whether the poses differ in a bit.
bool HasMoved(const Rigid3d& before, const Rigid3d& after);

// One call of RefineModel (refine/refine_model.h). Keeps references to the arguments.
class Refinement {
 public:
  Refinement(const RefineModelOptions& options,
             const Reconstruction& seed,
             const std::vector<Track>& tracks);

  RefineModelResult Run();

 private:
  Judged Judge(Reconstruction model) const;
  // Adjusts `model` without the images in `held`; nullopt if nothing could be adjusted.
  std::optional<Judged> Attempt(const RefineModelOptions& options,
                                Reconstruction model,
                                const RoundLimits& limits,
                                const std::set<ImageId>& held,
                                BundlePriors& priors,
                                RoundOutcome& outcome);
  // Reports an iteration; whether there is time for it.
  bool GoesOn();
  bool IsLate() const;
  bool IsAsGood(const Judged& candidate) const;
  // Where the observations hardly determine the intrinsics, these take up noise and the poses with
  // them: those of the seed stay unless what is held out asks for others.
  bool AreIntrinsicsWeak() const;
  void TryFewerIntrinsics(const RoundLimits& limits);
  // One round, repeated without the views that it leaves worse. Whether it is worth another one.
  bool RunRound(RoundLimits& limits);
  // Whether no round came to a model.
  bool HasFoundNothing() const;
  // Views of an adjusted model that are worse than before.
  std::set<ImageId> FindWorseViews(const Judged& candidate, const RoundOutcome& outcome) const;
  // Those whose poses tracks held out confirm.
  std::set<ImageId> FindConfirmedViews(const Judged& candidate) const;
  // Those that turned too far to be believed, and why.
  std::map<ImageId, std::string> FindTurnedViews(const Judged& candidate,
                                                 const RoundOutcome& outcome) const;
  // Whether the views that are held changed, after a look at what came of holding them.
  bool Exclude(const Judged& candidate, const RoundOutcome& outcome, ExcludedViews& excluded);
  double MaxTurnDeg(ImageId image_id) const;
  std::map<ImageId, double> TurnsDeg(const Reconstruction& model) const;
  void DescribeViews(RefineModelResult& result) const;
  std::string TooFewSupporting(size_t num) const;
  void AddUncertainty(RefineModelResult& result) const;
  // Returns the last good model with the points of all tracks.
  Reconstruction PutBackUnsupported();
  RoundLimits FirstLimits() const;
  Reconstruction TriangulateAll(const Reconstruction& poses,
                                const std::map<ImageId, double>& max_error_px = {}) const;

  const std::chrono::steady_clock::time_point start_time_ = std::chrono::steady_clock::now();
  const RefineModelOptions& options_;
  const Reconstruction& seed_;
  const std::vector<Track>& tracks_;
  const SplitTracks split_;
  const RoundLimits first_limits_;
  const HeldOutJudge judge_;
  BundlePriors priors_;  // with the sigmas that the last good model shows
  Judged good_;
  const HeldOutJudge::Errors seed_errors_;
  const double start_px_;
  std::map<ImageId, std::string> rejected_;  // and why
  std::vector<RefineRound> rounds_;
  int num_iterations_of_round_ = 0;
};

}  // namespace vgtw
