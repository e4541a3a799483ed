// SPDX-License-Identifier: BSD-3-Clause
#include "scene/files.h"

#include "scene/error.h"
#include "tests/support/temporary_folder.h"

#include <csignal>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pair;
using testing::UnorderedElementsAre;

// Names in a folder, hidden ones included.
std::vector<std::string> Names(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  return names;
}

std::string ErrorOf(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// Starts `work` in a process of its own, which exits with what `work` returns, or with 98 if it
// throws: the child must never return into the test.
pid_t StartChild(const std::function<int()>& work) {
  const pid_t child = ::fork();
  if (child != 0) return child;
  try {
    ::_exit(work());
  } catch (...) {
    ::_exit(98);
  }
}

int WaitFor(pid_t child) {
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

// 0 if `work` throws an Error whose text holds `text`.
int ExpectErrorInChild(const std::function<void()>& work, const std::string& text) {
  return ErrorOf(work).find(text) != std::string::npos ? 0 : 1;
}

void LimitFileSize(rlim_t num_bytes) {
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit = {num_bytes, num_bytes};
  ::setrlimit(RLIMIT_FSIZE, &limit);
}

// The superuser may write everywhere; anybody else may not.
void BecomeNobody() {
  if (::geteuid() == 0 && ::setuid(65534) != 0) ::_exit(99);
}

TEST(AtomicFile, AppearsOnlyAtCommit) {
  const TemporaryFolder folder;
  AtomicFile file(folder / "a.txt");
  file.Write("one ");
  file.Write("two");
  EXPECT_FALSE(fs::exists(folder / "a.txt"));
  file.Commit();
  EXPECT_EQ(ReadFile(folder / "a.txt"), "one two");
  EXPECT_THAT(Names(folder.path()), ElementsAre("a.txt"));
  EXPECT_THROW(file.Commit(), std::invalid_argument);
  EXPECT_THROW(file.Write("three"), std::invalid_argument);
}

TEST(AtomicFile, WithoutCommitTheOldFileStays) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a.txt", "old");
  { AtomicFile(folder / "a.txt").Write("new"); }
  EXPECT_THAT(Snapshot(folder.path()), ElementsAre(Pair("a.txt", "old")));
}

TEST(AtomicFile, CommitReplacesTheOldFile) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a.txt", "a long old text");
  WriteFileAtomically(folder / "a.txt", "new");
  EXPECT_THAT(Snapshot(folder.path()), ElementsAre(Pair("a.txt", "new")));
}

TEST(AtomicFile, TwoWritersOfOneNameDoNotMix) {
  const TemporaryFolder folder;
  AtomicFile first(folder / "a.txt");
  AtomicFile second(folder / "a.txt");
  first.Write("first");
  second.Write("second");
  second.Commit();
  first.Commit();
  EXPECT_THAT(Snapshot(folder.path()), ElementsAre(Pair("a.txt", "first")));
}

TEST(AtomicFile, ErrorsNameThePathAndTheReason) {
  const TemporaryFolder folder;
  const fs::path missing = folder / "missing" / "a.txt";
  EXPECT_EQ(ErrorOf([&] { AtomicFile file(missing); }),
            missing.string() + ": cannot be written: No such file or directory");
  EXPECT_EQ(ErrorOf([&] { AtomicFile file(folder.path()); }),
            folder.path().string() + ": is a folder, expected a file name to write");
  EXPECT_THAT(ErrorOf([&] { AtomicFile file(folder.path() / ""); }), HasSubstr("is a folder"));
  EXPECT_NE(ErrorOf([&] { AtomicFile file(""); }), "");
  WriteFileAtomically(folder / "file", "");
  EXPECT_THAT(ErrorOf([&] { AtomicFile file(folder / "file" / "a.txt"); }),
              HasSubstr("Not a directory"));
}

TEST(AtomicFile, NeverReplacesADeviceOrPipe) {
  const TemporaryFolder folder;
  const fs::path pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(ErrorOf([&] { WriteFileAtomically(pipe, "text"); }), HasSubstr("device or pipe"));
  EXPECT_TRUE(fs::is_fifo(pipe));
  EXPECT_THAT(ErrorOf([] { AtomicFile file("/dev/null"); }), HasSubstr("device or pipe"));
}

