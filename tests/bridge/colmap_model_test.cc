// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"

#include "bridge/colmap_model_binary.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/sample_model.h"
#include "tests/support/bytes.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <sys/resource.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

namespace fs = std::filesystem;

void Overwrite(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

std::map<std::string, std::string> FilesOf(const Reconstruction& model, ModelFormat format) {
  const TemporaryFolder folder;
  WriteModel(model, folder / "model", {format, false});
  return Snapshot(folder / "model");
}

TEST(ColmapModel, WriteReadWriteIsByteEqual) {
  for (const Reconstruction& model : {SampleModel(), SampleModelWithRigs(), Reconstruction()}) {
    for (const ModelFormat format : {ModelFormat::kBinary, ModelFormat::kText}) {
      const TemporaryFolder folder;
      WriteModel(model, folder / "model", {format, false});
      EXPECT_EQ(FilesOf(ReadModel(folder / "model"), format), Snapshot(folder / "model"));
    }
  }
}

TEST(ColmapModel, TextHoldsTheSameValuesAsBinary) {
  const Reconstruction model = SampleModelWithRigs();
  const TemporaryFolder folder;
  WriteModel(model, folder / "text", {ModelFormat::kText, false});
  EXPECT_EQ(FilesOf(ReadModel(folder / "text"), ModelFormat::kBinary),
            FilesOf(model, ModelFormat::kBinary));
}

TEST(ColmapModel, RigFilesExistOnlyWithFrames) {
  EXPECT_EQ(FilesOf(SampleModel(), ModelFormat::kBinary).size(), 3u);
  EXPECT_TRUE(FilesOf(SampleModelWithRigs(), ModelFormat::kText).contains("frames.txt"));
}

TEST(ColmapModel, BinaryWinsOverTextAsInColmap) {
  const TemporaryFolder folder;
  WriteModel(SampleModel(), folder / "model");
  for (const std::string name : {"cameras.txt", "images.txt", "points3D.txt"}) {
    Overwrite(folder / ("model/" + name), "not a model");
  }
  EXPECT_EQ(ReadModel(folder / "model").images.size(), 3u);
  fs::remove(folder / "model/points3D.bin");
  EXPECT_THAT(ErrorOf([&] { ReadModel(folder / "model"); }), HasSubstr("cameras.txt: line 1"));
}

TEST(ColmapModel, FramesHoldThePoses) {
  // The trap of COLMAP >= 3.12: poses in images.* are ignored where frames exist.
  const TemporaryFolder folder;
  Reconstruction model = SampleModelWithRigs();
  WriteModel(model, folder / "model");
  Reconstruction moved = model;
  for (auto& [image_id, image] : moved.images) image.cam_from_world.translation.x() += 100.0;
  moved.rigs.clear();
  moved.frames.clear();
  WriteModel(moved, folder / "moved");
  fs::copy_file(folder / "moved/images.bin",
                folder / "model/images.bin",
                fs::copy_options::overwrite_existing);
  const Reconstruction read = ReadModel(folder / "model");
  for (const auto& [image_id, image] : model.images) {
    EXPECT_EQ(read.images.at(image_id).cam_from_world.ToMatrix(), image.cam_from_world.ToMatrix());
  }
}

TEST(ColmapModel, StaleFramesAreNotWritten) {
  const TemporaryFolder folder;
  Reconstruction model = SampleModelWithRigs();
  model.images.at(100).cam_from_world.translation.y() += 1e-6;
  EXPECT_THROW(WriteModel(model, folder / "model"), std::invalid_argument);
  UpdateFrames(model);
  WriteModel(model, folder / "model");
  EXPECT_TRUE(ReadModel(folder / "model").frames.empty());
}

TEST(ColmapModel, BrokenLawIsNotWritten) {
  const TemporaryFolder folder;
  const auto refuses = [&](const std::function<void(Reconstruction&)>& damage,
                           ModelFormat format = ModelFormat::kBinary) {
    Reconstruction model = SampleModel();
    damage(model);
    EXPECT_THROW(WriteModel(model, folder / "model", {format, false}), std::invalid_argument);
  };
  refuses([](Reconstruction& model) { model.cameras.erase(2); });
  refuses([](Reconstruction& model) { model.points3D.erase(5); });
  refuses([](Reconstruction& model) { model.images.at(4).name = "../two.jpg"; });
  refuses([](Reconstruction& model) { model.images.at(4).name = model.images.at(3).name; });
  refuses([](Reconstruction& model) { model.images.at(4).name = "two two.jpg"; },
          ModelFormat::kText);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(ColmapModel, FolderWithoutModelTellsWhatIsMissing) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& name) {
    return ErrorOf([&] { ReadModel(folder / name); });
  };
  EXPECT_THAT(error("none"), HasSubstr("is not a folder"));
  fs::create_directory(folder / "sparse");
  EXPECT_THAT(error("sparse"), HasSubstr("holds no sparse model"));
  EXPECT_FALSE(IsModelFolder(folder / "sparse"));
  WriteModel(SampleModel(), folder / "sparse/0");
  EXPECT_THAT(error("sparse"), HasSubstr("name its sub-folder 0"));
  EXPECT_TRUE(IsModelFolder(folder / "sparse/0"));
  fs::remove(folder / "sparse/0/images.bin");
  EXPECT_THAT(error("sparse/0"), AllOf(HasSubstr("but no images.bin"), HasSubstr("all .bin or")));
}

