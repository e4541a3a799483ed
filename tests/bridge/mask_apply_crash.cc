// SPDX-License-Identifier: BSD-3-Clause
// ApplyMasks when the process is killed, the disk is full, or the target cannot be written.
#include "bridge/mask_apply.h"
#include "scene/files.h"
#include "tests/bridge/sample_databases.h"
#include "tests/bridge/sample_masks.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <chrono>
#include <csignal>
#include <random>
#include <sys/resource.h>
#include <sys/wait.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace vgtw {
namespace {

using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

// Enough rows that a change exceeds SQLite's page cache (2 MB), so that the database file itself is
// written to long before the commit: 66 pairs of 4000 matches, in two tables, 4.2 MB.
constexpr ImageId kNumImages = 12;
constexpr uint32_t kNumKeypoints = 4000;

void MakeLargeDatabase(const std::filesystem::path& path) {
  Camera camera = MakePinhole(100, 80, 90.0, 90.0);
  camera.camera_id = 1;
  ColmapDatabase database = ColmapDatabase::Create(path);
  ColmapDatabase::Transaction transaction(database);
  database.WriteCamera(camera);
  Keypoints keypoints{kNumKeypoints, 2, std::vector<float>(2 * kNumKeypoints)};
  FeatureMatches matches(kNumKeypoints);
  for (uint32_t i = 0; i < kNumKeypoints; ++i) {
    keypoints.data[2 * i] = static_cast<float>(i % 100);
    keypoints.data[2 * i + 1] = static_cast<float>(i % 80);
    matches[i] = {i, i};
  }
  for (ImageId image_id = 1; image_id <= kNumImages; ++image_id) {
    database.WriteImage({image_id, std::to_string(image_id) + ".jpg", 1});
    database.WriteKeypoints(image_id, keypoints);
    for (ImageId other_id = 1; other_id < image_id; ++other_id) {
      database.WriteMatches(other_id, image_id, matches);
      database.WriteTwoViewGeometry(other_id, image_id, {.config = 2, .inlier_matches = matches});
    }
  }
  transaction.Commit();
}

void WriteLargeMasks(const std::filesystem::path& mask_folder) {
  StaticMask left(100, 80, 255);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 30; ++x) left(x, y) = 0;
  }
  for (ImageId image_id = 1; image_id <= kNumImages; ++image_id) {
    WriteImage(MaskPath(mask_folder, std::to_string(image_id) + ".jpg"), left);
  }
}

// Runs `work` in a child process; kills it after `delay` if that is given. Returns waitpid's
// status.
template <typename Work>
int RunChild(const Work& work, std::optional<std::chrono::microseconds> delay = {}) {
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(0);
  }
  if (delay) {
    ::usleep(static_cast<useconds_t>(delay->count()));
    ::kill(child, SIGKILL);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

// Names and sizes: gtest's own comparison of files of megabytes takes all memory.
std::string Listing(const std::filesystem::path& folder) {
  std::string text;
  for (const auto& [name, bytes] : Snapshot(folder)) {
    text += name + ": " + std::to_string(bytes.size()) + " bytes\n";
  }
  return text;
}

class KilledApplyTest : public testing::TestWithParam<const char*> {
 protected:
  // Each run starts from the same bytes.
  void Restore() const {
    for (const char* suffix : {"-wal", "-shm", "-journal"}) {
      std::filesystem::remove(path_.string() + suffix);
    }
    std::filesystem::copy_file(
        original_path_, path_, std::filesystem::copy_options::overwrite_existing);
  }
  void Apply() const { ApplyMasks(path_, mask_folder_, "", {.in_place = true, .num_threads = 1}); }

  const TemporaryFolder folder_;
  const std::filesystem::path original_path_ = folder_ / "original.db";
  const std::filesystem::path path_ = folder_ / "a.db";
  const std::filesystem::path mask_folder_ = folder_ / "masks";
};

TEST_P(KilledApplyTest, InPlaceLeavesTheOldOrTheNewRows) {
  MakeLargeDatabase(original_path_);
  RunSql(original_path_, std::string("PRAGMA journal_mode = ") + GetParam());
  WriteLargeMasks(mask_folder_);
  Restore();
  const std::string old_rows = DumpRows(path_);
  const auto start = Clock::now();
  RunChild([&] { Apply(); });
  const auto duration = Clock::now() - start;
  const std::string new_rows = DumpRows(path_);
  ASSERT_NE(old_rows, new_rows);

  constexpr int kNumRuns = 40;
  int num_old = 0;
  int num_with_journal = 0;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0.0, 1.1);
  for (int i = 0; i < kNumRuns; ++i) {
    Restore();
    const auto delay =
        std::chrono::duration_cast<std::chrono::microseconds>(duration * share(random));
    RunChild([&] { Apply(); }, delay);
    num_with_journal += std::filesystem::exists(path_.string() + "-journal") ||
                        std::filesystem::exists(path_.string() + "-wal");
    const std::string rows = DumpRows(path_);
    num_old += rows == old_rows;
    ASSERT_TRUE(rows == old_rows || rows == new_rows) << "killed after " << delay.count() << " us";
  }
  std::cout << "of " << kNumRuns << " killed runs " << num_old << " left the old rows, "
            << num_with_journal << " an unfinished transaction\n";
  // Else no run was killed inside of the transaction, and nothing has been shown.
  EXPECT_GT(num_with_journal, 0);
}
INSTANTIATE_TEST_SUITE_P(JournalModes, KilledApplyTest, testing::Values("delete", "wal"));

