// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/predictions.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr int kSize = 32;

// photos/, predictions/, masks/, sparse/ and a.db of two small photos that fit together.
void WriteGoodInput(const fs::path& root) {
  Prediction prediction;
  prediction.producer = "test";
  Reconstruction model;
  ColmapDatabase database = ColmapDatabase::Create(root / "a.db");
  ColmapDatabase::Transaction transaction(database);
  for (uint32_t id : {1u, 2u}) {
    const std::string name = id == 1 ? "a.png" : "b.png";
    RgbImage photo(kSize, kSize);
    for (size_t i = 0; i < photo.size(); ++i) {
      photo.data()[i] = Rgb{static_cast<uint8_t>(37 * i * id), static_cast<uint8_t>(i / 7), 90};
    }
    WriteImage(root / "photos" / name, photo);
    WriteImage(root / "masks" / (name + ".png"), GrayImage(kSize, kSize, 255));
    ViewPrediction view;
    view.view.name = name;
    view.view.camera = MakePinhole(kSize, kSize, 30.0, 30.0);
    view.view.cam_from_world.translation.x() = id;
    view.view.network_width = kSize;
    view.view.network_height = kSize;
    view.depth = DepthMap(kSize, kSize, 2.0f);
    view.depth_conf = ConfidenceMap(kSize, kSize, 1.0f);
    view.distractor = DistractorMask(kSize, kSize, 0.0f);
    prediction.views.push_back(view);
    Camera camera = view.view.camera;
    camera.camera_id = id;
    model.cameras[id] = camera;
    model.images[id] = {id, id, name, view.view.cam_from_world, {{{5.0, 6.0}, 1}}};
    model.points3D[1].track.push_back({id, 0});
    database.WriteCamera(camera);
    database.WriteImage({id, name, id});
    database.WriteKeypoints(id, {2, 2, {3.0f, 4.0f, 5.0f, 6.0f}});
  }
  model.points3D[1].xyz = {0.0, 0.0, 2.0};
  database.WriteMatches(1, 2, {{0, 0}, {1, 1}});
  transaction.Commit();
  WritePrediction(prediction, root / "predictions", /*overwrite=*/false);
  WriteModel(model, root / "sparse");
}

void EditFile(const fs::path& path, const std::function<void(std::string&)>& edit) {
  std::string bytes = ReadFile(path);
  edit(bytes);
  WriteFileAtomically(path, bytes);
}

void Replace(const fs::path& path, const std::string& old_text, const std::string& new_text) {
  EditFile(path, [&](std::string& bytes) {
    const size_t at = bytes.find(old_text);
    ASSERT_NE(at, std::string::npos) << old_text;
    bytes.replace(at, old_text.size(), new_text);
  });
}

void Truncate(const fs::path& path, double share) {
  fs::resize_file(path, static_cast<uintmax_t>(share * static_cast<double>(fs::file_size(path))));
}

struct BadInput {
  const char* name;
  std::function<void(const fs::path& root)> damage;
  std::vector<std::string> args;  // "@x" stands for "<root>/x"
  const char* expected;           // part of the message
};

const std::vector<std::string> kMaskMake = {
    "mask", "make", "--predictions_path", "@predictions", "--output_path", "@out"};
const std::vector<std::string> kMaskApply = {
    "mask", "apply", "--database_path", "@a.db", "--mask_path", "@masks", "--output_path", "@b.db"};
const std::vector<std::string> kSeed = {
    "seed", "--predictions_path", "@predictions", "--output_path", "@out"};
const std::vector<std::string> kSeedOnDatabase = {"seed",
                                                  "--predictions_path",
                                                  "@predictions",
                                                  "--database_path",
                                                  "@a.db",
                                                  "--output_path",
                                                  "@out"};
const std::vector<std::string> kImport = {
    "import", "--input_path", "@sparse", "--image_path", "@photos", "--output_path", "@out"};
const std::vector<std::string> kRun = {"run",
                                       "--image_path",
                                       "@photos",
                                       "--predictions_path",
                                       "@predictions",
                                       "--output_path",
                                       "@out"};

std::vector<std::string> With(std::vector<std::string> args, const std::vector<std::string>& more) {
  args.insert(args.end(), more.begin(), more.end());
  return args;
}

void Nothing(const fs::path&) {}

const std::string kView = "predictions/views/a.png.safetensors";

