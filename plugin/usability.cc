// SPDX-License-Identifier: BSD-3-Clause
// Apart from the table of commands, so that the network's program links none of them: Ceres would
// bring a BLAS that answers for LibTorch, too.
#include "plugin/commands.h"
#include "plugin/progress.h"
#include "scene/files.h"

#include <cstdio>

namespace vgtw {

void AddUsability(Flags& flags, Usability& usability) {
  flags.Group("Usability")
      .Add("threads", &usability.num_threads, "Threads to use; 0 = all cores")
      .AddChoice("progress",
                 &usability.progress,
                 {"auto", "bar", "plain", "json", "none"},
                 "How progress is shown on stderr; auto = bar on a terminal")
      .Add("json", &usability.json_path, "Also write the result to this file as JSON");
}

void Apply(const Usability& usability) {
  SetProgressStyle(usability.progress);
  // Fail before the work, not after it.
  if (!usability.json_path.empty()) AtomicFile{usability.json_path};
}

void Finish(const Usability& usability, const std::string& text, const nlohmann::json& result) {
  std::fputs(text.c_str(), stdout);
  if (!usability.json_path.empty()) {
    WriteFileAtomically(usability.json_path, result.dump(2) + "\n");
  }
}

}  // namespace vgtw
