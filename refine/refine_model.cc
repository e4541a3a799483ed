// SPDX-License-Identifier: BSD-3-Clause
#include "refine/refine_model.h"

#include "refine/refinement.h"
#include "scene/error.h"

#include <algorithm>
#include <string>

namespace vgtw {
namespace {

// The views and cameras that can be used.
Reconstruction UsableViews(const Reconstruction& seed) {
  Reconstruction usable = seed;
  for (const auto& [id, image] : seed.images) {
    if (FindFault(image.cam_from_world).empty() &&
        FindFault(seed.cameras.at(image.camera_id)).empty()) {
      continue;
    }
    RemoveObservationsOf(id, usable);
    usable.images.erase(id);
    usable.rigs.clear();
    usable.frames.clear();
  }
  std::erase_if(usable.cameras, [](const auto& entry) { return !FindFault(entry.second).empty(); });
  return usable;
}

}  // namespace

void RefineModelOptions::Check() const {
  VGTW_CHECK(max_num_rounds >= 1, "RefineModelOptions::max_num_rounds");
  VGTW_CHECK(held_out_percent > 0.0 && held_out_percent <= 50.0,
             "RefineModelOptions::held_out_percent = " + std::to_string(held_out_percent) +
                 ", must be in (0, 50]");
  VGTW_CHECK(max_turn_deg > 0.0 && max_turn_deg <= 180.0,
             "RefineModelOptions::max_turn_deg = " + std::to_string(max_turn_deg) +
                 ", must be in (0, 180]");
  VGTW_CHECK(max_seconds >= 0.0,
             "RefineModelOptions::max_seconds = " + std::to_string(max_seconds) + ", must be >= 0");
  TriangulationOptions{max_error_px, min_angle_deg, num_threads}.Check();
}

std::string_view Name(ViewOutcome outcome) {
  switch (outcome) {
    case ViewOutcome::kRefined:
      return "refined";
    case ViewOutcome::kRejected:
      return "rejected";
    case ViewOutcome::kKept:
      break;
  }
  return "kept";
}

bool RefineModelResult::IsRefined() const {
  return std::any_of(views.begin(), views.end(), [](const auto& entry) {
    return entry.second.outcome == ViewOutcome::kRefined;
  });
}

RefineModelResult RefineModel(const RefineModelOptions& options,
                              const Reconstruction& seed,
                              const std::vector<Track>& tracks) {
  options.Check();
  const Reconstruction usable = UsableViews(seed);
  const std::vector<Track> usable_tracks =
      TracksIn(tracks, [&](ImageId id) { return usable.images.contains(id); });
  return Refinement(options, usable, usable_tracks).Run();
}

}  // namespace vgtw
