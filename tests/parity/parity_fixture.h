// SPDX-License-Identifier: BSD-3-Clause
// Outputs that the official Python networks gave for weights and images made by a formula: which
// there are, and our networks made from the same formula.
#pragma once

#include "network/config.h"
#include "network/model.h"
#include "network/parameters.h"
#include "tests/parity/parity_formula.h"

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// One input of one network. Printed as "vggt_dino.a".
struct ParityCase {
  std::string fixture;  // network, "vggt_dino"
  std::string name;     // input, "a"
  std::variant<VggtConfig, Pi3Config> config;
  bool is_full = false;  // published sizes: the fixture holds slices only
  int64_t num_views = 0;
  int64_t height = 0;
  int64_t width = 0;

  std::string Label() const { return fixture + "." + name; }
};
void PrintTo(const ParityCase& parity_case, std::ostream* stream);

// All cases of `folder`'s manifest.json, small networks or full ones.
std::vector<ParityCase> ReadParityCases(const std::filesystem::path& folder, bool is_full);

// Gives every parameter the formula's values, and remembers their shapes.
class FormulaSource : public ParameterSource {
 public:
  at::Tensor Get(const std::string& name, const Shape& shape, at::ScalarType type) override;
  const std::map<std::string, Shape>& shapes() const { return shapes_; }

 private:
  std::map<std::string, Shape> shapes_;
};

// The network of a case and the names and shapes that it asked for.
struct ParityModel {
  std::unique_ptr<Model> model;
  std::map<std::string, Shape> shapes;
};
ParityModel MakeParityModel(const ParityCase& parity_case);

// images [S, 3, H, W] in [0, 1].
at::Tensor MakeParityImages(const ParityCase& parity_case);

// Everything that the fixture may hold, by its name there.
std::map<std::string, at::Tensor> RunParityCase(const ParityCase& parity_case, const Model& model);

// The largest |a - b| / (1e-4 |b| + 1e-4 mean|b|) over all elements: 1 is the tolerance.
double RatioToTolerance(const at::Tensor& a, const at::Tensor& b);

// Tensors of a .safetensors file by name.
std::map<std::string, at::Tensor> ReadParityTensors(const std::filesystem::path& path);

}  // namespace vgtw
