// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/colmap.h"

#include "plugin/progress.h"
#include "plugin/subprocess.h"
#include "scene/error.h"

#include <array>
#include <cstdio>
#include <cstdlib>

namespace vgtw {
namespace {

// Options that later versions renamed: 3.8's word and its successor.
constexpr std::array<std::pair<const char*, const char*>, 5> kRenamedOptions = {{
    {"SiftExtraction.use_gpu", "FeatureExtraction.use_gpu"},
    {"SiftExtraction.num_threads", "FeatureExtraction.num_threads"},
    {"SiftExtraction.max_image_size", "FeatureExtraction.max_image_size"},
    {"SiftMatching.use_gpu", "FeatureMatching.use_gpu"},
    {"SiftMatching.num_threads", "FeatureMatching.num_threads"},
}};

bool Mentions(const std::string& help, const std::string& option) {
  const size_t at = help.find("--" + option + " ");
  return at != std::string::npos;
}

// "[3/20]" anywhere in the line.
void FeedProgress(const std::string& line, const ProgressCallback& progress) {
  const size_t open = line.find('[');
  if (!progress || open == std::string::npos) return;
  long long done = 0;
  long long total = 0;
  char close = 0;
  if (std::sscanf(line.c_str() + open, "[%lld/%lld%c", &done, &total, &close) == 3 &&
      close == ']' && done <= total) {
    progress(done, total);
  }
}

// The last few lines that say something.
std::string LastWords(const std::string& output) {
  constexpr int kNumLines = 3;
  std::string words;
  size_t end = output.size();
  for (int num_lines = 0; end > 0 && num_lines < kNumLines;) {
    const size_t begin = output.rfind('\n', end - 1);
    const std::string line = output.substr(begin == std::string::npos ? 0 : begin + 1,
                                           end - (begin == std::string::npos ? 0 : begin + 1));
    if (line.find_first_not_of(" \t=\r*") != std::string::npos) {
      words = Printable(line) + (words.empty() ? "" : " | ") + words;
      ++num_lines;
    }
    if (begin == std::string::npos) break;
    end = begin;
  }
  return words;
}

}  // namespace

Colmap::Colmap(const std::filesystem::path& executable) {
  const std::string name = executable.empty() ? "colmap" : executable.string();
  executable_ = FindExecutable(name);
  if (executable_.empty()) {
    Fail(name,
         "no such executable",
         "COLMAP 3.8 or newer",
         "install the package 'colmap' or name it with --colmap");
  }
  ::setenv("QT_QPA_PLATFORM", "offscreen", /*overwrite=*/0);
  const std::string help = RunSubprocess(executable_, {"-h"}).output;
  const size_t at = help.find("COLMAP ");
  if (at == std::string::npos) Fail(executable_, "does not say 'COLMAP <version>'", "COLMAP");
  const size_t begin = at + 7;
  version_ = help.substr(begin, help.find_first_of(" \n", begin) - begin);
}

const std::string& Colmap::Help(const std::string& command) const {
  const auto [entry, is_new] = help_by_command_.try_emplace(command);
  if (is_new) entry->second = RunSubprocess(executable_, {command, "-h"}).output;
  return entry->second;
}

std::string Colmap::Translate(const std::string& command, const std::string& option) const {
  const std::string& help = Help(command);
  if (Mentions(help, option)) return option;
  for (const auto& [name, successor] : kRenamedOptions) {
    if (option == name && Mentions(help, successor)) return successor;
  }
  return "";
}

int Colmap::Run(const std::string& command,
                const ColmapOptions& options,
                const std::filesystem::path& log_path,
                const ProgressCallback& progress,
                std::string* last_words) const {
  std::vector<std::string> arguments = {command};
  for (const auto& [option, value] : options) {
    const std::string name = Translate(command, option);
    if (name.empty()) continue;
    arguments.push_back("--" + name);
    arguments.push_back(value);
  }
  Announce("running " + ShellLine(executable_, arguments));
  const SubprocessResult result =
      RunSubprocess(executable_, arguments, log_path, [&](const std::string& line) {
        FeedProgress(line, progress);
      });
  if (last_words != nullptr) *last_words = LastWords(result.output);
  return result.exit_code;
}

}  // namespace vgtw
