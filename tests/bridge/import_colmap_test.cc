// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/shared_data.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// Six images of 640x480 with exact projections, named like the photos "p0.png" ...
Reconstruction Model(CameraModel camera_model = CameraModel::kPinhole) {
  Reconstruction model = MakeSyntheticModel({.num_images = 6, .camera_model = camera_model});
  size_t i = 0;
  for (auto& [image_id, image] : model.images) image.name = "p" + std::to_string(i++) + ".png";
  return model;
}

struct Case {
  TemporaryFolder folder;
  fs::path input = folder / "sparse";
  fs::path output = folder / "out";

  explicit Case(const Reconstruction& model, int width = 640, int height = 480) {
    WriteModel(model, input);
    WritePhotos(folder / "photos",
                {"p0.png", "p1.png", "p2.png", "p3.png", "p4.png", "p5.png"},
                width,
                height);
  }
  ImportSummary Run(const ImportOptions& options = {}) {
    return Import(input, folder / "photos", output, options);
  }
  std::string Message() {
    try {
      Run();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
};

const Image& ImageNamed(const Reconstruction& model, const std::string& name) {
  return std::find_if(model.images.begin(),
                      model.images.end(),
                      [&](const auto& entry) { return entry.second.name == name; })
      ->second;
}

// Largest distance between a sample and the projection of its point into the imported view, and
// largest relative difference of its depth. Samples come in the order of points2D.
struct SampleErrors {
  double pixel = 0.0;
  double depth = 0.0;
  size_t num_samples = 0;
};
SampleErrors CompareSamples(const Reconstruction& model, const Prediction& prediction) {
  SampleErrors errors;
  for (const ViewPrediction& view : prediction.views) {
    size_t i = 0;
    for (const Point2D& point2D : ImageNamed(model, view.view.name).points2D) {
      if (!point2D.HasPoint3D()) continue;
      const DepthSample& sample = view.depth_samples.at(i++);
      const Eigen::Vector3d point =
          view.view.cam_from_world * model.points3D.at(point2D.point3D_id).xyz;
      const auto pixel = Project(view.view.camera, point);
      const Eigen::Vector2d offset = sample.pixel_in_original.cast<double>() - pixel.value();
      errors.pixel = std::max(errors.pixel, offset.norm());
      errors.depth = std::max(errors.depth, std::abs(sample.depth / point.z() - 1.0));
    }
    EXPECT_EQ(i, view.depth_samples.size());
    errors.num_samples += i;
  }
  return errors;
}

TEST(ImportColmap, SamplesAreObservationsWithTheirDepth) {
  const Reconstruction model = Model(CameraModel::kSimpleRadial);
  Case test(model);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kColmap);
  EXPECT_EQ(summary.num_views_with_samples, 6u);
  EXPECT_EQ(summary.num_views_with_depth, 0u);
  EXPECT_TRUE(summary.notes.empty());
  EXPECT_TRUE(summary.warnings.empty()) << summary.warnings[0];
  const Prediction prediction = ReadPrediction(test.output);
  const SampleErrors errors = CompareSamples(model, prediction);
  EXPECT_EQ(errors.num_samples, 6u * 120);
  EXPECT_LT(errors.pixel, 1e-4);  // samples are float: 3e-5 px at 640, in both axes
  EXPECT_LT(errors.depth, 1e-6);
  EXPECT_EQ(prediction.views[0].view.camera.model, CameraModel::kSimpleRadial);
  EXPECT_EQ(prediction.views[0].depth_samples[0].confidence, 1.0f);
}

TEST(ImportColmap, TextModelsAndSubfoldersAreFound) {
  Case test(Model());
  fs::create_directories(test.folder / "scene" / "sparse");
  WriteModel(Model(), test.folder / "scene" / "sparse" / "0", {.format = ModelFormat::kText});
  test.input = test.folder / "scene";
  EXPECT_EQ(test.Run().num_views, 6u);
}

TEST(ImportColmap, CamerasOfAnotherSizeAreRescaled) {
  const Reconstruction model = Model();
  Case test(model, 320, 240);
  const ImportSummary summary = test.Run();
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_NE(summary.notes[0].find("from 640x480 to 320x240"), std::string::npos);
  const Prediction prediction = ReadPrediction(test.output);
  const Camera& before = model.cameras.begin()->second;
  const Camera& after = prediction.views[0].view.camera;
  EXPECT_EQ(after.width, 320u);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(after.params[i], before.params[i] / 2);
  EXPECT_LT(CompareSamples(model, prediction).pixel, 1e-4);
}

// MapAnything: sparse/ for its own cut images, which it saves in images/ under the photos' names.
// Photos of 1920x1200 cover 640x480 as 768x480; columns 64 to 703 are kept: a scale of 2.5.
TEST(ImportColmap, CropsOfMapAnythingAreUndoneOnRequest) {
  const Reconstruction model = Model();
  Case asks(model, 1920, 1200);
  EXPECT_NE(asks.Message().find("--resize crop"), std::string::npos) << asks.Message();
  Case test(model, 1920, 1200);
  const ImportSummary summary = test.Run({.resize = ImportResize::kCrop});
  EXPECT_EQ(summary.resize, ImportResize::kCrop);
  const Prediction prediction = ReadPrediction(test.output);
  const Camera& before = model.cameras.begin()->second;
  const Camera& after = prediction.views[0].view.camera;
  EXPECT_EQ(after.width, 1920u);
  EXPECT_EQ(after.height, 1200u);
  EXPECT_NEAR(after.params[0], 2.5 * before.params[0], 1e-9);
  EXPECT_NEAR(after.params[2], 2.5 * (before.params[2] + 64.0), 1e-9);
  EXPECT_NEAR(after.params[3], 2.5 * before.params[3], 1e-9);
  const SampleErrors errors = CompareSamples(model, prediction);
  EXPECT_EQ(errors.num_samples, 6u * 120);
  EXPECT_LT(errors.pixel, 2e-4);  // samples are float: 6e-5 px at 1920, in both axes
}

TEST(ImportColmap, ImagesOfMapAnythingFitAsTheyAre) {
  Reconstruction model = Model();
  Case test(model);
  test.Run({.resize = ImportResize::kCrop});
  const Prediction cropped = ReadPrediction(test.output);
  Case plain(model);
  plain.Run();
  const Prediction read = ReadPrediction(plain.output);
  EXPECT_EQ(cropped.views[3].view.camera, read.views[3].view.camera);
}

TEST(ImportColmap, CropsThatCannotBeAreNamed) {
  Case test(Model(), 4000, 500);
  try {
    test.Run({.resize = ImportResize::kCrop});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("640x480 for p0.png of 4000x500"), std::string::npos)
        << error.what();
  }
}