TEST(AtomicFile, FullDiskKeepsTheOldFileAndLeavesNothing) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a.txt", "old");
  // Both below and above what stdio buffers, so that fwrite fails once and fflush once.
  for (const size_t num_bytes : {size_t{600}, size_t{1} << 20}) {
    const pid_t child = StartChild([&] {
      LimitFileSize(512);
      const std::string text(num_bytes, 'x');
      return ExpectErrorInChild([&] { WriteFileAtomically(folder / "a.txt", text); },
                                "a.txt: cannot be written: File too large");
    });
    EXPECT_EQ(WaitFor(child), 0);
    EXPECT_THAT(Snapshot(folder.path()), ElementsAre(Pair("a.txt", "old")));
  }
}

TEST(AtomicFile, ReadOnlyFolderIsAnError) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a.txt", "old");
  fs::permissions(folder.path(), fs::perms(0555));
  const pid_t child = StartChild([&] {
    BecomeNobody();
    return ExpectErrorInChild([&] { AtomicFile file(folder / "a.txt"); },
                              "a.txt: cannot be written: Permission denied");
  });
  EXPECT_EQ(WaitFor(child), 0);
  fs::permissions(folder.path(), fs::perms(0755));
}

TEST(AtomicFile, KilledProcessLeavesTheOldFile) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a.txt", "old");
  const pid_t child = StartChild([&] {
    AtomicFile file(folder / "a.txt");
    file.Write(std::string(1 << 20, 'x'));
    return std::raise(SIGKILL);
  });
  EXPECT_EQ(WaitFor(child), 128 + SIGKILL);
  EXPECT_EQ(ReadFile(folder / "a.txt"), "old");
}

// Fills a folder with two files of the same text.
void WriteFolder(const fs::path& path, bool overwrite, const std::string& text) {
  AtomicFolder folder(path, overwrite);
  WriteFileAtomically(folder.path() / "a", text);
  fs::create_directory(folder.path() / "sub");
  WriteFileAtomically(folder.path() / "sub" / "b", text);
  folder.Commit();
}

TEST(AtomicFolder, AppearsOnlyAtCommitWithItsParents) {
  const TemporaryFolder folder;
  {
    AtomicFolder written(folder.path() / "x" / "out", /*overwrite=*/false);
    WriteFileAtomically(written.path() / "a", "text");
    EXPECT_FALSE(fs::exists(folder.path() / "x" / "out"));
    written.Commit();
  }
  EXPECT_THAT(Snapshot(folder.path()), ElementsAre(Pair("x/out/a", "text")));
  EXPECT_THAT(Names(folder / "x"), ElementsAre("out"));
}

TEST(AtomicFolder, WithoutCommitNothingIsLeft) {
  const TemporaryFolder folder;
  {
    const AtomicFolder written(folder / "out", /*overwrite=*/false);
    WriteFileAtomically(written.path() / "a", "text");
  }
  EXPECT_THAT(Names(folder.path()), IsEmpty());
}

TEST(AtomicFolder, RefusesAFullFolderUnlessToldToReplaceItAsAWhole) {
  const TemporaryFolder folder;
  WriteFolder(folder / "out", false, "old");
  WriteFileAtomically(folder / "out" / "extra", "");
  const auto before = Snapshot(folder.path());
  EXPECT_EQ(ErrorOf([&] { WriteFolder(folder / "out", false, "new"); }),
            (folder / "out").string() +
                ": exists, expected a new or empty folder; name another or add --overwrite");
  EXPECT_EQ(Snapshot(folder.path()), before);
  WriteFolder(folder / "out", true, "new");
  EXPECT_THAT(Snapshot(folder.path()), ElementsAre(Pair("out/a", "new"), Pair("out/sub/b", "new")));
  EXPECT_THAT(Names(folder.path()), ElementsAre("out"));
}

