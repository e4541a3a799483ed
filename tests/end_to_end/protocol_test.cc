// SPDX-License-Identifier: BSD-3-Clause
// vgtw protocol, on small copies of both data sets' layouts: from the folder to the tables, whose
// numbers are those of `vgtw evaluate`.
#include "bridge/protocol.h"

#include "bridge/export_poses.h"
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "scene/files.h"
#include "scene/perturb.h"
#include "scene/synthetic.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

using testing::HasSubstr;

constexpr size_t kNumViews = 9;
const std::vector<std::string> kOnTheGo = {
    "mountain", "fountain", "corner", "patio", "spot", "patio_high"};
const std::vector<std::string> kRobustNerf = {"android", "crab1", "crab2", "yoda"};

std::string Number(size_t i) { return "00" + std::to_string(i); }

class ProtocolCommand : public testing::Test {
 protected:
  static SyntheticOptions Options() {
    SyntheticOptions options;
    options.num_views = kNumViews;
    options.width = 112;
    options.height = 84;
    return options;
  }

  ProtocolCommand() : synthetic_(Options()), truth_(MakeTruePrediction(synthetic_, 56)) {
    for (size_t i = 0; i < kNumViews; ++i) rendered_.push_back(synthetic_.Render(i));
  }

  // As Sabour et al. name photos; one view in three has distractors.
  static std::string RobustNerfName(size_t i) {
    constexpr const char* kPrefixes[] = {"0clean", "1extra", "2clutter"};
    return kPrefixes[i % 3] + Number(i) + ".png";
  }
  static std::string OnTheGoName(size_t i) { return "IMG_" + Number(i) + ".png"; }

  void WriteRobustNerf() const {
    for (const std::string& scene : kRobustNerf) {
      const std::string folder = scene == "crab1" ? "crab (1)" : scene;
      for (size_t i = 0; i < kNumViews; ++i) {
        WriteImage(folder_ / "data" / folder / "images" / RobustNerfName(i), rendered_[i].image);
      }
    }
  }

  void WriteOnTheGo() const {
    std::vector<View> views = synthetic_.views();
    for (size_t i = 0; i < kNumViews; ++i) views[i].name = OnTheGoName(i);
    std::reverse(views.begin(), views.end());  // transforms.json is in no order
    for (const std::string& scene : kOnTheGo) {
      const fs::path folder = folder_ / "data" / scene;
      for (size_t i = 0; i < kNumViews; ++i) {
        WriteImage(folder / "images" / OnTheGoName(i), rendered_[i].image);
        if (scene == "corner") WriteTrueMask(OnTheGoName(i), rendered_[i].distractor);
      }
      WriteFileAtomically(folder / "transforms.json", TransformsJson(views, "images"));
      WriteFileAtomically(folder / "split.json",
                          R"({"clutter": [2, 5, 8], "extra": [1, 4, 7], "clean": [0, 3, 6]})");
    }
  }

  void WriteTrueMask(const std::string& name, const DistractorMask& distractor) const {
    StaticMask mask(distractor.width(), distractor.height());
    std::transform(
        distractor.data().begin(), distractor.data().end(), mask.data().begin(), [](float p) {
          return p > 0.5f ? uint8_t{0} : uint8_t{255};
        });
    WriteImage(MaskPath(folder_ / "masks/corner", name), mask);
  }

  // The truth of the photos `names`, disturbed by `options`; view i is called name_of(i).
  Prediction PredictionOf(const std::vector<std::string>& names,
                          std::string (*name_of)(size_t)) const {
    Prediction prediction = truth_;
    prediction.views.clear();
    for (size_t i = 0; i < kNumViews; ++i) {
      ViewPrediction view = truth_.views[i];
      view.view.name = name_of(i);
      if (std::binary_search(names.begin(), names.end(), view.view.name)) {
        prediction.views.push_back(std::move(view));
      }
    }
    std::sort(prediction.views.begin(), prediction.views.end(), [](const auto& a, const auto& b) {
      return a.view.name < b.view.name;
    });
    return prediction;
  }

