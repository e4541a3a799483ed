// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/subprocess.h"

#include "scene/error.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <sys/wait.h>

#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxOutputBytes = 64 * 1024;

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

File OpenLog(const fs::path& log_path) {
  if (log_path.empty()) return {nullptr, &std::fclose};
  File log(std::fopen(log_path.c_str(), "ae"), &std::fclose);
  if (!log) FailErrno(log_path, "cannot be written");
  return log;
}

// Starts the child with both outputs on `write_end`; returns its pid.
pid_t Spawn(const fs::path& executable, const std::vector<std::string>& arguments, int write_end) {
  std::vector<char*> argv = {const_cast<char*>(executable.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, write_end, STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, write_end, STDERR_FILENO);
  pid_t pid = 0;
  const int code = ::posix_spawn(&pid, executable.c_str(), &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (code == 0) return pid;
  errno = code;
  FailErrno(executable, "cannot be started");
}

int Wait(pid_t pid) {
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace

SubprocessResult RunSubprocess(const fs::path& executable,
                               const std::vector<std::string>& arguments,
                               const fs::path& log_path,
                               const std::function<void(const std::string&)>& on_line) {
  const File log = OpenLog(log_path);
  if (log) std::fprintf(log.get(), "$ %s\n", ShellLine(executable, arguments).c_str());
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) FailErrno(executable, "cannot be started");
  const File pipe(::fdopen(ends[0], "r"), &std::fclose);
  pid_t pid = 0;
  try {
    pid = Spawn(executable, arguments, ends[1]);
  } catch (...) {
    ::close(ends[1]);
    throw;
  }
  ::close(ends[1]);
  SubprocessResult result;
  char* buffer = nullptr;
  size_t capacity = 0;
  for (ssize_t length; (length = ::getline(&buffer, &capacity, pipe.get())) >= 0;) {
    std::string line(buffer, static_cast<size_t>(length));
    if (log) std::fputs(line.c_str(), log.get());
    result.output += line;
    if (result.output.size() > 2 * kMaxOutputBytes) {
      result.output.erase(0, result.output.size() - kMaxOutputBytes);
    }
    while (!line.empty() && (line.back() == '\n' || line.back() == '\r')) line.pop_back();
    if (on_line) on_line(line);
  }
  std::free(buffer);
  result.exit_code = Wait(pid);
  return result;
}

fs::path FindExecutable(const std::string& name) {
  const auto is_executable = [](const fs::path& path) {
    return fs::is_regular_file(path) && ::access(path.c_str(), X_OK) == 0;
  };
  if (name.find('/') != std::string::npos) return is_executable(name) ? fs::path(name) : fs::path();
  const char* path_variable = std::getenv("PATH");
  const std::string folders = path_variable != nullptr ? path_variable : "/usr/bin:/bin";
  for (size_t begin = 0; begin <= folders.size();) {
    const size_t end = std::min(folders.find(':', begin), folders.size());
    const fs::path candidate = fs::path(folders.substr(begin, end - begin)) / name;
    if (is_executable(candidate)) return candidate;
    begin = end + 1;
  }
  return {};
}

std::string ShellLine(const fs::path& executable, const std::vector<std::string>& arguments) {
  const auto quote = [](const std::string& word) {
    constexpr const char* kPlain =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+@%";
    if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
    std::string quoted = "'";
    for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return quoted + "'";
  };
  std::string line = quote(executable.string());
  for (const std::string& argument : arguments) line += " " + quote(argument);
  return line;
}

}  // namespace vgtw