TEST(AtomicFolder, AbandonedOverwriteKeepsTheOldFolder) {
  const TemporaryFolder folder;
  WriteFolder(folder / "out", false, "old");
  const auto before = Snapshot(folder.path());
  { const AtomicFolder abandoned(folder / "out", /*overwrite=*/true); }
  EXPECT_EQ(Snapshot(folder.path()), before);
  const pid_t child = StartChild([&] {
    const AtomicFolder killed(folder / "out", /*overwrite=*/true);
    return std::raise(SIGKILL);
  });
  EXPECT_EQ(WaitFor(child), 128 + SIGKILL);
  EXPECT_EQ(Snapshot(folder.path()), before);
  WriteFolder(folder / "out", true, "new");
  EXPECT_EQ(ReadFile(folder / "out" / "a"), "new");
}

TEST(AtomicFolder, FillsAnEmptyFolder) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "out");
  WriteFolder(folder / "out", false, "new");
  EXPECT_EQ(ReadFile(folder / "out" / "a"), "new");
  EXPECT_THAT(Names(folder.path()), ElementsAre("out"));
}

TEST(AtomicFolder, NeverReplacesWhatAnotherProcessWroteMeanwhile) {
  const TemporaryFolder folder;
  AtomicFolder late(folder / "out", /*overwrite=*/false);
  WriteFolder(folder / "out", false, "theirs");
  EXPECT_THAT(ErrorOf([&] { late.Commit(); }), HasSubstr("Directory not empty"));
  EXPECT_EQ(ReadFile(folder / "out" / "a"), "theirs");
}

TEST(AtomicFolder, AcceptsSlashesDotsRelativeNamesAndLinks) {
  const TemporaryFolder folder;
  WriteFolder(folder.path() / "slash" / "", false, "1");
  WriteFolder(folder.path() / "x" / ".." / "dots" / ".", false, "2");
  fs::create_directory(folder / "target");
  fs::create_directory_symlink("target", folder / "link");
  WriteFolder(folder / "link", false, "3");
  const pid_t child = StartChild([&] {
    fs::current_path(folder.path());
    WriteFolder("relative", false, "4");
    WriteFolder("./relative/", true, "5");
    return 0;
  });
  EXPECT_EQ(WaitFor(child), 0);
  EXPECT_EQ(ReadFile(folder / "slash" / "a"), "1");
  EXPECT_EQ(ReadFile(folder / "dots" / "a"), "2");
  EXPECT_EQ(ReadFile(folder / "target" / "a"), "3");
  EXPECT_EQ(ReadFile(folder / "relative" / "a"), "5");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_THAT(Names(folder.path()),
              UnorderedElementsAre("slash", "dots", "target", "link", "relative"));
}

TEST(AtomicFolder, ErrorsNameThePathAndTheReason) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "file", "text");
  EXPECT_EQ(ErrorOf([&] { AtomicFolder bad(folder / "file", true); }),
            (folder / "file").string() + ": is a file, expected a folder to write");
  EXPECT_THAT(ErrorOf([&] { AtomicFolder bad(folder / "file" / "out", true); }),
              HasSubstr("file/out: cannot be written: Not a directory"));
  EXPECT_NE(ErrorOf([&] { AtomicFolder bad("", true); }), "");
  EXPECT_THAT(ErrorOf([&] { AtomicFolder bad(".", true); }), HasSubstr("is the current folder"));
  EXPECT_EQ(ReadFile(folder / "file"), "text");
}

TEST(AtomicFolder, ReadOnlyFolderIsAnError) {
  const TemporaryFolder folder;
  fs::permissions(folder.path(), fs::perms(0555));
  const pid_t child = StartChild([&] {
    BecomeNobody();
    return ExpectErrorInChild([&] { AtomicFolder bad(folder / "out", true); },
                              "out: cannot be written: Permission denied");
  });
  EXPECT_EQ(WaitFor(child), 0);
  fs::permissions(folder.path(), fs::perms(0755));
}

TEST(AtomicFolder, TwoProcessesNeverMixTheirFiles) {
  const TemporaryFolder folder;
  std::vector<pid_t> children;
  for (const std::string text : {"one", "two"}) {
    children.push_back(StartChild([&] {
      for (int i = 0; i < 50; ++i) WriteFolder(folder / "out", true, text);
      return 0;
    }));
  }
  for (const pid_t child : children) EXPECT_EQ(WaitFor(child), 0);
  EXPECT_EQ(ReadFile(folder / "out" / "a"), ReadFile(folder / "out" / "sub" / "b"));
  EXPECT_THAT(Names(folder.path()), ElementsAre("out"));
}

