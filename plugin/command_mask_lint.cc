// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint.h"
#include "plugin/colmap.h"
#include "plugin/commands.h"
#include "plugin/json_number.h"
#include "plugin/lint_text.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <memory>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// "2 errors, 1 warning, 0 notes"
std::string Counts(const LintReport& report) {
  return Plural(report.Count(LintSeverity::kError), "error") + ", " +
         Plural(report.Count(LintSeverity::kWarning), "warning") + ", " +
         Plural(report.Count(LintSeverity::kNote), "note");
}

const char* EffectWord(MaskEffect effect) {
  if (effect == MaskEffect::kApplied) return "applied";
  return effect == MaskEffect::kUnused ? "unused" : "photo dropped";
}

std::string EffectText(const LintImage& image) {
  if (image.effect == MaskEffect::kUnused) return "uses the whole photo";
  if (image.effect == MaskEffect::kPhotoDropped) return "drops the photo";
  if (std::isnan(image.excluded_share)) return "applies a part";
  return "keeps " + FormatNumber(100.0 * (1.0 - image.excluded_share), 2) + " %";
}

std::string MaskText(const LintImage& image) {
  if (image.mask_names.empty()) return "none";
  const size_t num_more = image.mask_names.size() - 1;
  return image.mask_names.front() + (num_more > 0 ? " +" + std::to_string(num_more) : "");
}

struct MaskLintCommand {
  fs::path image_path;
  fs::path mask_path;
  fs::path fix_path;
  fs::path colmap;
  LintMasksOptions options = {.colmap_version = ""};
  FixMasksOptions fix_options;
  Usability usability;

  void Run() {
    Apply(usability);
    if (fix_path.empty() && (fix_options.invert || fix_options.overwrite)) {
      throw Error("--invert and --overwrite are for --fix, expected a folder to write there");
    }
    if (options.colmap_version.empty()) options.colmap_version = InstalledVersion();
    options.num_threads = usability.num_threads;
    fix_options.num_threads = usability.num_threads;
    const LintReport report = Lint(mask_path, "mask lint");
    std::string text = Text(report);
    json result = Json(report);
    std::string failure;
    if (fix_path.empty()) {
      if (report.Count(LintSeverity::kError) > 0) {
        failure = Counts(report) + " in " + mask_path.string() + " (see the report)";
      }
    } else {
      failure = Fix(report, text, result);
    }
    Finish(usability, text, result);
    if (!failure.empty()) throw Error(failure);
  }

 private:
  // Without any colmap at hand, the one that says least of masks.
  std::string InstalledVersion() const {
    constexpr const char* kDebian12 = "3.8";
    try {
      return Colmap(colmap).version();
    } catch (const Error&) {
      if (!colmap.empty()) throw;
      return kDebian12;
    }
  }

  LintReport Lint(const fs::path& folder, const char* label) const {
    ProgressDisplay display(label);
    return LintMasks(image_path, folder, options, display.Callback());
  }

  // What is still wrong in the folder that was written, "" if nothing.
  std::string Fix(const LintReport& report, std::string& text, json& result) const {
    std::vector<MaskFix> fixes;
    {
      ProgressDisplay display("fix");
      fixes = FixMasks(image_path, mask_path, report, fix_path, fix_options, display.Callback());
    }
    const LintReport fixed = Lint(fix_path, "check");
    json json_fixes = json::array();
    text += "\nwritten: " + Plural(fixes.size(), "mask") + " in " + fix_path.string() + "\n";
    size_t num_lost = 0;
    for (const MaskFix& fix : fixes) {
      num_lost += fix.is_mended ? 0 : 1;
      if (!fix.what.empty()) {
        text += std::string(fix.is_mended ? "  " : "  NOT MENDED ") + fix.image_name + ": " +
                fix.what + "\n";
      }
      json_fixes.push_back({{"name", fix.image_name},
                            {"what", fix.what},
                            {"is_mended", fix.is_mended},
                            {"excluded_share", fix.excluded_share}});
    }
    for (const LintFinding& finding : report.findings) {
      if (finding.rule->code == "orphan-mask" || finding.rule->code == "unused-mask") {
        text += "  left out: " + finding.name + "\n";
      }
    }
    text += "\nlint of what was written:\n" + Text(fixed);
    result["fix"] = {
        {"output_path", fix_path.string()}, {"images", json_fixes}, {"report", Json(fixed)}};
    if (num_lost > 0) return Plural(num_lost, "mask") + " could not be mended (see the report)";
    if (fixed.Count(LintSeverity::kError) > 0) {
      return Counts(fixed) + " that --fix cannot mend (see the report)";
    }
    return "";
  }

  std::string Text(const LintReport& report) const {
    const bool has_database = !options.database_path.empty();
    std::vector<std::vector<std::string>> rows = {
        {"photo", "mask", "COLMAP " + options.colmap_version}};
    if (has_database) rows[0].insert(rows[0].end(), {"features", "excluded"});
    for (const LintImage& image : report.images) {
      rows.push_back({image.name, MaskText(image), EffectText(image)});
      if (!has_database) continue;
      rows.back().push_back(image.is_in_database ? std::to_string(image.num_keypoints) : "-");
      rows.back().push_back(image.is_in_database ? std::to_string(image.num_excluded_keypoints)
                                                 : "-");
    }
    return FormatTable(rows) + FindingsText(LintRules(), report.findings) + Counts(report) + "\n";
  }

  json Json(const LintReport& report) const {
    json images = json::array();
    for (const LintImage& image : report.images) {
      images.push_back({{"name", image.name},
                        {"masks", image.mask_names},
                        {"effect", EffectWord(image.effect)},
                        {"excluded_share", NumberOrNull(image.excluded_share)},
                        {"is_in_database", image.is_in_database},
                        {"num_keypoints", image.num_keypoints},
                        {"num_excluded_keypoints", image.num_excluded_keypoints}});
    }
    return {{"colmap_version", options.colmap_version},
            {"images", images},
            {"findings", FindingsJson(report.findings)},
            {"is_inverted", report.is_inverted},
            {"num_errors", report.Count(LintSeverity::kError)},
            {"num_warnings", report.Count(LintSeverity::kWarning)}};
  }
};

}  // namespace

std::function<void()> DeclareMaskLint(Flags& flags) {
  const auto command = std::make_shared<MaskLintCommand>();
  flags.Group("Input")
      .Require("image_path", &command->image_path, "Photos")
      .Require("mask_path", &command->mask_path, "Their masks, meant for COLMAP")
      .Add("database_path",
           &command->options.database_path,
           "COLMAP database of these photos: what masks come too late for, and a proof of "
           "inverted ones")
      .Add("colmap",
           &command->colmap,
           "The colmap executable whose behaviour is told; empty = the one on PATH, else 3.8's")
      .Add("colmap_version",
           &command->options.colmap_version,
           "The behaviour of this version instead, for instance 3.12");
  flags.Group("Output")
      .Add("fix",
           &command->fix_path,
           "Also write a corrected mask folder here. Exit code: 1 if there are errors (with "
           "--fix, if some are left), 0 with warnings and notes only")
      .Add("invert",
           &command->fix_options.invert,
           "With --fix: exchange kept and excluded; without, only where a database proves it")
      .Add("overwrite", &command->fix_options.overwrite, "With --fix: replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
