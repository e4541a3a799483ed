// SPDX-License-Identifier: BSD-3-Clause
#include "network/attention.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <ATen/ATen.h>
#if __has_include(<ATen/ops/scaled_dot_product_attention.h>)
#define VGTW_HAS_FUSED_ATTENTION
#endif

namespace vgtw {
namespace {

// Added to the logits [B, 1, 1, N]; undefined if nothing is excluded.
at::Tensor LogitBias(const at::Tensor& excluded_keys, at::ScalarType type) {
  if (!excluded_keys.defined()) return {};
  const at::Tensor bias = at::zeros(excluded_keys.sizes(), excluded_keys.options().dtype(type));
  return bias.masked_fill(excluded_keys, -std::numeric_limits<double>::infinity())
      .unsqueeze(1)
      .unsqueeze(1);
}

#ifndef VGTW_HAS_FUSED_ATTENTION
constexpr int64_t kMaxLogitsOnCpu = int64_t{1} << 20;

// One head at a time on a CPU, whose caches then hold the logits; all heads on a GPU.
int64_t NumRows(const at::Tensor& q) {
  const int64_t max_logits = q.is_cpu() ? kMaxLogitsOnCpu : int64_t{1} << 28;
  const int64_t num_heads = q.size(0);
  return std::max<int64_t>(1, max_logits / (num_heads * q.size(1)));
}

// q, k, v [H, N, d]; bias [1, N] or undefined.
at::Tensor AttendInRows(const at::Tensor& q,
                        const at::Tensor& k,
                        const at::Tensor& v,
                        const at::Tensor& bias) {
  const at::Tensor keys = (k / std::sqrt(static_cast<double>(q.size(2)))).transpose(1, 2);
  const int64_t num_rows = NumRows(q);
  std::vector<at::Tensor> parts;
  for (int64_t begin = 0; begin < q.size(1); begin += num_rows) {
    at::Tensor logits = at::bmm(q.slice(1, begin, std::min(begin + num_rows, q.size(1))), keys);
    if (bias.defined()) logits = logits + bias;
    parts.push_back(at::bmm(at::softmax(logits, 2), v));
  }
  return parts.size() == 1 ? parts.front() : at::cat(parts, 1);
}
#endif

}  // namespace

at::Tensor Attend(const at::Tensor& q,
                  const at::Tensor& k,
                  const at::Tensor& v,
                  const at::Tensor& excluded_keys) {
  const at::Tensor bias = LogitBias(excluded_keys, q.scalar_type());
#ifdef VGTW_HAS_FUSED_ATTENTION
  if (bias.defined()) return at::scaled_dot_product_attention(q, k, v, bias);
  return at::scaled_dot_product_attention(q, k, v);
#else
  // Small ones of all views and heads at once, as in training.
  if (q.size(0) * q.size(1) * q.size(2) * k.size(2) <= kMaxLogitsOnCpu && !bias.defined()) {
    return AttendInRows(q.flatten(0, 1), k.flatten(0, 1), v.flatten(0, 1), {}).view(q.sizes());
  }
  const int64_t num_at_once = q.is_cpu() ? 1 : q.size(1);
  std::vector<at::Tensor> batches;
  for (int64_t b = 0; b < q.size(0); ++b) {
    std::vector<at::Tensor> heads;
    for (int64_t begin = 0; begin < q.size(1); begin += num_at_once) {
      const auto part = [&](const at::Tensor& x) {
        return x.select(0, b).slice(0, begin, begin + num_at_once);
      };
      heads.push_back(
          AttendInRows(part(q), part(k), part(v), bias.defined() ? bias.select(0, b) : bias));
    }
    batches.push_back(at::cat(heads, 0));
  }
  return at::stack(batches);
#endif
}

}  // namespace vgtw
