// SPDX-License-Identifier: BSD-3-Clause
#include "network/device.h"

#include "scene/error.h"

#include <ATen/ATen.h>

namespace vgtw {

at::Device ParseDevice(const std::string& text) {
  const bool has_index = text.starts_with("cuda:") && text.size() > 5 && text.size() <= 8 &&
                         text.find_first_not_of("0123456789", 5) == std::string::npos;
  if (text == "cpu") return at::kCPU;
  if (text != "cuda" && !has_index) {
    throw Error("device '" + Printable(text) + "': expected cpu, cuda or cuda:<number>");
  }
  const int idx = has_index ? std::stoi(text.substr(5)) : 0;
  const auto num_gpus = static_cast<int>(at::getNumGPUs());
  if (num_gpus == 0) {
    throw Error("device '" + text +
                "': this LibTorch has no CUDA or finds no GPU (vgtw doctor tells); use cpu");
  }
  if (idx >= num_gpus) {
    throw Error("device '" + text + "': there are " + std::to_string(num_gpus) +
                " GPUs, counted from 0");
  }
  return {at::kCUDA, static_cast<at::DeviceIndex>(idx)};
}

}  // namespace vgtw
