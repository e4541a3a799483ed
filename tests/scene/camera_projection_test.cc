// SPDX-License-Identifier: BSD-3-Clause
// COLMAP itself as the judge of Project: its bundle_adjuster prints the cost of the model it is
// given, and that is zero only if both project alike.
#include "scene/camera.h"
#include "scene/files.h"
#include "scene/rigid3d.h"
#include "tests/scene/sample_cameras.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <cstdlib>
#include <iomanip>
#include <sstream>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Points up to 43 degrees off the axis of either camera; different heights, so that both
// coordinates count.
std::vector<Eigen::Vector3d> MakePoints() {
  std::vector<Eigen::Vector3d> points;
  for (int y = -3; y <= 3; ++y) {
    for (int x = -3; x <= 3; ++x) points.emplace_back(0.22 * x, 0.18 * y, 1.0 + 0.01 * (x + 2 * y));
  }
  return points;
}

std::vector<Rigid3d> MakePoses() {
  const Eigen::Quaterniond turn = RotationAboutAxis(Eigen::Vector3d(1, 2, 3).normalized(), 5.0);
  return {Rigid3d{}, Rigid3d{turn, Eigen::Vector3d(-0.1, 0.05, 0.02)}};
}

// COLMAP's text reader takes exactly one space between numbers.
const Eigen::IOFormat kRow(Eigen::StreamPrecision, Eigen::DontAlignCols, " ", " ");

std::ostringstream MakeStream() {
  std::ostringstream stream;
  stream << std::setprecision(17);
  return stream;
}

std::string CamerasText(const Camera& camera) {
  std::ostringstream text = MakeStream();
  text << "1 " << GetCameraModelInfo(camera.model).name << ' ' << camera.width << ' '
       << camera.height;
  for (const double param : camera.params) text << ' ' << param;
  text << '\n';
  return text.str();
}

std::string ImagesText(const Camera& camera) {
  std::ostringstream text = MakeStream();
  int image_id = 0;
  for (const Rigid3d& cam_from_world : MakePoses()) {
    const Eigen::Quaterniond& q = cam_from_world.rotation;
    ++image_id;
    text << image_id << ' ' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' '
         << cam_from_world.translation.format(kRow) << " 1 " << image_id << ".png\n";
    int point3D_id = 0;
    for (const Eigen::Vector3d& point : MakePoints()) {
      text << Project(camera, cam_from_world * point).value().format(kRow) << ' ' << ++point3D_id
           << ' ';
    }
    text << '\n';
  }
  return text.str();
}

std::string Points3DText() {
  std::ostringstream text = MakeStream();
  int point2D_idx = 0;
  for (const Eigen::Vector3d& point : MakePoints()) {
    text << point2D_idx + 1 << ' ' << point.format(kRow) << " 0 0 0 0 1 " << point2D_idx << " 2 "
         << point2D_idx << '\n';
    ++point2D_idx;
  }
  return text.str();
}

// COLMAP's root mean square error, in pixels, of observations by `observed` in a model whose camera
// is `stated`; NaN if it printed none.
double ColmapErrorPx(const Camera& observed, const Camera& stated) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "cameras.txt", CamerasText(stated));
  WriteFileAtomically(folder / "images.txt", ImagesText(observed));
  WriteFileAtomically(folder / "points3D.txt", Points3DText());
  const ColmapRun run = RunColmap({"bundle_adjuster",
                                   "--input_path",
                                   folder.path().string(),
                                   "--output_path",
                                   folder.path().string(),
                                   "--BundleAdjustment.max_num_iterations",
                                   "0"});
  const std::string label = "Initial cost : ";
  const size_t found = run.output.find(label);
  if (found == std::string::npos) return std::nan("");
  return std::strtod(run.output.c_str() + found + label.size(), nullptr);
}

TEST(CameraProjection, ColmapAgreesInEveryModel) {
  VGTW_NEED_COLMAP();
  for (const Camera& camera : SampleCameras()) {
    // Text with 17 digits carries a pixel to 1e-13; COLMAP prints 6 significant digits.
    EXPECT_LT(ColmapErrorPx(camera, camera), 1e-11) << GetCameraModelInfo(camera.model).name;
  }
}

TEST(CameraProjection, ColmapNoticesEveryParameter) {
  VGTW_NEED_COLMAP();
  // The judge must be able to say no: THIN_PRISM_FISHEYE holds every kind of parameter.
  const Camera camera = SampleCameras().back();
  for (size_t i = 0; i < camera.params.size(); ++i) {
    Camera wrong = camera;
    wrong.params[i] += 1e-4 * std::max(1.0, std::abs(wrong.params[i]));
    EXPECT_GT(ColmapErrorPx(camera, wrong), 1e-5) << "parameter " << i;
  }
}

}  // namespace
}  // namespace vgtw
