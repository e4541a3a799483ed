// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/prediction.h"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace vgtw {

// The predictions folder (docs/design.md, "Files"):
//   predictions.json                          format version, producer, weights' hash, the views
//   views/<image name>.safetensors            maps of one view
// predictions.json is written last, so that a folder without it is an unfinished one.

// Reads one. The constructor reads predictions.json only; maps come view by view, so that memory
// does not grow with the number of views.
class PredictionReader {
 public:
  // Throws Error if the folder is missing, of another version, or names, sizes, cameras or poses
  // are wrong (see FindFault), or a view's file is missing.
  explicit PredictionReader(std::filesystem::path folder);

  const std::filesystem::path& folder() const { return folder_; }
  const std::string& producer() const { return producer_; }
  const std::string& weights_hash() const { return weights_hash_; }
  const std::vector<View>& views() const { return views_; }  // sorted by name

  // depth, depth_conf and points may be of any floating type, distractor_prob also U8 (255 = 1).
  // Throws Error if the file is truncated, a tensor is unknown or has a wrong type or size, or a
  // value is invalid (see FindFault).
  ViewPrediction Load(size_t view_idx) const;

 private:
  std::filesystem::path folder_;
  std::string producer_;
  std::string weights_hash_;
  std::vector<View> views_;
  std::vector<std::string> files_;
};

// Writes one: Add() each view in any order, from one thread, then Commit(). Throws
// std::invalid_argument for a view with a fault or a name given twice, Error for a name that is not
// UTF-8, a photo above 65536 pixels or a folder that cannot be written. Maps are stored as depth
// f32, depth_conf f32, distractor_prob f16, points f32, depth_samples f32 [N,4].
class PredictionWriter {
 public:
  PredictionWriter(const std::filesystem::path& folder,
                   std::string producer,
                   std::string weights_hash,
                   bool overwrite);
  ~PredictionWriter();

  void Add(const ViewPrediction& prediction);
  void Commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

void WritePrediction(const Prediction& prediction,
                     const std::filesystem::path& folder,
                     bool overwrite);
Prediction ReadPrediction(const std::filesystem::path& folder);

}  // namespace vgtw
