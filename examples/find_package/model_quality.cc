// SPDX-License-Identifier: BSD-3-Clause
// Reads a COLMAP model and prints how well its points project onto their observations, over all and
// for each image. Run on model/, whose two images see two points, it prints model_quality.txt:
//   camera 1 is PINHOLE with f = 100 px, principal point (50, 50); image b stands 0.2 to the right.
//   (0, 0, 2) projects to (50, 50) and (40, 50), (0.5, 0, 2) to (75, 50) and (65, 50),
//   which the observations miss by 0, 5, 1 and 2 pixels.
#include <cstdio>

#include <bridge/colmap_model.h>
#include <scene/error.h>
#include <scene/reprojection.h>

namespace {

void PrintImage(const vgtw::Reconstruction& reconstruction, const vgtw::Image& image) {
  double worst_px = 0.0;
  for (const vgtw::Point2D& point2D : image.points2D) {
    if (!point2D.HasPoint3D()) continue;
    const std::optional<double> error_px = vgtw::ReprojectionError(reconstruction, image, point2D);
    if (error_px.has_value()) worst_px = std::max(worst_px, *error_px);
  }
  std::printf("%s: worst %.3f px\n", image.name.c_str(), worst_px);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s MODEL_FOLDER\n", argv[0]);
    return 2;
  }
  try {
    const vgtw::Reconstruction reconstruction = vgtw::ReadModel(argv[1]);
    const vgtw::ReprojectionStats stats = vgtw::ComputeReprojectionStats(reconstruction);
    std::printf("%zu images, %zu points, %zu observations\n",
                stats.num_images,
                stats.num_points3D,
                stats.num_observations);
    std::printf("reprojection error: median %.3f px, mean %.3f px, 90 %% below %.3f px\n",
                stats.median_px,
                stats.mean_px,
                stats.p90_px);
    for (const auto& [image_id, image] : reconstruction.images) PrintImage(reconstruction, image);
    return 0;
  } catch (const vgtw::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