TEST(KilledApply, OnACopyLeavesTheOldOutputOrTheNew) {
  const TemporaryFolder folder;
  MakeLargeDatabase(folder / "a.db");
  WriteLargeMasks(folder / "masks");
  const std::string old_bytes = "an older output";
  const auto apply = [&] {
    ApplyMasks(folder / "a.db", folder / "masks", folder / "b.db", {.overwrite = true});
  };
  const auto start = Clock::now();
  RunChild(apply);
  const auto duration = Clock::now() - start;
  const std::string new_bytes = ReadFile(folder / "b.db");
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0.0, 1.1);
  for (int i = 0; i < 20; ++i) {
    WriteFileAtomically(folder / "b.db", old_bytes);
    RunChild(apply,
             std::chrono::duration_cast<std::chrono::microseconds>(duration * share(random)));
    const std::string bytes = ReadFile(folder / "b.db");
    ASSERT_TRUE(bytes == old_bytes || bytes == new_bytes);
  }
}

// The whole disk is simulated by a limit on the size of any file: writes beyond it fail.
template <typename Work>
std::string ErrorUnderFileLimit(uint64_t max_bytes, const Work& work) {
  const TemporaryFolder folder;
  const int status = RunChild([&] {
    ::signal(SIGXFSZ, SIG_IGN);
    const std::string error = [&]() -> std::string {
      const rlimit limit{max_bytes, max_bytes};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      return ErrorOf(work);
    }();
    std::FILE* file = std::fopen((folder / "error").c_str(), "w");
    std::fputs(error.c_str(), file);
    std::fclose(file);
  });
  EXPECT_EQ(status, 0);
  return ReadFile(folder / "error");
}

TEST(FullDisk, ApplyLeavesEveryFileAsItWas) {
  const TemporaryFolder folder;
  MakeLargeDatabase(folder / "a.db");
  WriteLargeMasks(folder / "masks");
  WriteFileAtomically(folder / "b.db", "an older output");
  const std::string old_rows = DumpRows(folder / "a.db");
  const auto before = Snapshot(folder.path());
  for (const uint64_t max_bytes : {uint64_t{4096}, uint64_t{1000000}}) {
    const std::string copy_error = ErrorUnderFileLimit(max_bytes, [&] {
      ApplyMasks(folder / "a.db", folder / "masks", folder / "b.db", {.overwrite = true});
    });
    EXPECT_THAT(copy_error, HasSubstr("cannot be written: File too large"));
    EXPECT_TRUE(Snapshot(folder.path()) == before) << Listing(folder.path());
    const std::string in_place_error = ErrorUnderFileLimit(
        max_bytes, [&] { ApplyMasks(folder / "a.db", folder / "masks", "", {.in_place = true}); });
    EXPECT_THAT(in_place_error, HasSubstr("cannot be read or written"));
    // The limit also stops the pages of the rollback, which a full disk would take; then the
    // journal stays and whoever opens the database next plays it back.
    EXPECT_TRUE(DumpRows(folder / "a.db") == old_rows);
    EXPECT_TRUE(Snapshot(folder.path()) == before) << Listing(folder.path());
  }
}

TEST(UnwritableTarget, IsNamedAndNothingIsLeft) {
  const TemporaryFolder folder;
  MakeSampleDatabase(folder / "a.db");
  WriteSampleMasks(folder / "masks");
  const auto before = Snapshot(folder.path());
  for (const std::filesystem::path& target :
       {folder / "a.db/b.db", folder / "missing/b.db", std::filesystem::path("/proc/b.db")}) {
    EXPECT_THAT(ErrorOf([&] { ApplyMasks(folder / "a.db", folder / "masks", target, {}); }),
                HasSubstr(target.string() + ": cannot be written"));
    EXPECT_THAT(ErrorOf([&] { ColmapDatabase::Create(target); }),
                HasSubstr(target.string() + ": cannot be written"));
  }
  EXPECT_TRUE(Snapshot(folder.path()) == before) << Listing(folder.path());
}

}  // namespace
}  // namespace vgtw