  // reference/, good/ and bad/ for every scene of the protocol, each with errors of its own; those
  // of bad/ are larger and without masks.
  void WritePredictions(std::string (*name_of)(size_t)) const {
    uint64_t seed = 1;
    for (const ProtocolScene& scene : ReadProtocol(folder_ / "p.json").scenes) {
      Prediction reference = PredictionOf(scene.clean_images, name_of);
      reference.producer = "truth";
      reference.weights_hash = "none";
      WritePrediction(reference, folder_ / "reference" / scene.name, false);
      const Prediction test = PredictionOf(scene.test_images, name_of);
      WritePrediction(Perturb(test, {.seed = seed}), folder_ / "good" / scene.name, false);
      Prediction bad =
          Perturb(test, {.rotation_deg = 2.0, .centre_percent = 6.0, .seed = seed + 100});
      for (ViewPrediction& view : bad.views) view.distractor = {};
      WritePrediction(bad, folder_ / "bad" / scene.name, false);
      ++seed;
    }
  }

  // "@x" stands for "<folder>/x", also behind "=".
  ColmapRun Run(std::vector<std::string> args) const {
    for (std::string& arg : args) {
      const size_t at = arg.find('@');
      if (at != std::string::npos) arg.replace(at, 1, folder_.path().string() + "/");
    }
    return RunVgtw(args);
  }

  ColmapRun Make(const std::string& dataset, std::vector<std::string> more = {}) const {
    std::vector<std::string> args = {"protocol",
                                     "make",
                                     "--dataset",
                                     dataset,
                                     "--input_path",
                                     "@data",
                                     "--num_images",
                                     "6",
                                     "--output_path",
                                     "@p.json"};
    args.insert(args.end(), more.begin(), more.end());
    return Run(args);
  }

  ColmapRun Tables() const {
    return Run({"protocol",
                "tables",
                "--protocol_path",
                "@p.json",
                "--reference_path",
                "@reference",
                "--system",
                "good=@good",
                "--system",
                "bad=@bad",
                "--output_path",
                "@tables"});
  }

  json Evaluate(const std::string& what,
                const std::string& system,
                const std::string& scene,
                std::vector<std::string> more) const {
    std::vector<std::string> args = {
        "evaluate", what, "--input_path", "@" + system + "/" + scene, "--json", "@evaluated.json"};
    args.insert(args.end(), more.begin(), more.end());
    const ColmapRun run = Run(args);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    return ReadJson(folder_ / "evaluated.json");
  }

  static const json& Find(const json& rows, const std::string& key, const std::string& value) {
    for (const json& row : rows) {
      if (row.at(key) == value) return row;
    }
    throw std::invalid_argument(value);
  }

  static const json& Scores(const json& tables,
                            const std::string& system,
                            const std::string& scene) {
    for (const json& row : tables.at("scores")) {
      if (row.at("system") == system && row.at("scene") == scene) return row;
    }
    throw std::invalid_argument(system + ", " + scene);
  }

  const TemporaryFolder folder_;
  const SyntheticScene synthetic_;
  const Prediction truth_;
  std::vector<SyntheticView> rendered_;
};

TEST_F(ProtocolCommand, NumbersAreThoseOfEvaluate) {
  WriteOnTheGo();
  const ColmapRun make = Make("on_the_go", {"--mask_path", "@masks"});
  ASSERT_EQ(make.exit_code, 0) << make.output;
  WritePredictions(OnTheGoName);
  const ColmapRun run = Tables();
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const json tables = ReadJson(folder_ / "tables/tables.json");

  for (const std::string system : {"good", "bad"}) {
    const std::string scene = "corner";
    const json& scores = Scores(tables, system, scene);
    const std::vector<std::string> reference = {"--reference_path",
                                                "@reference/" + scene,
                                                "--reference_keep_percent",
                                                "50",
                                                "--alignment",
                                                "pixels"};
    const json points = Evaluate("points", system, scene, reference);
    EXPECT_EQ(scores["acc"], points["accuracy"]["mean"]);
    EXPECT_EQ(scores["comp_median"], points["completeness"]["median"]);
    EXPECT_EQ(scores["overall"], points["overall"]);
    EXPECT_EQ(scores["nc"], points["normal_consistency_mean"]);
    EXPECT_EQ(scores["conditions"]["alignment"], points["alignment"]);
    EXPECT_EQ(scores["conditions"]["filter"], points["filter"]);
    const json depth = Evaluate("depth", system, scene, reference);
    EXPECT_EQ(scores["abs_rel"], depth["pixels"]["abs_rel"]);
    EXPECT_EQ(scores["delta"], depth["pixels"]["within_1_25_percent"]);
    const json pose = Evaluate(
        "pose", system, scene, {"--reference_path", "@data/" + scene + "/transforms.json"});
    EXPECT_EQ(scores["ate"], pose["ate"]["rmse"]);
    EXPECT_EQ(scores["rpe_trans"], pose["rpe"]["translation"]["rmse"]);
    EXPECT_EQ(scores["rpe_rot"], pose["rpe"]["rotation_deg"]["rmse"]);
    EXPECT_EQ(scores["conditions"]["poses"]["num_views"], 6);
  }
  // Distractors of the truth are those of the masks, but for the maps' coarser pixels.
  EXPECT_GT(Scores(tables, "good", "corner")["mask_iou"].get<double>(), 0.8);
  EXPECT_TRUE(Scores(tables, "bad", "corner")["mask_iou"].is_null());
  EXPECT_TRUE(Scores(tables, "good", "spot")["mask_iou"].is_null());
  EXPECT_EQ(tables["references"]["spot"]["producer"], "truth");
  EXPECT_EQ(tables["references"]["spot"]["files_hash"].get<std::string>().size(), 64u);
}

