// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions.h"

#include "bridge/predictions_json.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/float16.h"
#include "scene/safetensors.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include <Eigen/Core>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr char kIndexFile[] = "predictions.json";
constexpr size_t kMaxIndexBytes = size_t{256} << 20;

constexpr char kDepth[] = "depth";
constexpr char kDepthConf[] = "depth_conf";
constexpr char kDistractor[] = "distractor_prob";
constexpr char kPoints[] = "points";
constexpr char kSamples[] = "depth_samples";
constexpr size_t kSampleSize = 4;  // x, y, depth, confidence

std::vector<uint64_t> ShapeOf(const View& view) {
  return {static_cast<uint64_t>(view.network_height), static_cast<uint64_t>(view.network_width)};
}

std::string TextOf(const std::vector<uint64_t>& shape) {
  std::string text = "[";
  for (const uint64_t size : shape) {
    if (text.size() > 1) text += ',';
    text += std::to_string(size);
  }
  return text + "]";
}

bool IsFloating(TensorType type) {
  return type == TensorType::kF64 || type == TensorType::kF32 || type == TensorType::kF16 ||
         type == TensorType::kBF16;
}

// Tensors of one view's file; every mismatch throws Error with the file.
class ViewTensors {
 public:
  ViewTensors(const StoredTensors& tensors, const fs::path& path) : tensors_(tensors), path_(path) {
    static const std::set<std::string_view> kKnown = {
        kDepth, kDepthConf, kDistractor, kPoints, kSamples};
    for (const auto& [name, tensor] : tensors) {
      if (!kKnown.contains(name)) {
        Fail(path_,
             "holds a tensor '" + Printable(name) + "'",
             "only depth, depth_conf, distractor_prob, points, depth_samples");
      }
    }
  }

  // Values of a tensor of this shape, empty if it is absent; U8 means 0..255 for 0..1.
  std::vector<float> Read(const char* name, const std::vector<uint64_t>& shape) const {
    const StoredTensor* tensor = Find(name);
    if (tensor == nullptr) return {};
    if (tensor->shape != shape) {
      Fail(path_, std::string(name) + " has shape " + TextOf(tensor->shape), TextOf(shape));
    }
    if (tensor->type == TensorType::kU8 && std::string_view(name) == kDistractor) {
      std::vector<float> values(tensor->NumElements());
      std::transform(tensor->bytes.begin(), tensor->bytes.end(), values.begin(), [](std::byte b) {
        return static_cast<float>(b) / 255.0f;
      });
      return values;
    }
    if (!IsFloating(tensor->type)) {
      Fail(path_,
           std::string(name) + " has type " + std::string(TensorTypeName(tensor->type)),
           "F32 or F16");
    }
    return ToFloats(*tensor);
  }

  // As Read, of shape [N,columns] with any N.
  std::vector<float> ReadRows(const char* name, uint64_t columns) const {
    const StoredTensor* tensor = Find(name);
    if (tensor == nullptr) return {};
    const uint64_t rows = tensor->shape.empty() ? 0 : tensor->shape.front();
    return Read(name, {rows, columns});
  }

 private:
  const StoredTensor* Find(const char* name) const {
    const auto found = tensors_.find(name);
    return found == tensors_.end() ? nullptr : &found->second;
  }

  const StoredTensors& tensors_;
  const fs::path& path_;
};

Grid<float> ToGrid(const View& view, std::vector<float> values) {
  if (values.empty()) return {};
  Grid<float> grid(view.network_width, view.network_height);
  grid.data() = std::move(values);
  return grid;
}

Grid<Eigen::Vector3f> ToPointGrid(const View& view, const std::vector<float>& values) {
  if (values.empty()) return {};
  Grid<Eigen::Vector3f> grid(view.network_width, view.network_height, Eigen::Vector3f::Zero());
  for (size_t i = 0; i < grid.size(); ++i) {
    grid.data()[i] = Eigen::Map<const Eigen::Vector3f>(values.data() + 3 * i);
  }
  return grid;
}

std::vector<DepthSample> ToSamples(const std::vector<float>& values) {
  std::vector<DepthSample> samples(values.size() / kSampleSize);
  for (size_t i = 0; i < samples.size(); ++i) {
    const float* row = values.data() + kSampleSize * i;
    samples[i] = {{row[0], row[1]}, row[2], row[3]};
  }
  return samples;
}

ViewPrediction FromTensors(const View& view, const StoredTensors& tensors, const fs::path& path) {
  const ViewTensors reader(tensors, path);
  const std::vector<uint64_t> shape = ShapeOf(view);
  ViewPrediction prediction;
  prediction.view = view;
  prediction.depth = ToGrid(view, reader.Read(kDepth, shape));
  prediction.depth_conf = ToGrid(view, reader.Read(kDepthConf, shape));
  prediction.distractor = ToGrid(view, reader.Read(kDistractor, shape));
  prediction.points = ToPointGrid(view, reader.Read(kPoints, {shape[0], shape[1], 3}));
  prediction.depth_samples = ToSamples(reader.ReadRows(kSamples, kSampleSize));
  const std::string fault = FindFault(prediction);
  if (!fault.empty()) Fail(path, "cannot be used: " + fault, "valid maps", "write it again");
  return prediction;
}

