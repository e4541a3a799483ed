// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/pose_matching.h"

#include "bridge/import_photos.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

namespace vgtw {
namespace {

// For each pose of the estimate the one of the reference, or nullopt.
using Matches = std::vector<std::optional<size_t>>;

std::vector<Photo> NamesAsPhotos(const PoseSet& set) {
  std::vector<Photo> photos;
  for (const NamedPose& pose : set.poses) photos.push_back({pose.name, {}});
  return photos;
}

// The view that a name means: `exactly`, else also without folder and extension.
std::optional<size_t> FindView(const PhotoIndex& index,
                               const std::vector<Photo>& names,
                               const std::string& name,
                               bool exactly) {
  std::optional<size_t> idx = index.Find(name, /*without_extension=*/true);
  if (exactly) return idx && names[*idx].name == name ? idx : std::nullopt;
  const std::filesystem::path stem = std::filesystem::path(name).replace_extension();
  return idx ? idx : index.Find(stem.string(), /*without_extension=*/true);
}

Matches FindViews(const PoseSet& estimate, const PoseSet& reference, bool exactly) {
  const std::vector<Photo> names = NamesAsPhotos(reference);
  const PhotoIndex index(names);
  Matches matches;
  std::map<size_t, const std::string*> name_by_view;
  for (const NamedPose& pose : estimate.poses) {
    matches.push_back(FindView(index, names, pose.name, exactly));
    if (!matches.back()) continue;
    const auto [entry, is_new] = name_by_view.emplace(*matches.back(), &pose.name);
    if (is_new) continue;
    Fail(estimate.path,
         "'" + Printable(*entry->second) + "' and '" + Printable(pose.name) + "' both mean '" +
             Printable(names[entry->first].name) + "' of the reference",
         "one pose a view");
  }
  return matches;
}

// Where some names are equal, the others are other views.
Matches MatchNames(const PoseSet& estimate, const PoseSet& reference) {
  Matches matches = FindViews(estimate, reference, /*exactly=*/true);
  const bool none = std::none_of(
      matches.begin(), matches.end(), [](const auto& match) { return match.has_value(); });
  return none ? FindViews(estimate, reference, /*exactly=*/false) : matches;
}

Matches MatchTimes(const PoseSet& estimate, const PoseSet& reference, double max_difference_sec) {
  struct Candidate {
    double difference_sec;
    size_t estimate_idx;
    size_t reference_idx;
  };
  std::vector<Candidate> candidates;
  const std::vector<double>& times = reference.times_sec;
  for (size_t i = 0; i < estimate.times_sec.size(); ++i) {
    const double time = estimate.times_sec[i];
    const auto begin = std::lower_bound(times.begin(), times.end(), time - max_difference_sec);
    for (auto it = begin; it != times.end() && *it <= time + max_difference_sec; ++it) {
      candidates.push_back({std::abs(*it - time), i, static_cast<size_t>(it - times.begin())});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return std::tie(a.difference_sec, a.estimate_idx, a.reference_idx) <
           std::tie(b.difference_sec, b.estimate_idx, b.reference_idx);
  });
  Matches matches(estimate.times_sec.size());
  std::vector<bool> is_taken(times.size());
  for (const Candidate& candidate : candidates) {
    if (matches[candidate.estimate_idx] || is_taken[candidate.reference_idx]) continue;
    matches[candidate.estimate_idx] = candidate.reference_idx;
    is_taken[candidate.reference_idx] = true;
  }
  return matches;
}

Matches MatchOrders(const PoseSet& estimate, const PoseSet& reference) {
  if (estimate.poses.size() != reference.poses.size()) {
    Fail(estimate.path,
         "is " + std::string(Name(estimate.format)) + " of " +
             std::to_string(estimate.poses.size()) + " poses, the reference " +
             std::string(Name(reference.format)) + " of " + std::to_string(reference.poses.size()),
         "as many, which then belong together in their order",
         "write image names in the first column of a TUM trajectory");
  }
  Matches matches;
  for (size_t i = 0; i < estimate.poses.size(); ++i) matches.emplace_back(i);
  return matches;
}

// Whether every label of the trajectory names a view of the other.
bool AllAreNames(const PoseSet& trajectory, const PoseSet& named) {
  if (trajectory.key == PoseKey::kLine || named.key != PoseKey::kImageName) return false;
  const Matches matches = FindViews(trajectory, named, /*exactly=*/false);
  return std::all_of(
      matches.begin(), matches.end(), [](const auto& match) { return match.has_value(); });
}

std::string OrderNote(const PoseSet& estimate, const PoseSet& reference) {
  return "poses matched by order: those of the estimate by " +
         std::string(OrderName(estimate.key)) + ", those of the reference by " +
         std::string(OrderName(reference.key));
}

void NoteOtherNames(const PoseSet& estimate,
                    const PoseSet& reference,
                    const Matches& matches,
                    MatchedPoses& matched) {
  size_t num_inexact = 0;
  std::string example;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (!matches[i]) continue;
    const std::string& expected = reference.poses[*matches[i]].name;
    if (estimate.poses[i].name == expected || num_inexact++ > 0) continue;
    example = "'" + Printable(estimate.poses[i].name) + "' as '" + Printable(expected) + "'";
  }
  if (num_inexact == 0) return;
  matched.notes.push_back(std::to_string(num_inexact) +
                          " names matched without folder or extension: " + example + ", ...");
}

}  // namespace

MatchedPoses MatchPoses(const PoseSet& estimate,
                        const PoseSet& reference,
                        double max_time_difference_sec) {
  VGTW_CHECK(max_time_difference_sec >= 0.0, "max_time_difference_sec must be >= 0");
  const auto both_are = [&](PoseKey key) { return estimate.key == key && reference.key == key; };
  MatchedPoses matched;
  Matches matches;
  if (both_are(PoseKey::kTimestamp)) {
    matches = MatchTimes(estimate, reference, max_time_difference_sec);
  } else if (both_are(PoseKey::kImageName) || AllAreNames(estimate, reference) ||
             AllAreNames(reference, estimate)) {
    matches = MatchNames(estimate, reference);
    NoteOtherNames(estimate, reference, matches, matched);
  } else {
    matches = MatchOrders(estimate, reference);
    matched.notes.push_back(OrderNote(estimate, reference));
  }
  for (size_t i = 0; i < matches.size(); ++i) {
    if (!matches[i]) {
      ++matched.num_surplus;
      continue;
    }
    matched.estimate.push_back(
        {reference.poses[*matches[i]].name, estimate.poses[i].cam_from_world});
  }
  return matched;
}

}  // namespace vgtw
