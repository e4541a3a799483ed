// SPDX-License-Identifier: BSD-3-Clause
#include "network/parameters.h"

namespace vgtw {

ParameterScope ParameterScope::operator[](std::string_view name) const {
  ParameterScope scope = *this;
  scope.prefix_ = FullName(name) + ".";
  return scope;
}

ParameterScope ParameterScope::InFloat() const {
  ParameterScope scope = *this;
  scope.product_type_ = at::kFloat;
  return scope;
}

at::Tensor ParameterScope::Get(std::string_view name, const Shape& shape) const {
  return source_->Get(FullName(name), shape, at::kFloat);
}

at::Tensor ParameterScope::GetForProduct(std::string_view name, const Shape& shape) const {
  return source_->Get(FullName(name), shape, product_type_);
}

at::Tensor ListingSource::Get(const std::string& name, const Shape& shape, at::ScalarType) {
  rows_.push_back({name, shape});
  return {};
}

}  // namespace vgtw