void WriteMaps(const ViewPrediction& prediction, const fs::path& path) {
  const std::vector<uint64_t> shape = ShapeOf(prediction.view);
  StoredTensors tensors;
  const auto put = [&](const char* name, TensorType type, auto shape_of, const auto& values) {
    if (values.empty()) return;
    tensors[name] = {type, std::move(shape_of), std::as_bytes(std::span(values))};
  };
  std::vector<uint16_t> distractor(prediction.distractor.size());
  std::transform(prediction.distractor.data().begin(),
                 prediction.distractor.data().end(),
                 distractor.begin(),
                 HalfOfFloat);
  std::vector<float> samples;
  samples.reserve(kSampleSize * prediction.depth_samples.size());
  for (const DepthSample& sample : prediction.depth_samples) {
    const Eigen::Vector2f& pixel = sample.pixel_in_original;
    samples.insert(samples.end(), {pixel.x(), pixel.y(), sample.depth, sample.confidence});
  }
  put(kDepth, TensorType::kF32, shape, prediction.depth.data());
  put(kDepthConf, TensorType::kF32, shape, prediction.depth_conf.data());
  put(kDistractor, TensorType::kF16, shape, distractor);
  put(kSamples,
      TensorType::kF32,
      std::vector<uint64_t>{prediction.depth_samples.size(), kSampleSize},
      samples);
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float), "points are stored as they lie");
  put(kPoints,
      TensorType::kF32,
      std::vector<uint64_t>{shape[0], shape[1], 3},
      prediction.points.data());
  WriteSafetensors(path, tensors);
}

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

}  // namespace

PredictionReader::PredictionReader(fs::path folder) : folder_(std::move(folder)) {
  const fs::path index_path = folder_ / kIndexFile;
  if (!IsFile(index_path)) {
    Fail(folder_,
         "holds no predictions.json",
         "a finished predictions folder",
         "make one with vgtw predict or vgtw import");
  }
  PredictionsIndex index = ParsePredictionsIndex(ReadFile(index_path, kMaxIndexBytes), index_path);
  producer_ = std::move(index.producer);
  weights_hash_ = std::move(index.weights_hash);
  for (PredictionsIndex::Entry& entry : index.entries) {
    if (!IsFile(folder_ / entry.file)) {
      Fail(folder_ / entry.file,
           "is missing",
           "the maps of view '" + Printable(entry.view.name) + "'",
           "copy the whole predictions folder");
    }
    views_.push_back(std::move(entry.view));
    files_.push_back(std::move(entry.file));
  }
}

ViewPrediction PredictionReader::Load(size_t view_idx) const {
  VGTW_CHECK(view_idx < views_.size(), "there is no view " + std::to_string(view_idx));
  const fs::path path = folder_ / files_[view_idx];
  const SafetensorsFile file(path);
  return FromTensors(views_[view_idx], file.tensors(), path);
}

struct PredictionWriter::Impl {
  AtomicFolder folder;
  PredictionsIndex index;
  std::set<std::string> names;
};

PredictionWriter::PredictionWriter(const fs::path& folder,
                                   std::string producer,
                                   std::string weights_hash,
                                   bool overwrite)
    : impl_(new Impl{{folder, overwrite}, {std::move(producer), std::move(weights_hash), {}}, {}}) {
}

PredictionWriter::~PredictionWriter() = default;

void PredictionWriter::Add(const ViewPrediction& prediction) {
  const std::string fault = FindFault(prediction);
  VGTW_CHECK(fault.empty(), fault);
  const View& view = prediction.view;
  VGTW_CHECK(impl_->names.insert(view.name).second, "view " + view.name + " was given twice");
  PredictionsIndex::Entry entry = {view, "views/" + view.name + ".safetensors"};
  // What the index cannot hold is refused here, not after hours of other views.
  ParsePredictionsIndex(FormatPredictionsIndex({"", "", {entry}}), kIndexFile);
  const fs::path path = impl_->folder.path() / entry.file;
  std::error_code code;
  fs::create_directories(path.parent_path(), code);
  if (code) throw Error(Printable(path.string()) + ": cannot be written: " + code.message());
  WriteMaps(prediction, path);
  impl_->index.entries.push_back(std::move(entry));
}

void PredictionWriter::Commit() {
  auto& entries = impl_->index.entries;
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
    return a.view.name < b.view.name;
  });
  WriteFileAtomically(impl_->folder.path() / kIndexFile, FormatPredictionsIndex(impl_->index));
  impl_->folder.Commit();
}

void WritePrediction(const Prediction& prediction, const fs::path& folder, bool overwrite) {
  PredictionWriter writer(folder, prediction.producer, prediction.weights_hash, overwrite);
  for (const ViewPrediction& view : prediction.views) writer.Add(view);
  writer.Commit();
}

Prediction ReadPrediction(const fs::path& folder) {
  const PredictionReader reader(folder);
  Prediction prediction = {reader.producer(), reader.weights_hash(), {}};
  for (size_t i = 0; i < reader.views().size(); ++i) prediction.views.push_back(reader.Load(i));
  return prediction;
}

}  // namespace vgtw
