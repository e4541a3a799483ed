// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/network_flags.h"

#include "bridge/mask_files.h"
#include "plugin/hashing.h"
#include "scene/error.h"
#include "scene/image_io.h"

#include <algorithm>
#include <map>

namespace vgtw {
namespace {

const std::map<std::string, Precision> kPrecisions = {
    {"fp32", Precision::kFloat32}, {"bf16", Precision::kBfloat16}, {"fp16", Precision::kFloat16}};

}  // namespace

void WeightsFlags::Declare(Flags& flags) {
  flags.Group("Input")
      .Require("weights_path",
               &weights_path,
               "Weights: .safetensors, its .index.json, or a file of torch.save")
      .Add("lora_path",
           &lora_path,
           "Weights that replace or extend those: LoRA and distractor head");
}

std::vector<std::filesystem::path> WeightsFlags::Files() const {
  if (lora_path.empty()) return {weights_path};
  return {weights_path, lora_path};
}

std::string WeightsFlags::Hash() const {
  std::string hashes;
  for (const std::filesystem::path& path : Files()) hashes += HashFile(path);
  return lora_path.empty() ? hashes : HashText(hashes);
}

void NetworkFlags::DeclareInput(Flags& flags) {
  flags.Group("Input").Require("image_path", &image_path, "The photos");
  weights.Declare(flags);
  flags
      .AddChoice("model",
                 &model_,
                 {"auto", "vgtw", "vggt", "pi3", "vgtw-pi3"},
                 "The network that the weights must be of; auto = told by their names")
      .Add("mask_path",
           &mask_path_,
           "Masks of known distractors, <photo name>.png, 0 = excluded: nothing attends to them");
}

void NetworkFlags::DeclareImageSize(Flags& flags) {
  flags.Group("Algorithm")
      .Add("side_px",
           &options_.side_px,
           "Width of the network's image, pixels, a multiple of 14; 0 = that of its training, 518 "
           "for "
           "the published ones (not pi3)")
      .Add("max_pixels", &options_.max_pixels, "Pixels of the network's image (pi3)");
}

void NetworkFlags::DeclareMachine(Flags& flags) {
  flags.Group("Machine")
      .Add("device", &options_.device, "cpu, cuda or cuda:<number>")
      .AddChoice("precision",
                 &precision_,
                 {"fp32", "bf16", "fp16"},
                 "Numbers of matrix products; fp16 on GPUs only")
      .Add("max_memory",
           &options_.max_memory_gib,
           "Memory to use, of the process or of the GPU, GiB; 0 = what is free");
}

PredictOptions NetworkFlags::Options(const std::vector<std::string>& image_names,
                                     const Usability& usability) const {
  PredictOptions options = options_;
  options.kind = FindNetworkKind(model_);
  options.precision = kPrecisions.at(precision_);
  options.num_threads = usability.num_threads;
  if (mask_path_.empty()) return options;
  const auto has_mask = [&](const std::string& name) {
    return std::filesystem::exists(MaskPath(mask_path_, name));
  };
  if (std::none_of(image_names.begin(), image_names.end(), has_mask)) {
    Fail(mask_path_,
         "holds no mask of any photo",
         "names like " + Printable(image_names.front()) + ".png",
         "see 'vgtw mask convert'");
  }
  options.read_static_mask = [mask_path = mask_path_](const std::string& name) {
    const std::filesystem::path path = MaskPath(mask_path, name);
    return std::filesystem::exists(path) ? ReadStaticMask(path) : StaticMask();
  };
  return options;
}

}  // namespace vgtw
