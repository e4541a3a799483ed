// SPDX-License-Identifier: BSD-3-Clause
// database_benchmark [NUM_IMAGES [NUM_REPEATS [NUM_NEIGHBOURS]]]
// Writes databases of NUM_IMAGES and of a quarter of that (8000 SIFT keypoints per image, 800
// matches with each of 10 neighbours), applies masks to them by each rule and restores them, and
// compares in the same run with `cp`, with sqlite3's .backup and with colmap's feature_importer.
// "per core" is by CPU time, in the program and in the kernel.
// Every figure is the fastest of NUM_REPEATS runs, each in a process of its own, whose peak memory
// is that of this stage alone. Needs 4 GB below the folder for temporary files for 1000 images and
// 10 neighbours, 11 GB for 100, and removes them.
#include "bridge/colmap_database.h"
#include "bridge/mask_apply.h"
#include "bridge/mask_files.h"
#include "bridge/mask_restore.h"
#include "scene/error.h"
#include "scene/image_io.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <random>
#include <sys/resource.h>
#include <sys/wait.h>

#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr uint32_t kNumKeypoints = 8000;
constexpr uint32_t kNumMatches = 800;
constexpr int kWidth = 2000;
constexpr int kHeight = 1500;

struct Cost {
  double seconds = 0.0;
  double cpu_seconds = 0.0;
  double peak_mib = 0.0;
};

Cost MeasureOnce(const std::function<void()>& work) {
  std::fflush(stdout);
  const auto start = Clock::now();
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(0);
  }
  int status = 0;
  rusage usage = {};
  ::wait4(child, &status, 0, &usage);
  if (status != 0) throw Error("a measured stage failed");
  const std::chrono::duration<double> seconds = Clock::now() - start;
  const auto seconds_of = [](const timeval& time) { return time.tv_sec + 1e-6 * time.tv_usec; };
  return {seconds.count(),
          seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime),
          static_cast<double>(usage.ru_maxrss) / 1024.0};
}

Cost MeasureFastest(int num_repeats,
                    const std::function<void()>& prepare,
                    const std::function<void()>& work) {
  Cost fastest;
  for (int i = 0; i < num_repeats; ++i) {
    prepare();
    const Cost cost = MeasureOnce(work);
    if (i == 0 || cost.seconds < fastest.seconds) fastest = cost;
  }
  return fastest;
}

std::function<void()> Command(const std::string& command) {
  return [command] {
    if (std::system((command + " > /dev/null 2>&1").c_str()) != 0) ::_exit(1);
  };
}

std::string NameOf(ImageId image_id) { return "image" + std::to_string(image_id) + ".png"; }

Keypoints RandomKeypoints(uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> x(0.0f, kWidth);
  std::uniform_real_distribution<float> y(0.0f, kHeight);
  Keypoints keypoints{kNumKeypoints, 6, {}};
  for (uint32_t i = 0; i < kNumKeypoints; ++i) {
    keypoints.data.insert(keypoints.data.end(), {x(random), y(random), 2.0f, 0.0f, 0.0f, 2.0f});
  }
  return keypoints;
}

void WriteDatabase(const fs::path& path, ImageId num_images, ImageId num_neighbours) {
  ColmapDatabase database = ColmapDatabase::Create(path);
  ColmapDatabase::Transaction transaction(database);
  Camera camera = MakePinhole(kWidth, kHeight, 1500.0, 1500.0);
  camera.camera_id = 1;
  database.WriteCamera(camera);
  const Keypoints keypoints = RandomKeypoints(1);
  const Descriptors descriptors{
      kNumKeypoints, 128, 0, std::vector<uint8_t>(size_t{kNumKeypoints} * 128, 45)};
  FeatureMatches matches;
  for (uint32_t i = 0; i < kNumMatches; ++i) matches.push_back({i * 10, i * 10});
  TwoViewGeometry geometry{.config = 2, .inlier_matches = matches};
  geometry.F = Eigen::Matrix3d::Identity();
  for (ImageId image_id = 1; image_id <= num_images; ++image_id) {
    database.WriteImage({image_id, NameOf(image_id), 1});
    database.WriteKeypoints(image_id, keypoints);
    database.WriteDescriptors(image_id, descriptors);
    for (ImageId other = image_id - std::min(image_id, num_neighbours); other < image_id; ++other) {
      if (other == 0) continue;
      database.WriteMatches(other, image_id, matches);
      database.WriteTwoViewGeometry(other, image_id, geometry);
    }
  }
  database.WriteTrivialRigsAndFrames();
  transaction.Commit();
}