TEST_F(ProtocolCommand, TablesHaveThePapersRowsAndColumns) {
  WriteOnTheGo();
  ASSERT_EQ(Make("on_the_go").exit_code, 0);
  WritePredictions(OnTheGoName);
  fs::remove_all(folder_ / "bad/spot");
  const ColmapRun run = Tables();
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("warning: spot, bad: "));
  const json tables = ReadJson(folder_ / "tables/tables.json");

  const json& points = Find(tables["tables"], "name", "points_on_the_go");
  ASSERT_EQ(points["columns"].size(), 21u);
  EXPECT_EQ(points["columns"][20]["metric"], "nc");
  const json& good = points["rows"][0];
  const json& bad = points["rows"][1];
  double sum = 0.0;
  for (size_t i = 0; i < kOnTheGo.size(); ++i) {
    EXPECT_EQ(points["columns"][3 * i]["scenes"], json({kOnTheGo[i]}));
    const json& acc = Scores(tables, "good", kOnTheGo[i])["acc"];
    EXPECT_EQ(good["values"][3 * i], acc);
    sum += acc.get<double>();
  }
  EXPECT_DOUBLE_EQ(good["values"][18].get<double>(), sum / 6.0);
  EXPECT_FALSE(bad["values"][0].is_null());
  EXPECT_TRUE(bad["values"][12].is_null());
  EXPECT_TRUE(bad["values"][18].is_null());
  EXPECT_LT(good["values"][0].get<double>(), bad["values"][0].get<double>());
  EXPECT_EQ(points["rows"][2]["system"], "DUSt3R");
  EXPECT_EQ(points["rows"][2]["source"], "paper");

  const std::string latex = ReadFile(folder_ / "tables/points_on_the_go.tex");
  EXPECT_THAT(latex, HasSubstr("{c}{Low occlusion} & "));
  const std::vector<std::string> titles = {
      "Mountain", "Fountain", "Corner", "Patio", "Spot", "Patio-High"};
  for (size_t i = 0; i + 1 < titles.size(); ++i) {
    EXPECT_LT(latex.find("{" + titles[i] + "}"), latex.find("{" + titles[i + 1] + "}"));
  }
  // The dash of the scene that is missing, in a row of 22 cells.
  const size_t begin = latex.find("\nbad & ") + 1;
  const std::string row = latex.substr(begin, latex.find('\n', begin) - begin);
  EXPECT_EQ(std::count(row.begin(), row.end(), '&'), 21);
  EXPECT_THAT(row, HasSubstr(" & - & - & - & "));
}

