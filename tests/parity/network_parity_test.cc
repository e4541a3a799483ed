// SPDX-License-Identifier: BSD-3-Clause
// Our networks against what the official ones gave, tensor by tensor, intermediate tokens included.
// Prints "worst <fixture>.<case> <tensor> <ratio to tolerance>". VGTW_PARITY_DIR names another
// folder of fixtures. The networks of published size need 6 GB of memory.
#include "network/vggt.h"
#include "tests/parity/parity_fixture.h"
#include "tests/parity/parity_formula.h"
#include "tests/support/shared_data.h"

#include <algorithm>
#include <cstdio>
#include <functional>

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

// A change of the weights or the configuration that amounts to a mistake in the code.
struct Mistake {
  std::string name;
  std::function<void(ParityCase&)> configure = {};
  std::function<void(const std::string&, at::Tensor&)> change_weight = {};
};

class MistakenSource : public FormulaSource {
 public:
  explicit MistakenSource(const Mistake& mistake) : mistake_(mistake) {}
  at::Tensor Get(const std::string& name, const Shape& shape, at::ScalarType type) override {
    at::Tensor weight = FormulaSource::Get(name, shape, type);
    if (mistake_.change_weight) mistake_.change_weight(name, weight);
    return weight;
  }

 private:
  const Mistake& mistake_;
};

// q gets its update before norm and rotation, as if it were part of qkv.
void MergeLora(const std::string& name, at::Tensor& weight) {
  const std::string leaf = ".qkv.weight";
  if (!name.ends_with(leaf) || name.find("patch_embed") != std::string::npos) return;
  const std::string attention = name.substr(0, name.size() - leaf.size());
  const int64_t dim = weight.size(1);
  const auto of_formula = [&](const char* which, const Shape& shape) {
    return at::tensor(ParityWeights(attention + which, shape)).view(shape);
  };
  const auto update = [&](const char* up, const char* down) {
    return at::mm(of_formula(up, {dim, 4}), of_formula(down, {4, dim})) * 0.5;
  };
  weight.slice(0, 0, dim).add_(update(".lora_B_q", ".lora_A_q"));
  weight.slice(0, 2 * dim).add_(update(".lora_B_v", ".lora_A_v"));
}

void SwapFirstAndOthers(const std::string& name, at::Tensor& weight) {
  if (name.ends_with("camera_token") || name.ends_with("register_token")) weight = weight.flip(1);
}

VggtConfig& VggtOf(ParityCase& parity_case) { return std::get<VggtConfig>(parity_case.config); }

TEST(NetworkParity, MistakesAreCaught) {
  VGTW_NEED_PARITY_DATA();
  const at::NoGradGuard no_gradient;
  const std::vector<Mistake> mistakes = {
      {"LoRA merged into qkv", [](ParityCase& c) { VggtOf(c).lora.reset(); }, MergeLora},
      {"LoRA scaled by 1", [](ParityCase& c) { VggtOf(c).lora->alpha = 4.0; }},
      {"first view's tokens swapped", {}, SwapFirstAndOthers},
      {"heads of 24 channels", [](ParityCase& c) { VggtOf(c).num_camera_heads = 2; }},
      {"layers off by one", [](ParityCase& c) {
         VggtOf(c).head_layers = {0, 1, 3, 4};
       }}};
  for (ParityCase parity_case : ReadParityCases(ParityData(), /*is_full=*/false)) {
    if (parity_case.Label() != "vgtw_dino.a") continue;
    const auto expected = ReadParityTensors(ParityData() / "vgtw_dino.a.safetensors");
    for (const Mistake& mistake : mistakes) {
      ParityCase mistaken = parity_case;
      if (mistake.configure) mistake.configure(mistaken);
      MistakenSource source(mistake);
      const Vggt network(ParameterScope(source), VggtOf(mistaken));
      const auto outputs = RunParityCase(mistaken, network);
      double worst = 0.0;
      for (const char* name : {"pose_enc", "depth", "depth_mask"}) {
        worst = std::max(worst, RatioToTolerance(outputs.at(name), expected.at(name)));
      }
      std::printf("mistake \"%s\" %.0f\n", mistake.name.c_str(), worst);
      EXPECT_GT(worst, 1.0) << mistake.name;
    }
    return;
  }
}

TEST(NetworkParity, PublishedSizesMeetEveryTensor) {
  VGTW_NEED_PARITY_DATA();
  for (const ParityCase& parity_case : ReadParityCases(ParityData(), /*is_full=*/true)) {
    TestCase(parity_case);
  }
}

}  // namespace
}  // namespace vgtw