// Discs that cover about a fifth of the photo.
void WriteMaskFiles(const fs::path& mask_folder, ImageId num_images) {
  StaticMask static_mask(kWidth, kHeight, 255);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double dx = x % 500 - 250.0;
      const double dy = y % 500 - 250.0;
      if (dx * dx + dy * dy < 126.0 * 126.0) static_mask(x, y) = 0;
    }
  }
  const fs::path first = MaskPath(mask_folder, NameOf(1));
  WriteImage(first, static_mask);
  for (ImageId i = 2; i <= num_images; ++i) fs::copy_file(first, MaskPath(mask_folder, NameOf(i)));
}

void MeasureDatabase(const fs::path& folder,
                     ImageId num_images,
                     ImageId num_neighbours,
                     int num_repeats) {
  const fs::path a = folder / "a.db";
  const fs::path b = folder / "b.db";
  const fs::path masks = folder / "masks";
  const auto remove_a = [&] { fs::remove(a); };
  const auto remove_b = [&] { fs::remove(b); };
  const double num_keypoints = 1.0 * num_images * kNumKeypoints;
  const Cost write =
      MeasureFastest(num_repeats, remove_a, [&] { WriteDatabase(a, num_images, num_neighbours); });
  MeasureOnce([&] { WriteMaskFiles(masks, num_images); });
  const std::string from_to = a.string() + " " + b.string();
  const Cost cp = MeasureFastest(num_repeats, remove_b, Command("cp " + from_to));
  const Cost cp_sync =
      MeasureFastest(num_repeats, remove_b, Command("cp " + from_to + " && sync " + b.string()));
  const Cost backup = MeasureFastest(
      num_repeats, remove_b, Command("sqlite3 " + a.string() + " '.backup " + b.string() + "'"));
  const Cost count =
      MeasureFastest(num_repeats, remove_b, [&] { CountExcludedKeypoints(a, masks); });
  const Cost apply = MeasureFastest(num_repeats, remove_b, [&] { ApplyMasks(a, masks, b, {}); });
  const Cost again = MeasureFastest(
      num_repeats, [] {}, [&] { ApplyMasks(b, masks, "", {.in_place = true}); });
  const auto apply_rule = [&](MaskRule rule) {
    return MeasureFastest(num_repeats, remove_b, [&] { ApplyMasks(a, masks, b, {.rule = rule}); });
  };
  const Cost no_undo =
      MeasureFastest(num_repeats, remove_b, [&] { ApplyMasks(a, masks, b, {.keep_undo = false}); });
  const auto copy_a = [&] { fs::copy_file(a, b, fs::copy_options::overwrite_existing); };
  const Cost in_place =
      MeasureFastest(num_repeats, copy_a, [&] { ApplyMasks(b, masks, "", {.in_place = true}); });
  const Cost tracks = apply_rule(MaskRule::kTracks);
  const Cost keypoints = apply_rule(MaskRule::kKeypoints);
  const double applied_mib = static_cast<double>(fs::file_size(b)) / (1 << 20);
  // Only the first run has something to restore.
  const Cost restore = MeasureFastest(
      1, [] {}, [&] { RestoreMasks(b, "", {.in_place = true}); });
  std::printf("%u images, %.0f keypoints, %u neighbours, database %.0f MiB, %.0f by keypoints\n",
              num_images,
              num_keypoints,
              num_neighbours,
              static_cast<double>(fs::file_size(a)) / (1 << 20),
              applied_mib);
  const auto print = [&](const char* name, const Cost& cost) {
    std::printf(
        "  %-32s %7.2f s (cpu %6.2f s) %6.2f M keypoints/s, %5.2f per core, peak %4.0f MiB, "
        "%5.2f x .backup\n",
        name,
        cost.seconds,
        cost.cpu_seconds,
        num_keypoints / cost.seconds / 1e6,
        num_keypoints / cost.cpu_seconds / 1e6,
        cost.peak_mib,
        cost.seconds / backup.seconds);
  };
  print("write the database", write);
  print("cp", cp);
  print("cp, then sync", cp_sync);
  print("sqlite3 .backup", backup);
  print("decode masks, test keypoints", count);
  print("apply masks to a copy", apply);
  print("the same, keeping no undo", no_undo);
  print("apply masks in place", in_place);
  print("apply again in place (no change)", again);
  print("apply, rule tracks", tracks);
  print("apply, rule keypoints", keypoints);
  print("restore that in place", restore);
  std::printf(
      "  cpu of apply to a copy: masks %.0f %%, copy %.0f %%, undo %.0f %%, the rest %.0f %%\n",
      100.0 * count.cpu_seconds / apply.cpu_seconds,
      100.0 * cp.cpu_seconds / apply.cpu_seconds,
      100.0 * (apply.cpu_seconds - no_undo.cpu_seconds) / apply.cpu_seconds,
      100.0 * (no_undo.cpu_seconds - count.cpu_seconds - cp.cpu_seconds) / apply.cpu_seconds);
  std::printf("  apply without decoding and testing: %.2f x cp+sync, %.2f x .backup\n",
              (apply.seconds - count.seconds) / cp_sync.seconds,
              (apply.seconds - count.seconds) / backup.seconds);
  fs::remove_all(masks);
  remove_a();
  remove_b();
}

