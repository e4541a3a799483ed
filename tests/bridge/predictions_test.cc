// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions.h"

#include "scene/error.h"
#include "scene/files.h"
#include "scene/safetensors.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <sys/resource.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::AllOf;
using testing::HasSubstr;

namespace fs = std::filesystem;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

void Overwrite(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

// 3 x 2 maps of every kind.
ViewPrediction SampleView(const std::string& name) {
  ViewPrediction prediction;
  View& view = prediction.view;
  view.name = name;
  view.camera = MakePinhole(60, 40, 50.0, 51.0);
  view.cam_from_world.translation = {1.0 / 3.0, 2.0, 3.0};
  view.network_width = 3;
  view.network_height = 2;
  view.original_from_network << 20.0, 0.0, 0.0, 0.0, 20.0, 0.0;
  prediction.depth = DepthMap(3, 2, 1.5f);
  prediction.depth(2, 1) = kNaN;
  prediction.depth(0, 1) = 0.1f;
  prediction.depth_conf = ConfidenceMap(3, 2, 7.25f);
  prediction.distractor = DistractorMask(3, 2, 0.0f);
  prediction.distractor(1, 0) = 1.0f;
  prediction.distractor(2, 0) = 0.3f;
  prediction.distractor(2, 1) = kNaN;
  prediction.points = Grid<Eigen::Vector3f>(3, 2, Eigen::Vector3f(1.0f, 2.0f, 0.1f));
  prediction.points(0, 1) = Eigen::Vector3f(-4.0f, 5.0f, 6.0f);
  prediction.depth_samples = {{{0.5f, 39.5f}, 2.5f, 1.0f}, {{10.0f, 20.0f}, 0.1f, 0.0f}};
  return prediction;
}

Prediction SamplePrediction() {
  Prediction prediction = {"test", "0123", {SampleView("a.jpg"), SampleView("sub/b.png")}};
  // Poses, no maps: what a trajectory file gives.
  ViewPrediction& poses_only = prediction.views.emplace_back();
  poses_only.view = SampleView("sub/c.png").view;
  poses_only.view.network_width = poses_only.view.network_height = 0;
  return prediction;
}

fs::path WriteSample(const TemporaryFolder& folder) {
  WritePrediction(SamplePrediction(), folder / "p", false);
  return folder / "p";
}

void ExpectSameFloats(const std::vector<float>& a, const std::vector<float>& b) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(float)), 0);
}

TEST(Predictions, ReadBackWhatWasWritten) {
  const TemporaryFolder folder;
  const Prediction read = ReadPrediction(WriteSample(folder));
  EXPECT_EQ(read.producer, "test");
  EXPECT_EQ(read.weights_hash, "0123");
  ASSERT_EQ(read.views.size(), 3u);
  const ViewPrediction expected = SampleView("sub/b.png");
  const ViewPrediction& view = read.views[1];
  EXPECT_EQ(view.view.name, "sub/b.png");
  EXPECT_EQ(view.view.camera, expected.view.camera);
  EXPECT_EQ(view.view.cam_from_world.ToMatrix(), expected.view.cam_from_world.ToMatrix());
  EXPECT_EQ(view.view.original_from_network, expected.view.original_from_network);
  EXPECT_EQ(view.depth.width(), 3);
  ExpectSameFloats(view.depth.data(), expected.depth.data());
  ExpectSameFloats(view.depth_conf.data(), expected.depth_conf.data());
  EXPECT_EQ(view.points, expected.points);
  ASSERT_EQ(view.depth_samples.size(), 2u);
  EXPECT_EQ(view.depth_samples[0].pixel_in_original, Eigen::Vector2f(0.5f, 39.5f));
  EXPECT_EQ(view.depth_samples[0].depth, 2.5f);
  EXPECT_EQ(view.depth_samples[1].confidence, 0.0f);
  EXPECT_TRUE(read.views[2].depth.empty() && read.views[2].depth_samples.empty());
}

TEST(Predictions, DistractorProbabilitiesAreHalfFloats) {
  const TemporaryFolder folder;
  const DistractorMask read = ReadPrediction(WriteSample(folder)).views[0].distractor;
  EXPECT_EQ(read(0, 0), 0.0f);
  EXPECT_EQ(read(1, 0), 1.0f);
  // The half nearest to 0.3 is 1229/4096.
  EXPECT_EQ(read(2, 0), 1229.0f / 4096.0f);
  EXPECT_TRUE(std::isnan(read(2, 1)));
}

