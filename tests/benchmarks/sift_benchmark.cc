// SPDX-License-Identifier: BSD-3-Clause
// sift_benchmark IMAGES [NUM_THREADS]
// COLMAP's extractor ($VGTW_COLMAP, else colmap) and ours on the same folder, one after the other
// with the same number of threads (default: all cores) and options; both write a database.
#include "bridge/colmap_database.h"
#include "matching/extract.h"
#include "scene/error.h"
#include "scene/memory.h"
#include "scene/parallel.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <sys/resource.h>
#include <vector>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

struct Cost {
  size_t num_features = 0;
  double cpu_sec = 0.0;
  double wall_sec = 0.0;
};

double CpuSec(int who) {
  rusage usage{};
  getrusage(who, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

template <typename Work>
Cost Measure(int who, const fs::path& database_path, const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  const double cpu_sec = CpuSec(who);
  work();
  Cost cost;
  cost.wall_sec = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  cost.cpu_sec = CpuSec(who) - cpu_sec;
  const ColmapDatabase database(database_path, ColmapDatabase::Mode::kReadOnly);
  for (const DatabaseImage& image : database.ReadImages()) {
    cost.num_features += database.ReadKeypoints(image.image_id)->rows;
  }
  return cost;
}

void ExtractByColmap(const fs::path& images, const fs::path& database_path, int num_threads) {
  const ColmapRun run = RunColmap({"feature_extractor",
                                   "--database_path",
                                   database_path.string(),
                                   "--image_path",
                                   images.string(),
                                   "--SiftExtraction.num_threads",
                                   std::to_string(num_threads),
                                   UseGpuFlag("feature_extractor"),
                                   "0"});
  if (run.exit_code != 0) throw Error("feature_extractor failed: " + run.output);
}

void ExtractByUs(const fs::path& images, const fs::path& database_path, int num_threads) {
  const std::vector<std::string> names = ListImages(images);
  ColmapDatabase database = ColmapDatabase::Create(database_path);
  const auto load = [&](size_t i) { return MaskedPhoto{ReadGrayImage(images / names[i]), {}}; };
  const auto write = [&](size_t i, const Features& features) {
    ColmapDatabase::Transaction transaction(database);
    const auto image_id = static_cast<ImageId>(i + 1);
    database.WriteImage({image_id, names[i], 1});
    database.WriteKeypoints(image_id, features.keypoints);
    database.WriteDescriptors(image_id, features.descriptors);
    transaction.Commit();
  };
  ExtractAll(names.size(), load, write, {.num_threads = num_threads});
}

void Print(const char* name, const Cost& cost) {
  std::printf("%-8s %9zu features %8.2f s CPU %8.2f s wall\n",
              name,
              cost.num_features,
              cost.cpu_sec,
              cost.wall_sec);
}

void Run(const fs::path& images, int num_threads) {
  const TemporaryFolder folder;
  const Cost ours = Measure(RUSAGE_SELF, folder / "ours.db", [&] {
    ExtractByUs(images, folder / "ours.db", num_threads);
  });
  const double peak_gib = static_cast<double>(PeakMemory()) / kGib;
  const Cost theirs = Measure(RUSAGE_CHILDREN, folder / "theirs.db", [&] {
    ExtractByColmap(images, folder / "theirs.db", num_threads);
  });
  std::printf("%zu photos, %d threads\n", ListImages(images).size(), num_threads);
  Print("COLMAP", theirs);
  Print("ours", ours);
  std::printf("ours: peak %.2f GiB\nCOLMAP / ours: CPU %.2f, wall %.2f; per feature: CPU %.2f\n",
              peak_gib,
              theirs.cpu_sec / ours.cpu_sec,
              theirs.wall_sec / ours.wall_sec,
              theirs.cpu_sec / static_cast<double>(theirs.num_features) /
                  (ours.cpu_sec / static_cast<double>(ours.num_features)));
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: sift_benchmark IMAGES [NUM_THREADS]\n");
    return 2;
  }
  try {
    vgtw::Run(argv[1], vgtw::ResolveThreads(argc > 2 ? std::atoi(argv[2]) : 0));
  } catch (const vgtw::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
