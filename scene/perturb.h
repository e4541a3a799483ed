// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/prediction.h"

#include <cstdint>

namespace vgtw {

// Errors as feed-forward networks make them. Defaults are of the size measured for VGGT on LLFF
// fern (0.2 deg, 2 % of the camera extent, 2 % focal length, 1.2 % depth).
struct PerturbOptions {
  double rotation_deg = 0.2;         // sigma of the rotation angle per view, random axis
  double centre_percent = 2.0;       // rms length of the centre offset, % of the camera extent
  double focal_percent = 2.0;        // sigma of the relative focal error per view
  double depth_scale_percent = 1.0;  // sigma of the relative depth scale per view
  double depth_noise_percent = 1.2;  // sigma of smooth (low-frequency) relative depth noise
  double mask_flip_percent = 0.0;    // share of distractor blobs that are missed, and of static
                                     // blobs of the same size that are marked
  double mask_edge_px = 0.0;         // sigma of the shift of mask edges, network pixels
  bool random_world = true;          // moves the whole prediction by a random similarity, as the
                                     // world of a network is arbitrary
  uint64_t seed = 0;

  void Check() const;
};

// A copy of `truth` with these errors; dense depth_samples and points follow the changed depth
// where present. Deterministic by seed.
Prediction Perturb(const Prediction& truth, const PerturbOptions& options);

}  // namespace vgtw
