// SPDX-License-Identifier: BSD-3-Clause
// write_formula_weights {vggt|vgtw|pi3|vgtw-pi3} OUTPUT.safetensors
// Writes weights of a network of published size (4.8 GB for VGGT) made by the formula of the parity
// tests: the outputs mean nothing, but loading and running cost what they cost with trained
// weights.
#include "network/pi3.h"
#include "network/vggt.h"
#include "network/vision_transformer.h"
#include "scene/error.h"
#include "scene/safetensors.h"
#include "tests/parity/parity_formula.h"

#include <cstdio>
#include <map>
#include <string>
#include <string_view>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

template <typename Network, typename Config>
std::map<std::string, Shape> ShapesOf(Config config, bool is_vgtw) {
  if (is_vgtw) {
    config.lora.emplace();
    config.has_distractor_head = true;
  }
  ListingSource listing;
  const Network network(ParameterScope(listing), config);
  std::map<std::string, Shape> shapes;
  for (const ListingSource::Row& row : listing.rows()) shapes.emplace(row.name, row.shape);
  return shapes;
}

std::vector<float> WeightsOf(const std::string& name, const Shape& shape) {
  const auto values = [](const at::Tensor& tensor) {
    return std::vector<float>(tensor.data_ptr<float>(), tensor.data_ptr<float>() + tensor.numel());
  };
  if (name == "image_mean") return values(ImageNetStatistics(at::kCPU).mean);
  if (name == "image_std") return values(ImageNetStatistics(at::kCPU).deviation);
  return ParityWeights(name, shape);
}

void Write(std::string_view network, const std::filesystem::path& path) {
  const bool is_vgtw = network.starts_with("vgtw");
  const std::map<std::string, Shape> shapes = network.ends_with("pi3")
                                                  ? ShapesOf<Pi3>(Pi3Config{}, is_vgtw)
                                                  : ShapesOf<Vggt>(VggtConfig{}, is_vgtw);
  TensorLayouts layouts;
  for (const auto& [name, shape] : shapes) {
    layouts[name] = {TensorType::kF32, {shape.begin(), shape.end()}};
  }
  StreamSafetensors(path, layouts, [&](const std::string& name, const ByteSink& sink) {
    const std::vector<float> weights = WeightsOf(name, shapes.at(name));
    sink(std::as_bytes(std::span(weights)));
  });
}

int Main(int argc, char** argv) {
  const std::string_view network = argc == 3 ? argv[1] : "";
  if (network != "vggt" && network != "vgtw" && network != "pi3" && network != "vgtw-pi3") {
    std::fputs("write_formula_weights {vggt|vgtw|pi3|vgtw-pi3} OUTPUT.safetensors\n", stderr);
    return 2;
  }
  try {
    Write(network, argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) { return vgtw::Main(argc, argv); }