TEST(ReadFile, GivesAllBytesUpToALimit) {
  const TemporaryFolder folder;
  const std::string bytes("a\0b\n", 4);
  WriteFileAtomically(folder / "a", bytes);
  EXPECT_EQ(ReadFile(folder / "a"), bytes);
  EXPECT_EQ(ReadFile(folder / "a", 4), bytes);
  EXPECT_EQ(ErrorOf([&] { ReadFile(folder / "a", 3); }),
            (folder / "a").string() + ": has 4 bytes, expected at most 3");
}

TEST(ReadFile, RefusesWhatIsNoFile) {
  const TemporaryFolder folder;
  EXPECT_EQ(ErrorOf([&] { ReadFile(folder / "a"); }),
            (folder / "a").string() + ": cannot be read: No such file or directory");
  EXPECT_THAT(ErrorOf([&] { ReadFile(folder.path()); }), HasSubstr("is not a file"));
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(ErrorOf([&] { ReadFile(folder / "pipe"); }), HasSubstr("is not a file"));
  EXPECT_THAT(ErrorOf([&] { MappedFile(folder / "pipe"); }), HasSubstr("is not a file"));
}

TEST(MappedFile, HoldsTheBytes) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a", "text");
  WriteFileAtomically(folder / "empty", "");
  const MappedFile file(folder / "a");
  EXPECT_THAT(file.bytes(),
              ElementsAre(std::byte{'t'}, std::byte{'e'}, std::byte{'x'}, std::byte{'t'}));
  EXPECT_TRUE(MappedFile(folder / "empty").bytes().empty());
  // A file that is replaced keeps its bytes for those who have it mapped.
  WriteFileAtomically(folder / "a", "");
  EXPECT_EQ(file.bytes()[3], std::byte{'t'});
}

// Bytes of files that this process has in its memory.
size_t NumResidentFileBytes() {
  size_t num_pages = 0;
  std::ifstream("/proc/self/statm") >> num_pages >> num_pages >> num_pages;
  return num_pages * static_cast<size_t>(::sysconf(_SC_PAGESIZE));
}

TEST(MappedFile, ReleasedPagesLeaveTheMemoryAndComeBack) {
  const TemporaryFolder folder;
  constexpr size_t kNumBytes = size_t{16} << 20;
  WriteFileAtomically(folder / "a", std::string(kNumBytes, 'x'));
  WriteFileAtomically(folder / "empty", "");
  const MappedFile file(folder / "a");
  const auto count = [&] {
    return std::count(file.bytes().begin(), file.bytes().end(), std::byte{'x'});
  };
  EXPECT_EQ(count(), kNumBytes);
  const size_t before = NumResidentFileBytes();
  file.ReleasePages();
  EXPECT_LE(NumResidentFileBytes(), before - kNumBytes * 9 / 10);
  EXPECT_EQ(count(), kNumBytes);
  MappedFile(folder / "empty").ReleasePages();
}

TEST(IsSafeRelativeName, StaysInsideItsFolder) {
  for (const char* name : {"a", "a.png", "a b/c.d", "..a/b..", "\xc3\xa4/x.jpg"}) {
    EXPECT_TRUE(IsSafeRelativeName(name)) << name;
  }
  for (const char* name : {"",
                           "/a",
                           "a//b",
                           "a/",
                           "..",
                           ".",
                           "a/../b",
                           "a/./b",
                           "../a",
                           "a/..",
                           "a\\b",
                           "a\nb",
                           "a\x7f"}) {
    EXPECT_FALSE(IsSafeRelativeName(name)) << name;
  }
  EXPECT_FALSE(IsSafeRelativeName(std::string_view("a\0b", 3)));
  EXPECT_TRUE(IsSafeRelativeName(std::string(1024, 'a')));
  EXPECT_FALSE(IsSafeRelativeName(std::string(1025, 'a')));
}

}  // namespace
}  // namespace vgtw