TEST_F(ProtocolCommand, EveryLatexFileIsWhole) {
  WriteRobustNerf();
  const ColmapRun make = Make("robustnerf");
  ASSERT_EQ(make.exit_code, 0) << make.output;
  WritePredictions(RobustNerfName);
  const ColmapRun run = Tables();
  ASSERT_EQ(run.exit_code, 0) << run.output;
  size_t num_files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "tables")) {
    if (entry.path().extension() != ".tex") continue;
    const std::string text = ReadFile(entry.path());
    EXPECT_EQ(std::count(text.begin(), text.end(), '{'), std::count(text.begin(), text.end(), '}'))
        << entry.path();
    ++num_files;
    if (entry.path().filename() == "all_tables.tex") continue;
    // Cells of every row as many as columns: those of the format, which spans count more than once.
    const size_t first = text.find("{tabular}{") + 10;
    const std::string format = text.substr(first, text.find('}', first) - first);
    const auto num_columns =
        std::count_if(format.begin(), format.end(), [](char c) { return c == 'c' || c == 'l'; });
    std::istringstream lines(text.substr(text.find("\\midrule")));
    for (std::string line; std::getline(lines, line);) {
      if (!line.ends_with("\\\\")) continue;
      EXPECT_EQ(std::count(line.begin(), line.end(), '&'), num_columns - 1) << line;
    }
  }
  EXPECT_EQ(num_files, 8u);  // seven tables and the file that typesets them
  EXPECT_THAT(ReadFile(folder_ / "tables/depth_robustnerf.csv"),
              HasSubstr("\"DUSt3R\",paper,0.192,70.8,"));
}

TEST_F(ProtocolCommand, PhotosAreTheProtocols) {
  WriteRobustNerf();
  ASSERT_EQ(Make("robustnerf").exit_code, 0);
  const ColmapRun run =
      Run({"protocol", "photos", "--protocol_path", "@p.json", "--output_path", "@photos"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Protocol protocol = ReadProtocol(folder_ / "p.json");
  EXPECT_EQ(protocol.scenes[1].image_path.parent_path().filename(), "crab (1)");
  for (const ProtocolScene& scene : protocol.scenes) {
    EXPECT_EQ(ListImages(folder_ / "photos" / scene.name / "test"), scene.test_images);
    EXPECT_EQ(ListImages(folder_ / "photos" / scene.name / "clean"), scene.clean_images);
    const std::string& name = scene.test_images.front();
    EXPECT_EQ(ReadFile(folder_ / "photos" / scene.name / "test" / name),
              ReadFile(scene.image_path / name));
  }
  EXPECT_THAT(run.output, HasSubstr("vgtw predict --image_path "));
  EXPECT_THAT(run.output, HasSubstr("/photos/yoda/clean"));
}

TEST_F(ProtocolCommand, TheDrawIsTheSeedsAlone) {
  WriteRobustNerf();
  ASSERT_EQ(Make("robustnerf").exit_code, 0);
  const std::string first = ReadFile(folder_ / "p.json");
  ASSERT_EQ(Make("robustnerf", {"--overwrite"}).exit_code, 0);
  EXPECT_EQ(ReadFile(folder_ / "p.json"), first);
  ASSERT_EQ(Make("robustnerf", {"--overwrite", "--seed", "1"}).exit_code, 0);
  EXPECT_NE(ReadFile(folder_ / "p.json"), first);
}

TEST_F(ProtocolCommand, MistakesAreToldInOneLine) {
  WriteRobustNerf();
  EXPECT_THAT(Make("on_the_go").output, HasSubstr("holds no scene of on_the_go"));
  const ColmapRun bad = Make("robustnerf", {"--keep_percent", "0"});
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_THAT(bad.output, HasSubstr("'keep_percent' = 0.0, expected above 0"));
  EXPECT_FALSE(fs::exists(folder_ / "p.json"));
  ASSERT_EQ(Make("robustnerf").exit_code, 0);
  EXPECT_THAT(Make("robustnerf").output, HasSubstr("exists"));
  EXPECT_THAT(
      Make("robustnerf", {"--overwrite", "--test_images", "clutter", "--num_images", "2"}).output,
      HasSubstr("warning: scene yoda has no test image among its clean ones"));
  const ColmapRun tables = Run({"protocol",
                                "tables",
                                "--protocol_path",
                                "@p.json",
                                "--system",
                                "good",
                                "--output_path",
                                "@tables"});
  EXPECT_EQ(tables.exit_code, 1);
  EXPECT_THAT(tables.output, HasSubstr("expected NAME=FOLDER"));
  EXPECT_FALSE(fs::exists(folder_ / "tables"));
}

}  // namespace
}  // namespace vgtw