TEST(ColmapModel, RigsWithoutFramesAreAnError) {
  const TemporaryFolder folder;
  WriteModel(SampleModelWithRigs(), folder / "model");
  fs::remove(folder / "model/frames.bin");
  EXPECT_THAT(ErrorOf([&] { ReadModel(folder / "model"); }), HasSubstr("rigs but no frames"));
}

TEST(ColmapModel, FramesOfAnotherModelAreAnError) {
  // What COLMAP 3.8 leaves behind when it writes into the folder of a newer model.
  const TemporaryFolder folder;
  WriteModel(SampleModelWithRigs(), folder / "model");
  Reconstruction other = SampleModel();
  other.images[55] = other.images.at(100);
  other.images[55].image_id = 55;
  other.images.erase(100);
  WriteModel(other, folder / "other");
  fs::copy(folder / "other",
           folder / "model",
           fs::copy_options::overwrite_existing | fs::copy_options::recursive);
  EXPECT_THAT(ErrorOf([&] { ReadModel(folder / "model"); }),
              AllOf(HasSubstr("unknown image 100"), HasSubstr("delete rigs.* and frames.*")));
}

TEST(ColmapModel, EveryTruncationOfEveryBinaryFileIsAnError) {
  const TemporaryFolder folder;
  const fs::path model = folder / "model";
  WriteModel(SampleModelWithRigs(), model);
  for (const auto& [name, bytes] : Snapshot(model)) {
    for (size_t length = 0; length < bytes.size(); ++length) {
      Overwrite(model / name, bytes.substr(0, length));
      EXPECT_THAT(ErrorOf([&] { ReadModel(model); }), StartsWith((model / name).string()))
          << length;
    }
    Overwrite(model / name, bytes);
  }
  EXPECT_EQ(ErrorOf([&] { ReadModel(model); }), "");
}

TEST(ColmapModel, TruncatedTextIsAnErrorOrStillConsistent) {
  // What nothing refers to cannot be missed: digits of the last number of a file, and the last
  // image, which observes nothing. Every other cut breaks a cross-reference.
  const TemporaryFolder folder;
  const fs::path model = folder / "model";
  WriteModel(SampleModel(), model, {ModelFormat::kText, false});
  for (const auto& [name, text] : Snapshot(model)) {
    int num_accepted = 0;
    for (size_t length = 0; length < text.size(); ++length) {
      Overwrite(model / name, text.substr(0, length));
      const std::string error = ErrorOf([&] {
        const Reconstruction read = ReadModel(model);
        EXPECT_EQ(read.points3D.size(), 2u);
        EXPECT_EQ(read.images.at(3).points2D.size(), 3u);
        EXPECT_EQ(read.images.at(4).points2D.size(), 2u);
      });
      if (error.empty()) ++num_accepted;
    }
    EXPECT_LE(num_accepted, 24) << name;  // a number of 17 digits, line ends, that image
    Overwrite(model / name, text);
  }
}

TEST(ColmapModel, ContradictionsBetweenFilesAreErrors) {
  struct Case {
    std::function<void(Reconstruction&)> damage;  // of one file
    std::string file;
    std::string message;
  };
  const std::vector<Case> cases = {
      {[](Reconstruction& m) { m.images.at(3).camera_id = 99; }, "images.bin", "camera 99"},
      {[](Reconstruction& m) { m.images.at(3).points2D[1].point3D_id = 77; }, "images.bin", "77"},
      {[](Reconstruction& m) { m.images.at(3).points2D.pop_back(); }, "images.bin", "point2D 2"},
      {[](Reconstruction& m) { m.images.at(3).name = "two.jpg"; }, "images.bin", "two.jpg twice"},
      {[](Reconstruction& m) { m.images.erase(4); }, "images.bin", "image 4"},
      {[](Reconstruction& m) { m.points3D.at(5).track[0].image_id = 8; },
       "points3D.bin",
       "image 8"},
      {[](Reconstruction& m) { m.points3D.at(5).track[0].point2D_idx = ~0u; },
       "points3D.bin",
       "4294967295"},
      {[](Reconstruction& m) {
         m.points3D.at(5).track[1] = {3, 0};
       },
       "points3D.bin",
       "twice"},
      {[](Reconstruction& m) { m.points3D.at(5).track.pop_back(); }, "points3D.bin", "point2D 1"},
      {[](Reconstruction& m) { m.points3D.erase(9); }, "points3D.bin", "point3D 9"},
      {[](Reconstruction& m) { m.cameras.erase(7); }, "cameras.bin", "camera 7"},
  };
  for (const auto& [damage, file, message] : cases) {
    const TemporaryFolder folder;
    const fs::path path = folder / "model";
    Reconstruction model = SampleModel();
    WriteModel(model, path);
    damage(model);
    // The inner writers do not check, so that they can write the damage.
    if (file == "images.bin") WriteImagesBinary(model, path / file);
    if (file == "points3D.bin") WritePoints3DBinary(model, path / file);
    if (file == "cameras.bin") WriteCamerasBinary(model, path / file);
    const auto before = Snapshot(folder.path());
    EXPECT_THAT(ErrorOf([&] { ReadModel(path); }), HasSubstr(message)) << file;
    EXPECT_EQ(Snapshot(folder.path()), before);
  }
}

