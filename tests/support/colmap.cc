// SPDX-License-Identifier: BSD-3-Clause
#include "tests/support/colmap.h"

#include "scene/error.h"

#include <array>
#include <cstdlib>
#include <sstream>
#include <sys/wait.h>

#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

fs::path FromEnvironment(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr ? value : "";
}

[[noreturn]] void Execute(std::vector<std::string> words, int output) {
  ::dup2(output, STDOUT_FILENO);
  ::dup2(output, STDERR_FILENO);
  ::setenv("QT_QPA_PLATFORM", "offscreen", /*overwrite=*/1);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

}  // namespace

fs::path ColmapExecutable() {
  const fs::path chosen = FromEnvironment("VGTW_COLMAP");
  if (!chosen.empty()) return chosen;
  std::istringstream folders(FromEnvironment("PATH").string());
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path candidate = fs::path(folder) / "colmap";
    if (::access(candidate.c_str(), X_OK) == 0) return candidate;
  }
  return {};
}

fs::path OtherColmapExecutable() { return FromEnvironment("VGTW_COLMAP_OTHER"); }

ColmapRun RunColmap(const std::vector<std::string>& args, const fs::path& executable) {
  std::vector<std::string> words = {executable.string()};
  words.insert(words.end(), args.begin(), args.end());
  std::array<int, 2> ends = {};
  if (::pipe(ends.data()) != 0) FailErrno(executable, "cannot make a pipe");
  const pid_t child = ::fork();
  if (child < 0) FailErrno(executable, "cannot be started");
  if (child == 0) Execute(std::move(words), ends[1]);
  ::close(ends[1]);

  ColmapRun run;
  std::array<char, 4096> buffer;
  for (ssize_t n = 0; (n = ::read(ends[0], buffer.data(), buffer.size())) > 0;) {
    run.output.append(buffer.data(), static_cast<size_t>(n));
  }
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return run;
}

std::string UseGpuFlag(const std::string& command, const fs::path& executable) {
  const std::string kind = command == "feature_extractor" ? "Extraction" : "Matching";
  const std::string current = "--Feature" + kind + ".use_gpu";
  const ColmapRun help = RunColmap({command, "-h"}, executable);
  return help.output.find(current) != std::string::npos ? current : "--Sift" + kind + ".use_gpu";
}

}  // namespace vgtw
