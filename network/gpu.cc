// SPDX-License-Identifier: BSD-3-Clause
#include "network/gpu.h"

#include <cstddef>
#include <memory>

#include <dlfcn.h>

namespace vgtw {
namespace {

// The few calls of the CUDA driver API that are needed, loaded at run time because neither the
// driver nor its headers can be required. All return 0 on success; a device is an int handle.
struct Driver {
  int (*init)(unsigned int) = nullptr;
  int (*device_get_count)(int*) = nullptr;
  int (*device_get)(int*, int) = nullptr;
  int (*device_get_name)(char*, int, int) = nullptr;
  int (*device_total_mem)(size_t*, int) = nullptr;
};

template <typename Function>
bool Load(void* library, const char* symbol, Function& function) {
  function = reinterpret_cast<Function>(::dlsym(library, symbol));
  return function != nullptr;
}

bool LoadDriver(void* library, Driver& driver) {
  return Load(library, "cuInit", driver.init) &&
         Load(library, "cuDeviceGetCount", driver.device_get_count) &&
         Load(library, "cuDeviceGet", driver.device_get) &&
         Load(library, "cuDeviceGetName", driver.device_get_name) &&
         Load(library, "cuDeviceTotalMem_v2", driver.device_total_mem);
}

bool ReadGpu(const Driver& driver, int ordinal, Gpu& gpu) {
  int device = 0;
  size_t memory_bytes = 0;
  char name[256] = "";
  if (driver.device_get(&device, ordinal) != 0 ||
      driver.device_get_name(name, sizeof(name) - 1, device) != 0 ||
      driver.device_total_mem(&memory_bytes, device) != 0) {
    return false;
  }
  gpu = {name, memory_bytes};
  return true;
}

}  // namespace

std::vector<Gpu> ListGpus(const std::filesystem::path& driver_path) {
  std::vector<Gpu> gpus;
  // RTLD_NODELETE: the driver starts threads of its own and must stay.
  const std::unique_ptr<void, int (*)(void*)> library(
      ::dlopen(driver_path.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE),
      [](void* handle) { return handle != nullptr ? ::dlclose(handle) : 0; });
  Driver driver;
  int num_devices = 0;
  if (library == nullptr || !LoadDriver(library.get(), driver) || driver.init(0) != 0 ||
      driver.device_get_count(&num_devices) != 0) {
    return gpus;
  }
  for (int ordinal = 0; ordinal < num_devices; ++ordinal) {
    Gpu gpu;
    if (ReadGpu(driver, ordinal, gpu)) gpus.push_back(gpu);
  }
  return gpus;
}

}  // namespace vgtw