TEST(ColmapModel, ExistingFoldersChangeOnlyWhenAskedTo) {
  const TemporaryFolder folder;
  WriteModel(SampleModelWithRigs(), folder / "model");
  const auto before = Snapshot(folder.path());
  EXPECT_THAT(ErrorOf([&] { WriteModel(SampleModel(), folder / "model"); }),
              HasSubstr("--overwrite"));
  EXPECT_EQ(Snapshot(folder.path()), before);
  WriteModel(SampleModel(), folder / "model", {ModelFormat::kBinary, true});
  // As a whole: no stale rigs and frames stay.
  EXPECT_EQ(Snapshot(folder / "model"), FilesOf(SampleModel(), ModelFormat::kBinary));
}

TEST(ColmapModel, UnwritableTargetIsAnError) {
  const TemporaryFolder folder;
  Overwrite(folder / "file", "mine");
  EXPECT_THAT(ErrorOf([&] { WriteModel(SampleModel(), folder / "file/model"); }),
              HasSubstr("cannot be written"));
  EXPECT_EQ(ReadFile(folder / "file"), "mine");
}

TEST(ColmapModelDeathTest, FullDiskLeavesTheOldModel) {
  const TemporaryFolder folder;
  WriteModel(SampleModelWithRigs(), folder / "model");
  const auto before = Snapshot(folder.path());
  const auto write_with_full_disk = [&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {100, 100};  // bytes a file: cameras.bin fits, images.bin does not
    setrlimit(RLIMIT_FSIZE, &limit);
    const std::string error = ErrorOf([&] {
      WriteModel(SampleModel(), folder / "model", {ModelFormat::kBinary, true});
    });
    // The message goes through a pipe, which the limit does not touch.
    std::fputs(error.c_str(), stderr);
    std::exit(error.empty() ? 0 : 1);
  };
  EXPECT_EXIT(write_with_full_disk(), testing::ExitedWithCode(1), "cannot be written: File too");
  EXPECT_EQ(Snapshot(folder.path()), before);
}

// The records of a binary file by id, cut by an independent reading of the format.
std::map<uint64_t, std::string> RecordsOf(const std::string& file, const std::string& bytes) {
  constexpr size_t kNumParamsOfModel[] = {3, 4, 4, 5, 8};
  const auto u32 = [&](size_t at) {
    uint32_t value;
    std::memcpy(&value, bytes.data() + at, sizeof(value));
    return value;
  };
  const auto u64 = [&](size_t at) { return u32(at) | uint64_t{u32(at + 4)} << 32; };
  std::map<uint64_t, std::string> records;
  size_t begin = 8;
  while (begin < bytes.size()) {
    size_t length = 0;
    if (file == "cameras.bin") {
      length = 24 + 8 * kNumParamsOfModel[u32(begin + 4)];
    } else if (file == "images.bin") {
      const size_t points2D = bytes.find('\0', begin + 64) + 1;
      length = points2D - begin + 8 + 24 * u64(points2D);
    } else {
      length = 51 + 8 * u64(begin + 43);
    }
    const uint64_t id = file == "points3D.bin" ? u64(begin) : u32(begin);
    records[id] = bytes.substr(begin, length);
    begin += length;
  }
  EXPECT_EQ(records.size(), u64(0));
  return records;
}

TEST(ColmapModel, RealModelsAreWrittenBackByteByByte) {
  VGTW_NEED_SHARED_DATA();
  // Written by VGGT's exporter, by VGGT's bundle adjustment and by COLMAP 3.8.
  for (const std::string name : {"llff_fern_vggt/vggt",
                                 "room_nooverlap_vggt/vggt",
                                 "room_nooverlap_vggt/vggt_ba",
                                 "wild/corner/reference"}) {
    const auto written = FilesOf(ReadModel(SharedData() / name), ModelFormat::kBinary);
    EXPECT_EQ(written.size(), 3u);
    for (const auto& [file, bytes] : written) {
      // The originals are in another order.
      EXPECT_TRUE(RecordsOf(file, bytes) == RecordsOf(file, ReadFile(SharedData() / name / file)))
          << name << "/" << file;
    }
  }
}

}  // namespace
}  // namespace vgtw