TEST(Predictions, WriteReadWriteIsByteEqual) {
  const TemporaryFolder folder;
  const fs::path first = WriteSample(folder);
  WritePrediction(ReadPrediction(first), folder / "q", false);
  EXPECT_EQ(Snapshot(first), Snapshot(folder / "q"));
  EXPECT_EQ(Snapshot(first).size(), 4u);
}

TEST(Predictions, OrderOfAddDoesNotMatter) {
  const TemporaryFolder folder;
  const fs::path first = WriteSample(folder);
  const Prediction prediction = SamplePrediction();
  PredictionWriter writer(folder / "q", "test", "0123", false);
  for (const size_t i : {2, 0, 1}) writer.Add(prediction.views[i]);
  writer.Commit();
  EXPECT_EQ(Snapshot(first), Snapshot(folder / "q"));
}

TEST(Predictions, ReadsOtherTypesOfMaps) {
  const TemporaryFolder folder;
  const fs::path path = WriteSample(folder);
  const std::string depth = Bytes(uint16_t{0x3c00}, uint16_t{0x4000}, uint16_t{0x7e00});
  const std::string distractor = Bytes(uint8_t{0}, uint8_t{255}, uint8_t{51});
  WriteSafetensors(
      path / "views/a.jpg.safetensors",
      {{"depth", {TensorType::kF16, {2, 3}, AsBytes(depth + depth).first(12)}},
       {"distractor_prob", {TensorType::kU8, {2, 3}, AsBytes(distractor + distractor).first(6)}}});
  const ViewPrediction view = PredictionReader(path).Load(0);
  EXPECT_EQ(view.depth(0, 0), 1.0f);
  EXPECT_EQ(view.depth(1, 1), 2.0f);
  EXPECT_TRUE(std::isnan(view.depth(2, 1)));
  EXPECT_EQ(view.distractor(1, 0), 1.0f);
  EXPECT_EQ(view.distractor(2, 1), 0.2f);
  EXPECT_TRUE(view.points.empty());
}

TEST(Predictions, UnfinishedFolderTellsWhatToRun) {
  const TemporaryFolder folder;
  const auto error = [&](const fs::path& path) {
    return ErrorOf([&] { PredictionReader reader(path); });
  };
  EXPECT_THAT(error(folder / "none"),
              AllOf(HasSubstr("holds no predictions.json"), HasSubstr("vgtw import")));
  const fs::path path = WriteSample(folder);
  fs::remove(path / "views/sub/b.png.safetensors");
  EXPECT_THAT(error(path),
              AllOf(HasSubstr("sub/b.png.safetensors: is missing"),
                    HasSubstr("copy the whole predictions folder")));
}

TEST(Predictions, EveryTruncationIsAnError) {
  const TemporaryFolder folder;
  const fs::path path = WriteSample(folder);
  for (const auto& [name, bytes] : Snapshot(path)) {
    for (size_t length = 0; length < bytes.size(); ++length) {
      // The index ends with a line end that carries nothing.
      if (name == "predictions.json" && length + 1 == bytes.size()) continue;
      Overwrite(path / name, bytes.substr(0, length));
      EXPECT_THAT(ErrorOf([&] { ReadPrediction(path); }), HasSubstr(name)) << length;
    }
    Overwrite(path / name, bytes);
  }
  EXPECT_EQ(ErrorOf([&] { ReadPrediction(path); }), "");
}

