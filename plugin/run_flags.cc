// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/run_flags.h"

namespace vgtw {

void RunFlags::Declare(Flags& flags) {
  mask_.Declare(flags);
  flags.Group("Features and matches")
      .Add("colmap", &options_.colmap, "The colmap executable; empty = the one on PATH")
      .AddChoice("matcher",
                 &matcher_,
                 {"guided", "colmap", "sequential"},
                 "guided = our SIFT, matched where the predictions put it; colmap = its SIFT and "
                 "exhaustive matcher; sequential = its SIFT and sequential matcher")
      .Add("sequential_overlap", &options_.sequential_overlap, "Neighbours of a sequence")
      .Add("use_gpu", &options_.use_gpu, "Let colmap use its GPU code");
  match_.Declare(flags);
  flags.Group("Cameras")
      .AddChoice("camera_model",
                 &camera_model_,
                 {"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"},
                 "Lens of photos that were predicted as pinholes")
      .Add("shared_camera", &options_.shared_camera, "One camera for all photos of a size");
  refine_.Declare(flags);
}

void RunFlags::ApplyTo(PipelineOptions& options) const {
  options.mask = mask_.Options();
  options.colmap = options_.colmap;
  options.matcher = matcher_ == "colmap"       ? Matcher::kColmap
                    : matcher_ == "sequential" ? Matcher::kSequential
                                               : Matcher::kGuided;
  options.sequential_overlap = options_.sequential_overlap;
  match_.ApplyTo(options.sift, options.match);
  options.use_gpu = options_.use_gpu;
  options.camera_model = *FindCameraModel(camera_model_);
  options.shared_camera = options_.shared_camera;
  refine_.ApplyTo(options.refine);
  options.priors = refine_.priors();
  options.priors.errors = match_.errors();
}

}  // namespace vgtw
