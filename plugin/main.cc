// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"

#include <csignal>

int main(int argc, char** argv) {
  // A file-size limit is then an ordinary write error, which is reported and cleaned up after.
  std::signal(SIGXFSZ, SIG_IGN);
  return vgtw::RunProgram(vgtw::Commands(), argc, argv);
}