TEST(Predictions, WrongMapsAreErrorsThatNameTheFile) {
  const TemporaryFolder folder;
  const fs::path path = WriteSample(folder);
  const std::vector<float> ones(24, 1.0f);
  const auto error = [&](const std::string& name, StoredTensor tensor) {
    WriteSafetensors(path / "views/a.jpg.safetensors", {{name, tensor}});
    return ErrorOf([&] { PredictionReader(path).Load(0); });
  };
  const auto floats = [](const std::vector<float>& values, std::vector<uint64_t> shape) {
    return StoredTensor{TensorType::kF32, std::move(shape), std::as_bytes(std::span(values))};
  };
  const auto six = [&](float value) {
    static std::vector<float> values;
    values.assign(6, 1.0f);
    values[3] = value;
    return floats(values, {2, 3});
  };
  const StoredTensor integers = {
      TensorType::kI32, {2, 3}, std::as_bytes(std::span(ones)).first(24)};
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_THAT(error("depth", floats(ones, {4, 6})),
              AllOf(HasSubstr("a.jpg.safetensors: depth has shape [4,6]"), HasSubstr("[2,3]")));
  EXPECT_THAT(error("depth", floats(ones, {24})), HasSubstr("depth has shape [24]"));
  EXPECT_THAT(error("points", floats(ones, {2, 3, 4})), HasSubstr("points has shape [2,3,4]"));
  EXPECT_THAT(error("depth_samples", floats(ones, {8, 3})), HasSubstr("expected [8,4]"));
  EXPECT_THAT(error("depth", integers), HasSubstr("depth has type I32"));
  EXPECT_THAT(error("dept", six(1.0f)), HasSubstr("tensor 'dept'"));
  EXPECT_THAT(error("depth", six(0.0f)), HasSubstr("neither positive nor unknown"));
  EXPECT_THAT(error("depth", six(-1.0f)), HasSubstr("neither positive nor unknown"));
  EXPECT_THAT(error("depth", six(kInfinity)), HasSubstr("neither positive nor unknown"));
  EXPECT_EQ(error("depth", six(kNaN)), "");
  EXPECT_THAT(error("distractor_prob", six(1.5f)), HasSubstr("outside [0, 1]"));
  EXPECT_THAT(error("distractor_prob", six(-0.1f)), HasSubstr("outside [0, 1]"));
  std::vector<float> sample = {1.0f, 2.0f, kNaN, 1.0f};
  EXPECT_THAT(error("depth_samples", floats(sample, {1, 4})), HasSubstr("depth sample"));
}

TEST(Predictions, WriterRefusesWhatCannotBeRead) {
  const TemporaryFolder folder;
  PredictionWriter writer(folder / "p", "test", "", false);
  writer.Add(SampleView("a.jpg"));
  EXPECT_THROW(writer.Add(SampleView("a.jpg")), std::invalid_argument);
  EXPECT_THROW(writer.Add(SampleView("../a.jpg")), std::invalid_argument);
  ViewPrediction wrong = SampleView("b.jpg");
  wrong.depth = DepthMap(2, 3, 1.0f);
  EXPECT_THROW(writer.Add(wrong), std::invalid_argument);
  wrong = SampleView("c.jpg");
  wrong.view.camera.width = 70000;
  EXPECT_THAT(ErrorOf([&] { writer.Add(wrong); }), HasSubstr("original_size"));
  EXPECT_THAT(ErrorOf([&] { writer.Add(SampleView("caf\xe9.jpg")); }), HasSubstr("not UTF-8"));
  writer.Commit();
  EXPECT_EQ(PredictionReader(folder / "p").views().size(), 1u);
}

TEST(Predictions, UncommittedWriterLeavesNothing) {
  const TemporaryFolder folder;
  const fs::path path = WriteSample(folder);
  const auto before = Snapshot(folder.path());
  {
    PredictionWriter writer(path, "other", "", true);
    writer.Add(SampleView("a.jpg"));
  }
  EXPECT_EQ(Snapshot(folder.path()), before);
  EXPECT_THAT(ErrorOf([&] { WriteSample(folder); }), HasSubstr("--overwrite"));
  EXPECT_EQ(Snapshot(folder.path()), before);
}

TEST(Predictions, UnwritableTargetIsAnError) {
  const TemporaryFolder folder;
  Overwrite(folder / "file", "mine");
  EXPECT_THAT(ErrorOf([&] { WritePrediction(SamplePrediction(), folder / "file/p", false); }),
              HasSubstr("cannot be written"));
  EXPECT_EQ(ReadFile(folder / "file"), "mine");
}

TEST(PredictionsDeathTest, FullDiskLeavesTheOldFolder) {
  const TemporaryFolder folder;
  const fs::path path = WriteSample(folder);
  const auto before = Snapshot(folder.path());
  const auto write_with_full_disk = [&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {100, 100};  // bytes a file, less than any of the folder
    setrlimit(RLIMIT_FSIZE, &limit);
    const std::string error = ErrorOf([&] { WritePrediction(SamplePrediction(), path, true); });
    // The message goes through a pipe, which the limit does not touch.
    std::fputs(error.c_str(), stderr);
    std::exit(error.empty() ? 0 : 1);
  };
  EXPECT_EXIT(write_with_full_disk(), testing::ExitedWithCode(1), "cannot be written: File too");
  EXPECT_EQ(Snapshot(folder.path()), before);
}

}  // namespace
}  // namespace vgtw
