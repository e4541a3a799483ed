// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/network_program.h"

#include "plugin/subprocess.h"
#include "scene/error.h"

#include <system_error>

#include <stdlib.h>
#include <unistd.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// OpenBLAS knows processors by model numbers and takes an Intel one that is newer than itself for a
// Prescott, with kernels at a sixth of the speed (0.3.21 on a Xeon of 2023: 30 instead of 190
// GFLOP/s). Those that it knows run the same float32 kernels either way. On processors without
// these instructions they end the process, and AMD's have kernels of their own.
bool WantsSkylakeKernels() {
#if defined(__x86_64__)
  return __builtin_cpu_is("intel") && __builtin_cpu_supports("avx512f") &&
         __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq");
#else
  return false;
#endif
}

}  // namespace

fs::path FindNetworkProgram() {
  std::error_code ignored;
  const fs::path folder = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  for (const char* relative : {"vgtw-network", "../libexec/vgtw/vgtw-network"}) {
    const fs::path path = FindExecutable((folder / relative).string());
    if (!path.empty()) return path;
  }
  return FindExecutable("vgtw-network");
}

void PrepareNetworkEnvironment() {
  if (WantsSkylakeKernels()) ::setenv("OPENBLAS_CORETYPE", "SKYLAKEX", /*overwrite=*/0);
  if (std::getenv("OMP_WAIT_POLICY") == nullptr) {
    ::setenv("GOMP_SPINCOUNT", "20000", /*overwrite=*/0);
  }
}

fs::path RequireNetworkProgram() {
  const fs::path program = FindNetworkProgram();
  if (!program.empty()) return program;
  throw Error(
      "vgtw-network is not installed: build with -DVGTW_WITH_NETWORK=ON after apt-get install "
      "libtorch-dev");
}

void RunNetworkProgram(const fs::path& program,
                       const std::vector<std::string>& arguments,
                       const fs::path& log_path) {
  PrepareNetworkEnvironment();
  const SubprocessResult run = RunSubprocess(program, arguments, log_path);
  if (run.exit_code == 0) return;
  Fail(program,
       arguments.front() + " ended with " + std::to_string(run.exit_code) + ": " +
           Printable(run.output),
       "exit code 0");
}

void BecomeNetworkProgram(int argc, char** argv) {
  const fs::path program = RequireNetworkProgram();
  PrepareNetworkEnvironment();
  std::vector<char*> arguments = {const_cast<char*>(program.c_str())};
  arguments.insert(arguments.end(), argv + 1, argv + argc);
  arguments.push_back(nullptr);
  ::execv(program.c_str(), arguments.data());
  FailErrno(program, "cannot be started");
}

}  // namespace vgtw
