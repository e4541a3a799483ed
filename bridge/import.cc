// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"

#include "bridge/conventions.h"
#include "bridge/importer.h"
#include "bridge/predictions.h"
#include "scene/error.h"

#include <array>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr std::array kImporters = {&kColmapImporter,
                                   &kVggtNpzImporter,
                                   &kDa3NpzImporter,
                                   &kNpzFolderImporter,
                                   &kLlffImporter,
                                   &kTumImporter,
                                   &kMonst3rImporter,
                                   &kVggtLongImporter,
                                   &kCut3rImporter,
                                   &kDust3rImporter,
                                   &kFast3rImporter,
                                   &kPi3Importer,
                                   &kMapAnythingImporter};

struct Located {
  const Importer* importer = nullptr;
  fs::path path;
};

std::string FormatList() {
  std::string list;
  for (const Importer* importer : kImporters) {
    list += (list.empty() ? "" : "; ") + std::string(importer->name) + ": " +
            std::string(importer->description);
  }
  return list;
}

// Files that people try, but that lack what is needed.
[[noreturn]] void FailUnknown(const fs::path& input_path) {
  const fs::path extension = input_path.extension();
  for (const char* mesh : {".ply", ".glb", ".obj", ".pcd"}) {
    if (extension != mesh) continue;
    Fail(
        input_path,
        "is a point cloud or mesh (" + std::string(mesh) + "), which tells no camera of a photo",
        FormatList(),
        "for pi3 save its output as demo_gradio.py does: numpy.savez(\"predictions.npz\", points=, "
        "conf=, camera_poses=)");
  }
  for (const char* pickled : {".pt", ".pth", ".pkl", ".pickle"}) {
    if (extension != pickled) continue;
    Fail(input_path,
         "is a pickle (" + std::string(pickled) + "), which can hold any program",
         FormatList(),
         "load it where you trust it and save its arrays by numpy.savez under the same names");
  }
  Fail(input_path, "is of no known format", FormatList());
}

Located LocateAs(ImportFormat format, const fs::path& input_path, const PhotoIndex& photos) {
  for (const Importer* importer : kImporters) {
    if (importer->format != format) continue;
    if (const auto path = importer->locate(input_path, photos)) return {importer, *path};
    Fail(input_path,
         "is no " + std::string(importer->name),
         std::string(importer->description),
         "leave --format out to have it recognised");
  }
  throw std::invalid_argument("ImportOptions::format is not a known format");
}

Located Recognise(const fs::path& input_path, const PhotoIndex& photos) {
  Located found;
  for (const Importer* importer : kImporters) {
    const auto path = importer->locate(input_path, photos);
    if (!path) continue;
    if (found.importer != nullptr && importer->special_case_of != found.importer) {
      Fail(
          input_path,
          "holds both " + std::string(found.importer->name) + " and " + std::string(importer->name),
          "one format",
          "say which by --format");
    }
    found = {importer, *path};
  }
  if (found.importer == nullptr) FailUnknown(input_path);
  return found;
}

void Count(const ViewPrediction& prediction, ImportSummary& summary) {
  ++summary.num_views;
  summary.num_views_with_depth += prediction.depth.empty() ? 0 : 1;
  summary.num_views_with_samples += prediction.depth_samples.empty() ? 0 : 1;
  summary.num_views_with_distractors += prediction.distractor.empty() ? 0 : 1;
}

void CheckView(const ImportJob& job, const ImportedView& imported) {
  if (job.options.repair.swap_quaternion_order && imported.pose.form == RotationForm::kMatrix) {
    Fail(job.input_path,
         "holds rotations as matrices",
         "quaternions to swap",
         "leave --swap_quaternion_order out");
  }
  const std::string fault = FindFault(imported.prediction);
  if (!fault.empty()) {
    Fail(job.input_path, Printable(imported.prediction.view.name) + ": " + fault, "a usable view");
  }
}

}  // namespace

ImportSummary Import(const fs::path& input_path,
                     const fs::path& image_folder,
                     const fs::path& output_folder,
                     const ImportOptions& options,
                     const ProgressCallback& progress) {
  std::error_code code;
  if (!fs::exists(input_path, code)) Fail(input_path, "does not exist", FormatList());
  ImportJob job{{}, image_folder, ListPhotos(image_folder, options.num_threads), options};
  const PhotoIndex photos(job.photos);
  const Located located = options.format == ImportFormat::kAuto
                              ? Recognise(input_path, photos)
                              : LocateAs(options.format, input_path, photos);
  job.input_path = located.path;
  ImportSummary summary;
  summary.format = located.importer->format;
  PredictionWriter writer(
      output_folder, "import " + std::string(located.importer->name), "", options.overwrite);
  ConventionCheck conventions(job);
  const auto sink = [&](const ImportedView& imported) {
    CheckView(job, imported);
    writer.Add(imported.prediction);
    conventions.Add(imported);
    Count(imported.prediction, summary);
    if (progress) {
      progress(static_cast<int64_t>(summary.num_views), static_cast<int64_t>(job.photos.size()));
    }
  };
  located.importer->read(job, sink, summary);
  if (summary.num_views == 0) Fail(job.input_path, "gives no usable view", "at least one");
  for (std::string& mistake : conventions.FindMistakes()) {
    summary.warnings.push_back(std::move(mistake));
  }
  writer.Commit();
  return summary;
}

}  // namespace vgtw