TEST(ImportColmap, PhotosOfAnotherAspectAreAnError) {
  const std::string rotated = Case(Model(), 480, 640).Message();
  EXPECT_NE(rotated.find("is for 640x480 pixels but the photo has 480x640"), std::string::npos)
      << rotated;
}

TEST(ImportColmap, AConstantShiftIsUndone) {
  Reconstruction model = Model();
  const Reconstruction truth = model;
  for (auto& [image_id, image] : model.images) {
    for (Point2D& point2D : image.points2D) point2D.xy -= Eigen::Vector2d(3.25, 85.5);
  }
  Case test(model);
  const ImportSummary summary = test.Run();
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_NE(summary.notes[0].find("(+3.250, +85.500) pixels in 6 images"), std::string::npos)
      << summary.notes[0];
  EXPECT_LT(CompareSamples(truth, ReadPrediction(test.output)).pixel, 1e-4);
}

TEST(ImportColmap, NoiseAndSmallShiftsAreLeftAlone) {
  Reconstruction model = Model();
  ProjectAgain(model, 0.3, 1);
  for (auto& [image_id, image] : model.images) {
    for (Point2D& point2D : image.points2D) point2D.xy.y() -= 5.0;
  }
  Case noisy(model);
  EXPECT_TRUE(noisy.Run().notes.empty());
  Reconstruction small = Model();
  for (auto& [image_id, image] : small.images) {
    for (Point2D& point2D : image.points2D) point2D.xy.y() -= 0.4;
  }
  Case shifted(small);
  EXPECT_TRUE(shifted.Run().notes.empty());
}

TEST(ImportColmap, NamesAreMatchedByBaseNameIfUnique) {
  Reconstruction model = Model();
  for (auto& [image_id, image] : model.images) image.name = "old/path/" + image.name;
  Case test(model);
  test.Run();
  EXPECT_EQ(ReadPrediction(test.output).views[5].view.name, "p5.png");
}