const std::vector<BadInput> kCases = {
    {"PredictionsMissing",
     [](const fs::path& root) { fs::remove_all(root / "predictions"); },
     kMaskMake,
     "predictions"},
    {"PredictionsWithoutIndex",
     [](const fs::path& root) { fs::remove(root / "predictions/predictions.json"); },
     kMaskMake,
     "predictions.json"},
    {"PredictionsIndexTruncated",
     [](const fs::path& root) { Truncate(root / "predictions/predictions.json", 0.5); },
     kMaskMake,
     "predictions.json"},
    {"PredictionsOfAnotherVersion",
     [](const fs::path& root) {
       Replace(root / "predictions/predictions.json", "\"version\": 1", "\"version\": 7");
     },
     kSeed,
     "version"},
    {"PredictionsNameLeavesTheFolder",
     [](const fs::path& root) {
       Replace(root / "predictions/predictions.json", "\"a.png\"", "\"../../a.png\"");
     },
     kSeed,
     "../../a.png"},
    {"PredictionsPoseIsNotANumber",
     [](const fs::path& root) {
       Replace(
           root / "predictions/predictions.json", "\"translation\": [", "\"translation\": [null,");
     },
     kSeed,
     "translation"},
    {"PredictionsViewMissing",
     [](const fs::path& root) { fs::remove(root / kView); },
     kSeed,
     "a.png"},
    {"PredictionsViewTruncated",
     [](const fs::path& root) { Truncate(root / kView, 0.7); },
     kMaskMake,
     "a.png"},
    {"PredictionsViewEmpty",
     [](const fs::path& root) { Truncate(root / kView, 0.0); },
     kSeed,
     "a.png"},
    {"PredictionsViewHasAbsurdHeader",
     [](const fs::path& root) {
       EditFile(root / kView, [](std::string& bytes) { bytes.replace(0, 8, 8, '\x7f'); });
     },
     kMaskMake,
     "a.png"},
    {"PredictionsPathIsAFile",
     Nothing,
     {"mask", "make", "--predictions_path", "@a.db", "--output_path", "@out"},
     "a.db"},
    {"MaskOutputExists", Nothing, With(kMaskMake, {"--output_path", "@masks"}), "--overwrite"},
    {"MaskOutputBelowAFile", Nothing, With(kMaskMake, {"--output_path", "@a.db/out"}), "a.db"},
    {"MaskThresholdOutOfBounds",
     Nothing,
     With(kMaskMake, {"--mask_threshold", "1.5"}),
     "threshold"},
    {"MaskDilateNegative", Nothing, With(kMaskMake, {"--dilate_px", "-3"}), "dilate_px"},
    {"DatabaseMissing",
     [](const fs::path& root) { fs::remove(root / "a.db"); },
     kMaskApply,
     "a.db"},
    {"DatabaseEmpty",
     [](const fs::path& root) { Truncate(root / "a.db", 0.0); },
     kMaskApply,
     "a.db"},
    {"DatabaseTruncated",
     [](const fs::path& root) { Truncate(root / "a.db", 0.6); },
     kMaskApply,
     "a.db"},
    {"DatabaseIsText",
     [](const fs::path& root) { WriteFileAtomically(root / "a.db", std::string(5000, 'x')); },
     kMaskApply,
     "a.db"},
    {"DatabaseIsAFolder", Nothing, With(kMaskApply, {"--database_path", "@photos"}), "photos"},
    {"MasksMissing",
     [](const fs::path& root) { fs::remove_all(root / "masks"); },
     kMaskApply,
     "masks"},
    {"OneMaskMissing",
     [](const fs::path& root) { fs::remove(root / "masks/b.png.png"); },
     kMaskApply,
     "b.png"},
    {"MaskOfAnotherSize",
     [](const fs::path& root) {
       WriteImage(root / "masks/b.png.png", GrayImage(kSize / 2, kSize / 2, 255));
     },
     kMaskApply,
     "b.png.png"},
    {"MaskTruncated",
     [](const fs::path& root) { Truncate(root / "masks/b.png.png", 0.5); },
     kMaskApply,
     "b.png.png"},
    {"MaskIsText",
     [](const fs::path& root) { WriteFileAtomically(root / "masks/b.png.png", "white"); },
     kMaskApply,
     "b.png.png"},
    {"MaskApplyOntoItself", Nothing, With(kMaskApply, {"--output_path", "@a.db"}), "in-place"},
    {"MaskApplyWithoutOutput",
     Nothing,
     {"mask", "apply", "--database_path", "@a.db", "--mask_path", "@masks"},
     "output"},
    {"MaskApplyOutputExists",
     [](const fs::path& root) { WriteFileAtomically(root / "b.db", "mine"); },
     kMaskApply,
     "--overwrite"},
    {"MaskApplyOutputBelowAFile",
     Nothing,
     With(kMaskApply, {"--output_path", "@a.db/b.db"}),
     "a.db"},
    {"ModelFileMissing",
     [](const fs::path& root) { fs::remove(root / "sparse/points3D.bin"); },
     kImport,
     "sparse"},
    {"ModelTruncated",
     [](const fs::path& root) { Truncate(root / "sparse/images.bin", 0.7); },
     kImport,
     "images.bin"},
    {"ModelCountAbsurd",
     [](const fs::path& root) {
       EditFile(root / "sparse/cameras.bin",
                [](std::string& bytes) { bytes.replace(0, 8, 8, '\x7f'); });
     },
     kImport,
     "cameras.bin"},
    {"ModelCameraUnknown",
     [](const fs::path& root) {
       EditFile(root / "sparse/cameras.bin", [](std::string& bytes) { bytes[12] = 99; });
     },
     kImport,
     "99"},
    {"ImportOfNothing", Nothing, With(kImport, {"--input_path", "@masks"}), "masks"},
    {"PhotosMissing",
     [](const fs::path& root) { fs::remove_all(root / "photos"); },
     kImport,
     "photos"},
    {"PhotoMissing",
     [](const fs::path& root) { fs::remove(root / "photos/b.png"); },
     kImport,
     "b.png"},
    {"PhotoOfAnotherShape",
     [](const fs::path& root) { WriteImage(root / "photos/b.png", RgbImage(kSize, 2 * kSize)); },
     kImport,
     "b.png"},
    {"PhotoDamaged",
     [](const fs::path& root) { WriteFileAtomically(root / "photos/b.png", "not a png"); },
     kImport,
     "b.png"},
    {"SeedOutputExists", Nothing, With(kSeed, {"--output_path", "@photos"}), "--overwrite"},
    {"SeedKeepPercentOutOfBounds", Nothing, With(kSeed, {"--keep_percent", "0"}), "keep_percent"},
    {"SeedOnADatabaseOfOtherPhotos",
     [](const fs::path& root) {
       fs::remove(root / "a.db");
       ColmapDatabase::Create(root / "a.db");
     },
     kSeedOnDatabase,
     "a.db"},
    {"RunWithoutColmap", Nothing, With(kRun, {"--colmap", "/nonexistent/colmap"}), "colmap"},
    {"RunIntoAForeignFolder", Nothing, With(kRun, {"--output_path", "@photos"}), "photos"},
    {"RunOnPhotosWithoutPredictions",
     [](const fs::path& root) {
       fs::rename(root / "photos/a.png", root / "photos/c.png");
       fs::rename(root / "photos/b.png", root / "photos/d.png");
     },
     kRun,
     "prediction"},
    {"JsonTargetNotWritable", Nothing, With(kMaskMake, {"--json", "@a.db/x.json"}), "x.json"},
};

