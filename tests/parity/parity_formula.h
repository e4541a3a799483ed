// SPDX-License-Identifier: BSD-3-Clause
// Weights and images made by a formula, which the reference networks were run on: so their outputs
// are all that had to be stored. Every value is exact in float32 on any machine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// FNV-1a, 64 bits.
uint64_t Fnv1a(std::string_view bytes);

// The weights of a parameter lie in offset - scale .. offset + scale.
struct ParityRule {
  double offset = 0.0;
  double scale = 1.0;
};
ParityRule ParityRuleOf(const std::string& name, const std::vector<int64_t>& shape);

// `count` values in (-1, 1), a hash of the name and their index.
std::vector<float> ParityRandom(const std::string& name, size_t count);

// A parameter of this official name, row-major; a few biases have given values instead of random
// ones.
std::vector<float> ParityWeights(const std::string& name, const std::vector<int64_t>& shape);

// The parameters of an official network: a file of lines "name 3x4", "-" for a scalar, comments
// beginning with '#'.
std::map<std::string, std::vector<int64_t>> ReadParityShapes(const std::filesystem::path& path);

// [num_images, 3, height, width], a triangle wave with noise.
std::vector<uint8_t> ParityPixels(const std::string& image_name,
                                  int64_t num_images,
                                  int64_t height,
                                  int64_t width);

// The same for the input of a network's case ("a", "full").
inline std::vector<uint8_t> ParityImages(const std::string& case_name,
                                         int64_t num_images,
                                         int64_t height,
                                         int64_t width) {
  return ParityPixels("images." + case_name, num_images, height, width);
}

}  // namespace vgtw
