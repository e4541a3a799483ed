// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_apply.h"

#include "bridge/colmap_schema.h"
#include "bridge/database_edit.h"
#include "bridge/mask_apply_images.h"
#include "bridge/mask_apply_rules.h"
#include "bridge/mask_model.h"
#include "bridge/mask_undo.h"
#include "bridge/sqlite.h"
#include "scene/error.h"

#include <cmath>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

int64_t Count(SqliteConnection& connection, const char* table) {
  SqliteQuery query(connection, std::string("SELECT count(*) FROM ") + table);
  return query.Next() ? query.Int(0) : 0;
}

int64_t CountUnits(SqliteConnection& connection, MaskRule rule) {
  const int64_t num_images = Count(connection, "images");
  const int64_t num_geometries = Count(connection, "two_view_geometries");
  return num_images + Count(connection, "matches") + num_geometries +
         (rule == MaskRule::kKeypoints ? num_images : 0) +
         (rule == MaskRule::kTracks ? num_geometries : 0);
}

// Refuses before any work what would be refused after it.
void CheckModelPaths(const ApplyMasksOptions& options) {
  if (options.model_path.empty()) return;
  std::error_code code;
  if (fs::equivalent(options.model_path, options.model_output_path, code) && !code) {
    Fail(options.model_output_path,
         "is the model to be read",
         "another folder: a model cannot be restored");
  }
}

}  // namespace

void ApplyMasksOptions::Check() const {
  VGTW_CHECK(dilate_px >= 0, "dilate_px = " + std::to_string(dilate_px) + ", must be >= 0");
  VGTW_CHECK(dilate_scale >= 0.0 && std::isfinite(dilate_scale),
             "dilate_scale = " + std::to_string(dilate_scale) + ", must be >= 0");
  VGTW_CHECK(min_num_inliers >= 0,
             "min_num_inliers = " + std::to_string(min_num_inliers) + ", must be >= 0");
  VGTW_CHECK(model_path.empty() == model_output_path.empty(),
             "a model needs both a folder to read and one to write");
}

ApplyMasksSummary ApplyMasks(const fs::path& database_path,
                             const fs::path& mask_folder,
                             const fs::path& output_path,
                             const ApplyMasksOptions& options,
                             const ProgressCallback& callback) {
  VGTW_CHECK(!mask_folder.empty(), "masks need a folder");
  options.Check();
  CheckModelPaths(options);
  DatabaseEdit edit(database_path, output_path, options.in_place, options.overwrite);
  ProgressCounter progress(callback, CountUnits(edit.source(), options.rule));
  std::vector<MaskedImage> images = MaskImages(edit.source(), mask_folder, options, progress);

  ApplyMasksSummary summary;
  for (const MaskedImage& image : images) summary.images.push_back(image.summary);
  std::optional<MaskedModel> model;
  if (!options.model_path.empty()) {
    model.emplace(options.model_path, images);
    model->RemoveExcluded(options.rule);
  }
  if (options.rule == MaskRule::kTracks) {
    summary.num_linked_keypoints = ExcludeTracks(edit.source(), images, progress);
  }

  // Read where it is written: the pages are at hand then.
  SqliteConnection& target = edit.target();
  MaskUndo undo(target, options.keep_undo);
  const bool removes_keypoints = options.rule == MaskRule::kKeypoints;
  if (removes_keypoints) RemoveKeypoints(target, images, undo, progress);
  FilterPairs(target,
              {.renumber = removes_keypoints,
               .min_num_inliers = static_cast<uint64_t>(options.min_num_inliers)},
              undo,
              progress,
              images,
              summary);
  if (model) {
    model->Disconnect();
    summary.model = model->Write(options.model_output_path, options.overwrite);
  }
  edit.Commit();
  return summary;
}

std::vector<ApplyMasksImageSummary> CountExcludedKeypoints(const fs::path& database_path,
                                                           const fs::path& mask_folder,
                                                           int num_threads) {
  SqliteConnection connection(database_path, SqliteConnection::Mode::kReadOnly);
  RecogniseSchema(connection);
  const SqliteTransaction snapshot(connection);
  const ApplyMasksOptions options{.allow_missing_masks = true, .num_threads = num_threads};
  ProgressCounter progress({}, 0);
  std::vector<ApplyMasksImageSummary> summaries;
  for (MaskedImage& image : MaskImages(connection, mask_folder, options, progress)) {
    summaries.push_back(std::move(image.summary));
  }
  return summaries;
}

}  // namespace vgtw
