// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/sim3d.h"
#include "scene/statistics.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Columns down, right, backwards of a camera that looks along world +z with y down: (0,1,0),
// (1,0,0), (0,0,-1); centre (7, 8, 9); photo 60x120 pixels in the file, f = 100.
const std::vector<double> kRow = {0,
                                  1,
                                  0,
                                  7,
                                  60,  //
                                  1,
                                  0,
                                  0,
                                  8,
                                  120,  //
                                  0,
                                  0,
                                  -1,
                                  9,
                                  100,
                                  1.5,
                                  30};

struct Case {
  TemporaryFolder folder;
  explicit Case(const std::string& shape, const std::vector<double>& values) {
    WritePhotos(folder / "photos", {"a.png"}, 80, 40);
    std::filesystem::create_directories(folder / "llff");
    WriteFileAtomically(folder / "llff" / "poses_bounds.npy", NpyDoubles(shape, values));
  }
  ImportSummary Run() { return Import(folder / "llff", folder / "photos", folder / "out", {}); }
};

TEST(ImportLlff, AxesAndFocalLengthByHand) {
  Case test("(1, 17)", kRow);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kLlff);
  const View view = ReadPrediction(test.folder / "out").views[0].view;
  EXPECT_EQ(view.camera.params[0], 100.0 * 80 / 120);
  EXPECT_EQ(view.camera.params[1], 100.0 * 40 / 60);
  EXPECT_EQ(view.camera.PrincipalPoint(), Eigen::Vector2d(40, 20));
  EXPECT_LT((view.cam_from_world * Eigen::Vector3d(8, 10, 12) - Eigen::Vector3d(1, 2, 3)).norm(),
            1e-12);
}

TEST(ImportLlff, BadRowsAreErrors) {
  const auto with = [](size_t idx, double value) {
    std::vector<double> row = kRow;
    row[idx] = value;
    return row;
  };
  EXPECT_THROW(Case("(1, 17)", with(0, 0.5)).Run(), Error);                  // no rotation
  EXPECT_THROW(Case("(1, 17)", with(4, 70)).Run(), Error);                   // other aspect
  EXPECT_THROW(Case("(1, 17)", with(14, -1)).Run(), Error);                  // focal length
  EXPECT_THROW(Case("(1, 17)", with(9, std::nan(""))).Run(), Error);         // size
  EXPECT_THROW(Case("(1, 15)", std::vector<double>(15, 1.0)).Run(), Error);  // no LLFF
  std::vector<double> two = kRow;
  two.insert(two.end(), kRow.begin(), kRow.end());
  EXPECT_THROW(Case("(2, 17)", two).Run(), Error);  // one photo
}

// The set's SOURCE.md gives these figures, measured by other means.
TEST(ImportLlff, FernAgreesWithVggtAsMeasuredBefore) {
  VGTW_NEED_SHARED_DATA();
  const auto fern = SharedData() / "llff_fern_vggt";
  const TemporaryFolder folder;
  const ImportSummary summary =
      Import(fern / "reference" / "poses_bounds.npy", fern / "images", folder / "llff", {});
  EXPECT_TRUE(summary.warnings.empty()) << summary.warnings[0];
  const Prediction reference = ReadPrediction(folder / "llff");
  EXPECT_NEAR(reference.views[0].view.camera.FocalLengthX(), 3260.526 * 706 / 4032, 1e-3);
  EXPECT_NEAR(reference.views[0].view.camera.FocalLengthY(), 3260.526 * 529 / 3024, 1e-3);
  const auto vggt = CamFromWorldByName(ReadModel(fern / "vggt"));
  std::vector<Eigen::Vector3d> centres;
  std::vector<Eigen::Vector3d> reference_centres;
  for (const ViewPrediction& prediction : reference.views) {
    centres.push_back(OriginInSource(vggt.at(prediction.view.name)));
    reference_centres.push_back(OriginInSource(prediction.view.cam_from_world));
  }
  const auto reference_from_vggt = EstimateSim3d(centres, reference_centres);
  ASSERT_TRUE(reference_from_vggt);
  EXPECT_NEAR(reference_from_vggt->scale, 31.4, 0.1);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& centre : reference_centres) mean += centre / 20.0;
  double squared_error = 0.0;
  double radius = 0.0;
  for (size_t i = 0; i < 20; ++i) {
    squared_error +=
        (*reference_from_vggt * centres[i] - reference_centres[i]).squaredNorm() / 20.0;
    radius += (reference_centres[i] - mean).norm() / 20.0;
  }
  EXPECT_NEAR(100.0 * std::sqrt(squared_error) / radius, 2.07, 0.01);
  std::vector<double> angles_deg;
  for (size_t i = 0; i < 20; ++i) {
    for (size_t j = i + 1; j < 20; ++j) {
      const auto relative = [](const Rigid3d& a, const Rigid3d& b) {
        return b.rotation * a.rotation.conjugate();
      };
      angles_deg.push_back(AngleBetweenDeg(
          relative(vggt.at(reference.views[i].view.name), vggt.at(reference.views[j].view.name)),
          relative(reference.views[i].view.cam_from_world,
                   reference.views[j].view.cam_from_world)));
    }
  }
  EXPECT_NEAR(Median(angles_deg), 0.18, 0.01);
}

}  // namespace
}  // namespace vgtw
