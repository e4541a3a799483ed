// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_state.h"

#include "scene/error.h"
#include "scene/files.h"
#include "scene/safetensors.h"

#include <charconv>
#include <cstring>
#include <map>
#include <span>
#include <sstream>
#include <vector>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr char kOptionsKey[] = "vgtw.train_options";
constexpr char kStepsKey[] = "vgtw.steps_done";

// Tensors on the CPU with the names that they have in a file; the bytes stay theirs.
class TensorFile {
 public:
  void Add(const std::string& name, const at::Tensor& tensor) {
    if (!tensor.defined()) return;
    const at::Tensor& kept = kept_.emplace_back(tensor.detach().cpu().contiguous());
    StoredTensor stored;
    stored.type = TensorType::kF32;
    stored.shape.assign(kept.sizes().begin(), kept.sizes().end());
    stored.bytes =
        std::as_bytes(std::span(kept.data_ptr<float>(), static_cast<size_t>(kept.numel())));
    tensors_.emplace(name, std::move(stored));
  }

  void Write(const fs::path& path, const std::map<std::string, std::string>& metadata) const {
    WriteSafetensors(path, tensors_, metadata);
  }

 private:
  std::vector<at::Tensor> kept_;
  StoredTensors tensors_;
};

std::string Metadata(const SafetensorsFile& file, const char* key, const fs::path& path) {
  const auto found = file.metadata().find(key);
  if (found != file.metadata().end()) return found->second;
  Fail(path, std::string("has no metadata ") + key, "the state of a training run");
}

// What is read goes to `target` once all of it was found right.
struct Copy {
  at::Tensor values;
  at::Tensor target;
};

Copy ReadTensor(const SafetensorsFile& file,
                const std::string& name,
                const fs::path& path,
                const at::Tensor& target) {
  const auto found = file.tensors().find(name);
  const std::vector<uint64_t> shape(target.sizes().begin(), target.sizes().end());
  if (found == file.tensors().end() || found->second.type != TensorType::kF32 ||
      found->second.shape != shape) {
    Fail(path,
         "has no tensor '" + name + "' of the network's shape",
         "the state of this network's training",
         "give another --output_path");
  }
  const at::Tensor values = at::empty(target.sizes(), at::kFloat);
  std::memcpy(values.data_ptr(), found->second.bytes.data(), found->second.bytes.size());
  return {values, target};
}

int64_t ParseSteps(const std::string& text, const fs::path& path) {
  int64_t steps = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), steps);
  if (error == std::errc() && end == text.data() + text.size() && steps >= 0) return steps;
  Fail(path, "has '" + Printable(text) + "' as its steps", "a number");
}

std::string Join(const std::array<int64_t, 4>& numbers) {
  std::string text;
  for (const int64_t number : numbers) text += (text.empty() ? "" : ",") + std::to_string(number);
  return text;
}

std::string Shortest(double number) {
  std::ostringstream text;
  text << number;
  return text.str();
}

std::map<std::string, std::string> SizesOf(const NetworkDescription& network) {
  std::map<std::string, std::string> sizes;
  const auto add_lora = [&](const std::optional<LoraConfig>& lora) {
    if (lora) sizes[kLoraAlphaKey] = Shortest(lora->alpha);
  };
  if (const auto* vggt = std::get_if<VggtConfig>(&network.config)) {
    sizes[kCameraHeadsKey] = std::to_string(vggt->num_camera_heads);
    sizes[kHeadLayersKey] = Join(vggt->head_layers);
    sizes[kSideKey] = std::to_string(network.side_px);
    add_lora(vggt->lora);
  } else {
    const auto& pi3 = std::get<Pi3Config>(network.config);
    sizes[kDecoderHeadsKey] = std::to_string(pi3.num_head_heads);
    sizes[kHeadLayersKey] = Join(pi3.head_layers);
    add_lora(pi3.lora);
  }
  return sizes;
}

}  // namespace

void WriteTrainingState(const fs::path& path,
                        const TrainedParameters& parameters,
                        const AdamW::Moments& moments,
                        int64_t num_steps_done,
                        const std::string& options) {
  TensorFile file;
  for (size_t i = 0; i < parameters.all().size(); ++i) {
    const TrainedParameter& parameter = parameters.all()[i];
    if (!parameter.is_trained) continue;
    file.Add("value." + parameter.name, parameter.value);
    file.Add("first." + parameter.name, moments.first[i]);
    file.Add("second." + parameter.name, moments.second[i]);
    if (!moments.mean.empty()) file.Add("mean." + parameter.name, moments.mean[i]);
  }
  file.Write(path, {{kOptionsKey, options}, {kStepsKey, std::to_string(num_steps_done)}});
}

std::optional<int64_t> ReadTrainingState(const fs::path& path,
                                         const std::string& options,
                                         TrainedParameters& parameters,
                                         AdamW::Moments& moments) {
  if (!fs::exists(path)) return std::nullopt;
  const SafetensorsFile file(path);
  if (const std::string found = Metadata(file, kOptionsKey, path); found != options) {
    Fail(path,
         "was written by a run with other options",
         "the same ones, to go on with it",
         "give them, or another --output_path");
  }
  const int64_t num_steps_done = ParseSteps(Metadata(file, kStepsKey, path), path);
  std::vector<Copy> copies;
  const auto read = [&](const char* kind, const std::string& name, const at::Tensor& target) {
    copies.push_back(ReadTensor(file, kind + name, path, target));
  };
  for (size_t i = 0; i < parameters.all().size(); ++i) {
    const TrainedParameter& parameter = parameters.all()[i];
    if (!parameter.is_trained) continue;
    read("value.", parameter.name, parameter.value);
    read("first.", parameter.name, moments.first[i]);
    read("second.", parameter.name, moments.second[i]);
    if (!moments.mean.empty()) read("mean.", parameter.name, moments.mean[i]);
  }
  for (const Copy& copy : copies) copy.target.copy_(copy.values);
  return num_steps_done;
}

void WriteTrainedWeights(const fs::path& path,
                         const NetworkDescription& network,
                         const TrainedParameters& parameters,
                         const AdamW::Moments& moments) {
  TensorFile file;
  for (size_t i = 0; i < parameters.all().size(); ++i) {
    const TrainedParameter& parameter = parameters.all()[i];
    if (!parameter.is_trained) continue;
    file.Add(parameter.name, moments.mean.empty() ? parameter.value : moments.mean[i]);
  }
  file.Write(path, SizesOf(network));
}

}  // namespace vgtw