class BadInputTest : public testing::TestWithParam<BadInput> {};

TEST_P(BadInputTest, GetsOneLineAndExitOneAndNothingIsLost) {
  const TemporaryFolder folder;
  WriteGoodInput(folder.path());
  GetParam().damage(folder.path());
  const auto before = Snapshot(folder.path());
  std::vector<std::string> args = GetParam().args;
  for (std::string& arg : args) {
    if (arg[0] == '@') arg = folder / arg.substr(1);
  }
  args.insert(args.end(), {"--progress", "none"});
  const ColmapRun run = RunVgtw(args);
  EXPECT_EQ(run.exit_code, 1) << run.output;
  EXPECT_THAT(run.output, HasSubstr(GetParam().expected));
  EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  auto after = Snapshot(folder.path());
  std::erase_if(after, [](const auto& file) { return file.first.starts_with("out/"); });
  EXPECT_EQ(after, before);
}

INSTANTIATE_TEST_SUITE_P(Cases, BadInputTest, testing::ValuesIn(kCases), [](const auto& info) {
  return std::string(info.param.name);
});

// The undamaged input passes every command that the table damages, so that each case above fails
// for its own reason.
TEST(GoodInput, Passes) {
  for (const auto& command : {kMaskMake, kMaskApply, kSeed, kSeedOnDatabase, kImport}) {
    const TemporaryFolder folder;
    WriteGoodInput(folder.path());
    std::vector<std::string> args = command;
    for (std::string& arg : args) {
      if (arg[0] == '@') arg = folder / arg.substr(1);
    }
    const ColmapRun run = RunVgtw(args);
    EXPECT_EQ(run.exit_code, 0) << command[0] << ": " << run.output;
  }
}

}  // namespace
}  // namespace vgtw