// The same keypoints through colmap's text files.
void MeasureFeatureImporter(const fs::path& folder, int num_images) {
  std::string descriptor;
  for (int i = 0; i < 128; ++i) descriptor += " 45";
  const Keypoints keypoints = RandomKeypoints(1);
  for (int i = 0; i < num_images; ++i) {
    const std::string name = NameOf(static_cast<ImageId>(i));
    WriteImage(folder / "photos" / name, GrayImage(kWidth, kHeight, 128));
    fs::create_directories(folder / "features");
    std::ofstream file(folder / "features" / (name + ".txt"));
    file << kNumKeypoints << " 128\n";
    for (uint32_t k = 0; k < kNumKeypoints; ++k) {
      file << keypoints.x(k) << " " << keypoints.y(k) << " 2 0" << descriptor << "\n";
    }
  }
  const std::string paths = " --database_path " + (folder / "i.db").string() + " --image_path " +
                            (folder / "photos").string() + " --import_path " +
                            (folder / "features").string();
  const Cost cost =
      MeasureOnce(Command("QT_QPA_PLATFORM=offscreen colmap feature_importer" + paths));
  const double num_keypoints = 1.0 * num_images * kNumKeypoints;
  std::printf("colmap feature_importer, %d images: %.2f s, %.3f M keypoints/s\n",
              num_images,
              cost.seconds,
              num_keypoints / cost.seconds / 1e6);
}

int Main(int argc, char** argv) {
  const auto num_images = static_cast<ImageId>(argc > 1 ? std::atoi(argv[1]) : 1000);
  const int num_repeats = argc > 2 ? std::atoi(argv[2]) : 3;
  const auto num_neighbours = static_cast<ImageId>(argc > 3 ? std::atoi(argv[3]) : 10);
  std::string name = (fs::temp_directory_path() / "vgtw-benchmark-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) FailErrno(name, "cannot be made");
  int exit_code = 0;
  try {
    MeasureDatabase(name, num_images / 4, num_neighbours, num_repeats);
    MeasureDatabase(name, num_images, num_neighbours, num_repeats);
    MeasureFeatureImporter(name, 20);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    exit_code = 1;
  }
  fs::remove_all(name);
  return exit_code;
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) { return vgtw::Main(argc, argv); }
