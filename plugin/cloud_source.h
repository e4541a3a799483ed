// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "evaluation/prediction_filter.h"
#include "plugin/flags.h"
#include "scene/sim3d.h"

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// What clouds come from: a predictions folder (its depths, filtered), a COLMAP model (its points)
// or a PLY file.
class CloudSource {
 public:
  // Throws Error if `path` is none of these, or damaged.
  CloudSource(const std::filesystem::path& path, const PredictionFilterOptions& filter);

  const std::filesystem::path& path() const { return path_; }
  // Throws Error if there are none.
  const std::vector<Eigen::Vector3d>& Points();
  const std::map<std::string, Rigid3d>& poses() const { return poses_; }  // by image; none of PLY

  // The views of predictions by name; empty for the others.
  const std::map<std::string, size_t>& views() const { return idx_by_name_; }
  bool HasMaps() const;  // of depth, not only samples of it
  // Of predictions.
  const View& ViewOf(const std::string& name) const;
  ViewPrediction Filtered(const std::string& name) const;
  // "50 % most confident of all views before ...", for beside the numbers.
  std::string FilterText() const;
  nlohmann::json FilterAsJson() const;  // null if nothing is filtered

 private:
  std::filesystem::path path_;
  PredictionFilterOptions options_;
  std::unique_ptr<PredictionReader> predictions_;
  std::optional<PredictionFilter> filter_;
  std::map<std::string, size_t> idx_by_name_;
  std::map<std::string, Rigid3d> poses_;
  std::vector<Eigen::Vector3d> points_;
};

// Names of the views that both predictions have, of photos of the same size. Throws Error if there
// are none, or sizes differ.
std::vector<std::string> CommonViews(const CloudSource& prediction, const CloudSource& reference);

// How a prediction got into the world of its reference.
struct CloudAlignment {
  Sim3d reference_from_prediction;
  std::string method = "none";  // "pixels", "cameras" or "none"
  size_t num_pairs = 0;         // of pixels or cameras
  size_t num_views = 0;         // that they are of
};

// By Umeyama on the pixels or the cameras that both have. "auto" takes pixels of predictions, else
// cameras, else none. Throws Error if the method asks for what a source has not, or what they have
// in common determines no similarity.
CloudAlignment AlignClouds(const CloudSource& prediction,
                           const CloudSource& reference,
                           const std::string& method);

std::vector<Eigen::Vector3d> Moved(const Sim3d& reference_from_prediction,
                                   std::vector<Eigen::Vector3d> points);

std::string AlignmentText(const CloudAlignment& alignment);
nlohmann::json AsJson(const CloudAlignment& alignment);
nlohmann::json AsJson(const Sim3d& reference_from_prediction);

// The flags of what is compared, which commands share.
struct CloudSourceFlags {
  std::filesystem::path input_path;
  std::filesystem::path reference_path;
  PredictionFilterOptions filter;
  PredictionFilterOptions reference_filter{.keep_percent = 100.0};
  std::string keep_scope = "all";
  std::string keep_order = "before";
  std::string alignment = "auto";

  // Resolves the choices above. First use of the flags.
  void Resolve(int num_threads);
};
void AddFilterFlags(Flags& flags, CloudSourceFlags& sources);
void AddAlignmentFlag(Flags& flags, CloudSourceFlags& sources);

}  // namespace vgtw
