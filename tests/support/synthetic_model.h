// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/reconstruction.h"

#include <random>

namespace vgtw {

// A camera of 640 x 480 pixels with a plausible value for each parameter of the model.
Camera MakeTestCamera(CameraModel model);

struct SyntheticModelOptions {
  int num_images = 6;
  int num_points = 120;
  CameraModel camera_model = CameraModel::kPinhole;
  bool shared_camera = false;
  bool planar = false;    // all points in one plane
  double arc_deg = 90.0;  // length of the arc of radius 4 on which the cameras stand
  unsigned seed = 0;
};

// Cameras on an arc that look at points in a box around the origin, every point seen by every
// camera; points2D are the exact projections, so that every residual is zero up to rounding.
Reconstruction MakeSyntheticModel(const SyntheticModelOptions& options);

// Sets every tracked point2D to the projection of its point, plus Gaussian noise of `sigma_px`.
void ProjectAgain(Reconstruction& reconstruction, double sigma_px, unsigned seed);

// Turns every camera by `rotation_deg` (sigma, random axis) and moves its centre by
// `centre_distance` (rms length), in place; images whose id is `kept_image_id` stay.
void PerturbPoses(Reconstruction& reconstruction,
                  double rotation_deg,
                  double centre_distance,
                  unsigned seed,
                  ImageId kept_image_id = 0);

// Moves every point by Gaussian noise of rms length `distance`.
void PerturbPoints(Reconstruction& reconstruction, double distance, unsigned seed);

}  // namespace vgtw
