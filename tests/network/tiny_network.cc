// SPDX-License-Identifier: BSD-3-Clause
#include "tests/network/tiny_network.h"

#include "network/vggt.h"
#include "scene/safetensors.h"
#include "scene/synthetic.h"
#include "tests/parity/parity_fixture.h"

#include <map>

#include <ATen/ATen.h>

namespace vgtw {

VggtConfig TinyVgtw(int64_t dim) {
  VggtConfig config;
  config.encoder = EncoderConfig{.dim = dim, .depth = 1, .num_heads = 2, .grid_size = 3};
  config.dim = dim;
  config.depth = 4;
  config.num_heads = 2;
  config.head_layers = {0, 1, 2, 3};
  config.dpt = {.num_features = 8, .num_channels = {8, 8, 8, 8}};
  config.lora = LoraConfig{.rank = 2};
  config.has_distractor_head = true;
  return config;
}

std::unique_ptr<Model> WriteTinyVgtw(const std::filesystem::path& path) {
  FormulaSource source;
  auto model = std::make_unique<Vggt>(ParameterScope(source), TinyVgtw(64));
  std::map<std::string, at::Tensor> values;
  StoredTensors tensors;
  for (const auto& [name, shape] : source.shapes()) {
    FormulaSource again;
    const at::Tensor& value = values[name] = again.Get(name, shape, at::kFloat).contiguous();
    tensors[name] = {TensorType::kF32,
                     {shape.begin(), shape.end()},
                     {reinterpret_cast<const std::byte*>(value.data_ptr<float>()),
                      static_cast<size_t>(value.numel()) * sizeof(float)}};
  }
  WriteSafetensors(path, tensors);
  return model;
}

TinyScene::TinyScene(int num_views) {
  SyntheticOptions options;
  options.num_views = num_views;
  options.width = 120;
  options.height = 84;
  const SyntheticScene scene(options);
  for (size_t i = 0; i < scene.views().size(); ++i) {
    names.push_back(scene.views()[i].name);
    sizes.push_back({120, 84});
    WriteImage(folder / names.back(), scene.Render(i).image);
  }
}

at::Tensor TinyScene::Images(const PreprocessOptions& options) const {
  const std::vector<PhotoPlacement> placements = PlacePhotos(sizes, options);
  std::vector<at::Tensor> images;
  for (size_t i = 0; i < names.size(); ++i) {
    const RgbImage image =
        MakeNetworkImage(ReadRgbImage(folder.path() / names[i]), placements[i], options);
    std::vector<float> values;
    for (size_t channel = 0; channel < 3; ++channel) {
      for (const Rgb& pixel : image.data()) values.push_back(pixel[channel] / 255.0f);
    }
    images.push_back(at::tensor(values).view({3, image.height(), image.width()}));
  }
  return at::stack(images);
}

}  // namespace vgtw
