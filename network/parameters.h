// SPDX-License-Identifier: BSD-3-Clause
// How the modules of a network get their parameters. Internal to network/: needs LibTorch.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

using Shape = std::vector<int64_t>;

// Answers for parameters by the name that they have in the official state dicts. A module asks for
// each of its own once, while it is built; so whoever answers knows what a network needs, and
// decides whether it comes from a checkpoint, is made fresh or is only listed.
class ParameterSource {
 public:
  virtual ~ParameterSource() = default;
  // `type` is what the module computes with: float32, or bfloat16 or float16 for the weights of
  // products where the network runs in mixed precision.
  virtual at::Tensor Get(const std::string& name, const Shape& shape, at::ScalarType type) = 0;
};

// The part of a source that one module sees: names below a prefix.
class ParameterScope {
 public:
  // `product_type`: what linear layers and convolutions compute with.
  explicit ParameterScope(ParameterSource& source, at::ScalarType product_type = at::kFloat)
      : source_(&source), product_type_(product_type) {}

  // The scope of a sub-module: scope["blocks"][3] asks for "blocks.3.".
  ParameterScope operator[](std::string_view name) const;
  ParameterScope operator[](int64_t index) const { return (*this)[std::to_string(index)]; }
  ParameterScope InFloat() const;  // the same names, products in float32

  // Norms, tokens and scales, which stay in float32.
  at::Tensor Get(std::string_view name, const Shape& shape) const;
  // Weights and biases of products.
  at::Tensor GetForProduct(std::string_view name, const Shape& shape) const;

 private:
  std::string FullName(std::string_view name) const { return prefix_ + std::string(name); }

  ParameterSource* source_;
  std::string prefix_;
  at::ScalarType product_type_;
};

// Remembers what a network asks for, and gives undefined tensors: the network built from it has the
// official state dict's names and shapes and cannot run.
class ListingSource : public ParameterSource {
 public:
  struct Row {
    std::string name;
    Shape shape;
  };
  at::Tensor Get(const std::string& name, const Shape& shape, at::ScalarType type) override;
  const std::vector<Row>& rows() const { return rows_; }

 private:
  std::vector<Row> rows_;
};

}  // namespace vgtw
