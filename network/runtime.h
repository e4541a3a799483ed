// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/gpu.h"

#include <string>
#include <vector>

namespace vgtw {

// The LibTorch at hand and what it computes with.
struct NetworkRuntime {
  std::string libtorch_version;  // that this was compiled against, "1.13.0"
  int num_threads = 0;           // inside one operation
  int num_interop_threads = 0;   // operations side by side
  std::string cpu_capability;    // vector instructions that its kernels use, "AVX2"; "" = not told
  bool cpu_has_avx512 = false;   // the processor, whether used or not
  std::string blas_library;      // file that answers its matrix products; "" = part of LibTorch
  std::string blas_core;         // processor that OpenBLAS takes this one for; "" = another BLAS
  bool cuda_available = false;   // LibTorch itself can use CUDA here
  std::vector<Gpu> gpus;         // what the driver offers, see ListGpus
};

NetworkRuntime DescribeNetworkRuntime();

// How many threads an operation uses from now on; 0 = all cores. LibTorch starts with one for two
// hyperthreads, or where the environment or a quota says so.
void UseThreads(int num_threads);

// Speed of a float32 product of two size x size matrices, in 1e9 operations per second: the best of
// three after one that is not counted, with the threads that LibTorch uses now. size >= 1.
double MeasureMatrixProductGflops(int size = 768);

// What would make the network faster here, one sentence with its command each; empty if nothing is
// known. Reference BLAS is 75 times slower than OpenBLAS, ATLAS 9 times, OpenBLAS 0.3.21 with an
// AVX512 processor unrecognised 3 times (float32, 2 cores).
std::vector<std::string> AdviseOnRuntime(const NetworkRuntime& runtime);

}  // namespace vgtw
