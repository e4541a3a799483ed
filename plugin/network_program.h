// SPDX-License-Identifier: BSD-3-Clause
// The program `vgtw-network`, which holds the commands that need LibTorch: a program linked to it
// takes 0.65 s to start.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// Said by both programs.
inline constexpr std::string_view kPredictSummary = "Photos and weights -> predictions folder";
inline constexpr std::string_view kProbeSummary =
    "Pictures of what a patch attends to and of what resembles it";
inline constexpr std::string_view kTrainSummary =
    "Distractor-aware training, and training of small networks from nothing";
inline constexpr std::string_view kWeightsSummary =
    "Look at, check and convert a network's weights";
inline constexpr std::string_view kWeightsInspectSummary = "What a file of weights holds";
inline constexpr std::string_view kWeightsCheckSummary = "Whether weights are complete and finite";
inline constexpr std::string_view kWeightsConvertSummary =
    "Weights of any format -> one .safetensors file";

// It lies beside this program, or in libexec of the same installation, or on PATH; "" if nowhere.
std::filesystem::path FindNetworkProgram();

// Sets what LibTorch and its BLAS read from the environment when a process starts, unless the user
// has set it:
//   OPENBLAS_CORETYPE  where OpenBLAS may take the processor for an older one
//   GOMP_SPINCOUNT     threads that wait for each other spin first; for as long as GCC's OpenMP
//                      lets them, the network gets several times slower where other programs want
//                      the cores, too. Not if OMP_WAIT_POLICY says what the user wants
void PrepareNetworkEnvironment();

// As above. Throws Error that says how to install it if it is nowhere.
std::filesystem::path RequireNetworkProgram();

// Runs a command of the network's program and waits; its output goes to `log_path`, if given.
// Throws Error with the last of that output if it does not end with 0.
void RunNetworkProgram(const std::filesystem::path& program,
                       const std::vector<std::string>& arguments,
                       const std::filesystem::path& log_path = {});

// Becomes the network's program with the same arguments, so that output, progress and exit code are
// its own. Returns only by throwing Error: if it is not installed or cannot be executed.
[[noreturn]] void BecomeNetworkProgram(int argc, char** argv);

}  // namespace vgtw
