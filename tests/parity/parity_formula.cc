// SPDX-License-Identifier: BSD-3-Clause
#include "tests/parity/parity_formula.h"

#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <numeric>
#include <sstream>

namespace vgtw {
namespace {

uint64_t SplitMix(uint64_t x) {
  uint64_t z = x + 0x9e3779b97f4a7c15u;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
  z = (z ^ z >> 27) * 0x94d049bb133111ebu;
  return z ^ z >> 31;
}

// In (-1, 1), an odd multiple of 2^-24.
double Unit(uint64_t name_hash, size_t index) {
  constexpr double kSteps = 1 << 24;
  return (2.0 * static_cast<double>(SplitMix(name_hash + index) >> 40) + 1.0 - kSteps) / kSteps;
}

const std::map<std::string, std::vector<float>, std::less<>>& GivenWeights() {
  static const std::map<std::string, std::vector<float>, std::less<>> kGiven = {
      {"camera_head.pose_branch.fc2.bias",
       {0.0625f, -0.125f, 0.1875f, 0.03125f, -0.0625f, 0.09375f, 0.25f, 0.25f, 0.21875f}},
      {"mask_head.scratch.output_conv2.2.bias", {-1.8125f}}};
  return kGiven;
}

// Scales of tokens, which are no weights of a layer.
const std::map<std::string, double, std::less<>>& TokenScales() {
  static const std::map<std::string, double, std::less<>> kScales = {{"camera_token", 0x1p-6},
                                                                     {"register_token", 0x1p-6},
                                                                     {"pos_embed", 0x1p-6},
                                                                     {"cls_token", 0x1p-2},
                                                                     {"register_tokens", 0x1p-2},
                                                                     {"mask_token", 0x1p-2},
                                                                     {"query_ref_token", 0x1p-2},
                                                                     {"empty_pose_tokens", 0x1p-1}};
  return kScales;
}

// What layers are scaled by so that outputs are of order one and LayerNorm's epsilon shows.
double LayerFactor(std::string_view name) {
  if (name.ends_with("patch_embed.proj.weight")) return 0x1p-5;
  if (name.ends_with("pose_branch.fc2.weight")) return 0x1p-3;
  if (name.find("scratch.output_conv") == std::string_view::npos) return 1.0;
  return name.ends_with("output_conv2.2.weight") ? 2.0 : 4.0;
}

int64_t Product(std::vector<int64_t>::const_iterator begin,
                std::vector<int64_t>::const_iterator end) {
  return std::accumulate(begin, end, int64_t{1}, std::multiplies<>());
}

}  // namespace

uint64_t Fnv1a(std::string_view bytes) {
  uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : bytes) hash = (hash ^ static_cast<uint8_t>(c)) * 0x100000001b3u;
  return hash;
}

ParityRule ParityRuleOf(const std::string& name, const std::vector<int64_t>& shape) {
  const std::string leaf = name.substr(name.rfind('.') + 1);
  const auto token = TokenScales().find(leaf);
  if (token != TokenScales().end()) return {0.0, token->second};
  if (leaf == "gamma") return {0.25, 0.125};
  if (shape.size() == 1) return leaf == "weight" ? ParityRule{1.0, 0.25} : ParityRule{0.0, 0.0625};
  const int64_t fan = shape.empty() ? 1 : Product(shape.begin() + 1, shape.end());
  double scale = 1.0;
  for (int64_t reached = 3; reached < fan; reached *= 4) scale /= 2.0;
  return {0.0, scale * LayerFactor(name)};
}

std::vector<float> ParityRandom(const std::string& name, size_t count) {
  const uint64_t hash = Fnv1a(name);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = static_cast<float>(Unit(hash, i));
  return values;
}

std::vector<float> ParityWeights(const std::string& name, const std::vector<int64_t>& shape) {
  const auto given = GivenWeights().find(name);
  if (given != GivenWeights().end()) return given->second;
  const ParityRule rule = ParityRuleOf(name, shape);
  const uint64_t hash = Fnv1a(name);
  std::vector<float> weights(static_cast<size_t>(Product(shape.begin(), shape.end())));
  for (size_t i = 0; i < weights.size(); ++i) {
    weights[i] = static_cast<float>(rule.offset + rule.scale * Unit(hash, i));
  }
  return weights;
}

std::vector<uint8_t> ParityPixels(const std::string& image_name,
                                  int64_t num_images,
                                  int64_t height,
                                  int64_t width) {
  const uint64_t hash = Fnv1a(image_name);
  std::vector<uint8_t> pixels;
  pixels.reserve(static_cast<size_t>(num_images * 3 * height * width));
  for (int64_t s = 0; s < num_images; ++s) {
    for (int64_t c = 0; c < 3; ++c) {
      for (int64_t y = 0; y < height; ++y) {
        for (int64_t x = 0; x < width; ++x) {
          const int64_t phase = (x * (3 + c) + y * (5 + s) + 37 * c + 91 * s) % 512;
          const int64_t wave = phase < 256 ? phase : 511 - phase;
          const auto noise = static_cast<int64_t>(SplitMix(hash + pixels.size()) >> 56);
          pixels.push_back(static_cast<uint8_t>((3 * wave + noise) >> 2));
        }
      }
    }
  }
  return pixels;
}

std::map<std::string, std::vector<int64_t>> ReadParityShapes(const std::filesystem::path& path) {
  std::map<std::string, std::vector<int64_t>> shapes;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line.front() == '#') continue;
    std::istringstream fields(line);
    std::string name;
    std::string sizes;
    fields >> name >> sizes;
    std::vector<int64_t>& shape = shapes[name];
    std::istringstream numbers(sizes == "-" ? "" : sizes);
    for (std::string number; std::getline(numbers, number, 'x');) {
      shape.push_back(std::stoll(number));
    }
  }
  return shapes;
}

}  // namespace vgtw
