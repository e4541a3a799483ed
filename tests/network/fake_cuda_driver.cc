// SPDX-License-Identifier: BSD-3-Clause
// A CUDA driver with two devices, the second of which cannot be asked, for testing without one.
// VGTW_FAKE_CUDA_ERROR set: the driver is there but cannot be used.
#include <cstddef>
#include <cstdlib>
#include <cstring>

extern "C" {

int cuInit(unsigned int) { return std::getenv("VGTW_FAKE_CUDA_ERROR") != nullptr ? 100 : 0; }

int cuDeviceGetCount(int* count) {
  *count = 2;
  return 0;
}

int cuDeviceGet(int* device, int ordinal) {
  *device = 40 + ordinal;
  return 0;
}

int cuDeviceGetName(char* name, int size, int device) {
  std::strncpy(name, "Fake 9000", static_cast<size_t>(size));
  return device == 40 ? 0 : 101;
}

int cuDeviceTotalMem_v2(size_t* bytes, int) {
  *bytes = size_t{6} << 30;
  return 0;
}

}  // extern "C"