TEST(ImportColmap, UnmatchedAndUnsafeNamesAreErrors) {
  for (const char* name : {"other.png", "p1.png.exe"}) {
    Reconstruction model = Model();
    model.images.begin()->second.name = name;
    const std::string message = Case(model).Message();
    EXPECT_NE(message.find("1 of 6 names match no photo"), std::string::npos) << message;
  }
  // Our writer refuses names that leave the folder, so they are put into its bytes.
  for (const std::string name : {"../../etc/passwd", "/etc/passwd"}) {
    Reconstruction model = Model();
    const std::string placeholder(name.size(), 'x');
    model.images.begin()->second.name = placeholder;
    Case test(model);
    std::string bytes = ReadFile(test.input / "images.bin");
    bytes.replace(bytes.find(placeholder), name.size(), name);
    WriteFileAtomically(test.input / "images.bin", bytes);
    const std::string message = test.Message();
    EXPECT_NE(message.find(name), std::string::npos) << message;
  }
}

TEST(ImportColmap, CameraParametersThatNothingNeedsAreToldOf) {
  Case test(Model());
  const ImportSummary summary = test.Run({.camera_params = "500"});
  ASSERT_EQ(summary.warnings.size(), 1u);
  EXPECT_NE(summary.warnings[0].find("--camera_params is not used"), std::string::npos);
}

TEST(ImportColmap, PhotosOutsideTheModelAreNoted) {
  Case test(Model());
  WritePhotos(test.folder / "photos", {"z.png"}, 640, 480);
  const ImportSummary summary = test.Run();
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_NE(summary.notes[0].find("1 photos are not in the model"), std::string::npos);
}

TEST(ImportColmap, ModelsWithoutPointsGivePosesOnly) {
  Reconstruction model = Model();
  model.points3D.clear();
  for (auto& [image_id, image] : model.images) image.points2D.clear();
  Case test(model);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.num_views, 6u);
  EXPECT_EQ(summary.num_views_with_samples, 0u);
}

// What VGGT's demo wrote for real photos, with the shift of its exporter (see SOURCE.md there).
struct RealCase {
  const char* set;
  size_t num_samples;
  double sample_tolerance_px;
  std::vector<std::string> notes;
};

void ExpectRealModel(const RealCase& real) {
  const fs::path data = SharedData() / real.set;
  const TemporaryFolder folder;
  const ImportSummary summary = Import(data / "vggt", data / "images", folder / "out", {});
  EXPECT_TRUE(summary.warnings.empty()) << summary.warnings[0];
  ASSERT_EQ(summary.notes.size(), real.notes.size());
  for (size_t i = 0; i < real.notes.size(); ++i) {
    EXPECT_NE(summary.notes[i].find(real.notes[i]), std::string::npos) << summary.notes[i];
  }
  const SampleErrors errors =
      CompareSamples(ReadModel(data / "vggt"), ReadPrediction(folder / "out"));
  EXPECT_EQ(errors.num_samples, real.num_samples);
  EXPECT_LT(errors.pixel, real.sample_tolerance_px);
  EXPECT_LT(errors.depth, 1e-6);
}

TEST(ImportColmap, FernOfVggt) {
  VGTW_NEED_SHARED_DATA();
  // 5e-5 px of the file and 4e-5 px of rounding to float.
  ExpectRealModel({"llff_fern_vggt", 100000, 1e-4, {"(+0.000, +85.461) pixels in 20 images"}});
}

TEST(ImportColmap, RoomOfVggt) {
  VGTW_NEED_SHARED_DATA();
  // 2e-4 px of the file on each axis at 1280 px, 1e-4 px of rounding to float.
  ExpectRealModel({"room_nooverlap_vggt",
                   100000,
                   4e-4,
                   {"(+0.000, +156.293) pixels in 7 images", "(+0.000, +62.5"}});
}

TEST(ImportColmap, CornerReferenceIsForLargerPhotos) {
  VGTW_NEED_SHARED_DATA();
  const fs::path data = SharedData() / "wild" / "corner";
  const TemporaryFolder folder;
  const ImportSummary summary = Import(data / "reference", data / "images", folder / "out", {});
  EXPECT_TRUE(summary.warnings.empty()) << summary.warnings[0];
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_NE(summary.notes[0].find("from 2016x1512 to 1600x1200"), std::string::npos);
  const View view = PredictionReader(folder / "out").views()[0];
  EXPECT_NEAR(view.camera.FocalLengthX(), 1493.65477 * 1600 / 2016, 1e-4);
  EXPECT_EQ(view.camera.PrincipalPoint(), Eigen::Vector2d(800, 600));
}

}  // namespace
}  // namespace vgtw
