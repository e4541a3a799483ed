// SPDX-License-Identifier: BSD-3-Clause
// Our networks against what the official ones gave, tensor by tensor, intermediate tokens included.
// Prints "worst <fixture>.<case> <tensor> <ratio to tolerance>". VGTW_PARITY_DIR names another
// folder of fixtures; VGTW_PARITY_FULL=1 adds the networks of published size (6 GB of memory).
#include "tests/parity/parity_fixture.h"
#include "tests/support/shared_data.h"

#include <cstdio>
#include <cstdlib>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// "depth@8" holds every 8th row and column, "tokens.0@16,64" every 16th token and 64th channel.
at::Tensor SliceLike(const std::string& name, const std::map<std::string, at::Tensor>& outputs) {
  const size_t at = name.find('@');
  const auto found = outputs.find(name.substr(0, at));
  if (found == outputs.end()) return {};
  if (at == std::string::npos) return found->second;
  const std::string steps = name.substr(at + 1);
  const size_t comma = steps.find(',');
  const int64_t first = std::stoll(steps);
  const int64_t second = comma == std::string::npos ? first : std::stoll(steps.substr(comma + 1));
  return found->second.slice(1, 0, INT64_MAX, first).slice(2, 0, INT64_MAX, second);
}

// Where the logit is within rounding of the threshold, either answer is right.
void ExpectSameMask(const at::Tensor& logits, const at::Tensor& binary, const std::string& label) {
  const at::Tensor is_clear = logits.abs() > 1e-3;
  const at::Tensor differs = ((logits > 0) != (binary > 0.5)).logical_and(is_clear);
  EXPECT_EQ(differs.sum().item<int64_t>(), 0) << label;
}

void ExpectEqualOutputs(const std::string& label,
                        const std::map<std::string, at::Tensor>& outputs,
                        const std::map<std::string, at::Tensor>& expected) {
  for (const auto& [name, tensor] : expected) {
    if (name == "depth_mask_binary" || name == "refined_mask_binary") {
      ExpectSameMask(outputs.at("depth_mask"), tensor, label);
      continue;
    }
    const at::Tensor found = SliceLike(name, outputs);
    ASSERT_TRUE(found.defined()) << label << " holds " << name << ", which nothing answers to";
    ASSERT_EQ(found.numel(), tensor.numel()) << label << " " << name;
    const double ratio = RatioToTolerance(found, tensor);
    std::printf("worst %s %s %.4f\n", label.c_str(), name.c_str(), ratio);
    EXPECT_LE(ratio, 1.0) << label << " " << name;
  }
}

void ExpectSameShapes(std::map<std::string, Shape> found, std::map<std::string, Shape> expected) {
  // Buffers of the state dict are no parameters.
  found.erase("image_mean");
  found.erase("image_std");
  for (const auto& [name, shape] : expected) {
    EXPECT_EQ(found[name], shape) << name;
    found.erase(name);
  }
  for (const auto& [name, shape] : found)
    ADD_FAILURE() << name << " is not in the official network";
}

void TestCase(const ParityCase& parity_case) {
  const at::NoGradGuard no_gradient;
  const ParityModel made = MakeParityModel(parity_case);
  const std::filesystem::path folder = ParityData();
  ExpectSameShapes(made.shapes, ReadParityShapes(folder / (parity_case.fixture + ".params.tsv")));
  const std::string file =
      parity_case.is_full ? parity_case.fixture : parity_case.fixture + "." + parity_case.name;
  ExpectEqualOutputs(parity_case.Label(),
                     RunParityCase(parity_case, *made.model),
                     ReadParityTensors(folder / (file + ".safetensors")));
}

TEST(NetworkParity, SmallNetworksMeetEveryTensor) {
  VGTW_NEED_PARITY_DATA();
  const std::vector<ParityCase> cases = ReadParityCases(ParityData(), /*is_full=*/false);
  ASSERT_FALSE(cases.empty());
  for (const ParityCase& parity_case : cases) TestCase(parity_case);
}

TEST(NetworkParity, PublishedSizesMeetEveryTensor) {
  VGTW_NEED_PARITY_DATA();
  for (const ParityCase& parity_case : ReadParityCases(ParityData(), /*is_full=*/true)) {
    TestCase(parity_case);
  }
}

}  // namespace
}  // namespace vgtw
