// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_vote_folder.h"

#include "bridge/mask_files.h"
#include "scene/error.h"

#include <algorithm>
#include <list>
#include <memory>
#include <string>
#include <utility>

namespace vgtw {
namespace {

constexpr int kCoarseStride = 4;

// The views that were used last.
class ViewCache {
 public:
  ViewCache(const PredictionReader& predictions, const VoteOnMasksOptions& options)
      : predictions_(predictions), options_(options) {}

  // Valid until max_cached_views - 1 other views were asked for.
  const VoteView& Get(size_t idx) {
    const auto found = std::find_if(
        views_.begin(), views_.end(), [idx](const auto& entry) { return entry.first == idx; });
    if (found != views_.end()) {
      views_.splice(views_.begin(), views_, found);
    } else {
      if (views_.size() == static_cast<size_t>(options_.max_cached_views)) views_.pop_back();
      views_.emplace_front(idx, VoteView(Load(idx), options_.vote));
      max_size_ = std::max(max_size_, views_.size());
    }
    return views_.front().second;
  }

  ViewPrediction Load(size_t idx) {
    ++num_loads_;
    return predictions_.Load(idx);
  }

  size_t num_loads() const { return num_loads_; }
  size_t max_size() const { return max_size_; }

 private:
  const PredictionReader& predictions_;
  const VoteOnMasksOptions& options_;
  std::list<std::pair<size_t, VoteView>> views_;  // the last used one first
  size_t num_loads_ = 0;
  size_t max_size_ = 0;
};

struct Poll {
  const VoteView* view = nullptr;
  size_t num_voters = 0;
  Votes votes;
};

class Voting {
 public:
  Voting(const PredictionReader& predictions, const VoteOnMasksOptions& options)
      : predictions_(predictions), options_(options), cache_(predictions, options) {}

  Poll Ask(size_t idx, int stride) {
    Poll poll = {&cache_.Get(idx), 0, {}};
    const auto depth = MedianDepth(poll.view->depth());
    if (!depth) return poll;
    std::vector<const VoteView*> voters;
    for (const size_t i :
         SelectVoters(predictions_.views(), idx, *depth, options_.vote.max_views)) {
      const VoteView& voter = cache_.Get(i);
      if (!voter.depth().empty()) voters.push_back(&voter);
    }
    poll.num_voters = voters.size();
    poll.votes = CountVotes(*poll.view, voters, options_.vote, options_.num_threads, stride);
    return poll;
  }

  ViewCache& cache() { return cache_; }

 private:
  const PredictionReader& predictions_;
  const VoteOnMasksOptions& options_;
  ViewCache cache_;
};

double MaskedShare(const DistractorMask& distractor, double threshold) {
  if (distractor.empty()) return 0.0;
  const auto num_masked =
      std::count_if(distractor.data().begin(), distractor.data().end(), [&](float probability) {
        return probability >= threshold;
      });
  return static_cast<double>(num_masked) / static_cast<double>(distractor.size());
}

// Changes the masks of `prediction` by the votes on it.
ViewVoteSummary Decide(const Poll& poll,
                       const MaskVoteOptions& options,
                       bool may_release,
                       ViewPrediction& prediction) {
  ViewVoteSummary summary = {.image_name = prediction.view.name};
  summary.masked_share_before = MaskedShare(prediction.distractor, options.distractor_threshold);
  if (poll.votes.num_consistent.empty()) return summary;
  const MaskChanges changes = ApplyVotes(poll.votes, options, may_release, prediction.distractor);
  const auto num_pixels = static_cast<double>(prediction.distractor.size());
  summary.num_voters = poll.num_voters;
  summary.released_share = static_cast<double>(changes.num_released) / num_pixels;
  summary.added_share = static_cast<double>(changes.num_added) / num_pixels;
  return summary;
}

}  // namespace

void VoteOnMasksOptions::Check() const {
  vote.Check();
  VGTW_CHECK(max_cached_views > vote.max_views,
             "VoteOnMasksOptions::max_cached_views = " + std::to_string(max_cached_views) +
                 ", must be above max_views = " + std::to_string(vote.max_views));
}

VoteOnMasksSummary VoteOnMasks(const PredictionReader& predictions,
                               const std::filesystem::path& output_folder,
                               const VoteOnMasksOptions& options,
                               const ProgressCallback& progress) {
  options.Check();
  CheckNotInput(output_folder, predictions.folder());
  PredictionWriter writer(
      output_folder, predictions.producer(), predictions.weights_hash(), options.overwrite);
  Voting voting(predictions, options);
  VoteOnMasksSummary summary;
  const size_t num_views = predictions.views().size();
  int64_t num_done = 0;
  const auto count_done = [&] {
    if (progress) progress(++num_done, static_cast<int64_t>(2 * num_views));
  };
  bool has_depth = false;
  for (size_t i = 0; i < num_views; ++i) {
    const Poll poll = voting.Ask(i, kCoarseStride);
    has_depth |= !poll.votes.num_consistent.empty();
    summary.masked += JudgeMasked(*poll.view, poll.votes, options.vote);
    count_done();
  }
  if (!has_depth) {
    Fail(predictions.folder(),
         "holds no depth of any view",
         "depth maps or maps of points",
         "import dense predictions");
  }
  summary.may_release = MayRelease(summary.masked, options.vote);
  for (size_t i = 0; i < num_views; ++i) {
    const Poll poll = voting.Ask(i, 1);
    ViewPrediction prediction = voting.cache().Load(i);
    summary.views.push_back(Decide(poll, options.vote, summary.may_release, prediction));
    writer.Add(prediction);
    count_done();
  }
  writer.Commit();
  summary.num_loads = voting.cache().num_loads();
  summary.max_views_held = voting.cache().max_size();
  return summary;
}

}  // namespace vgtw
