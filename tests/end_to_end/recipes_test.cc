// SPDX-License-Identifier: BSD-3-Clause
// The recipes of docs/masks.md as they stand there, with the real COLMAP; hloc, nerfstudio, OpenMVS
// and 3DGRUT are stood in for by scripts that do nothing, or what the next line needs.
#include "bridge/colmap_model.h"
#include "bridge/mask_apply.h"
#include "bridge/mask_files.h"
#include "scene/files.h"
#include "scene/synthetic.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <map>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// The blocks of shell that follow a line "<!-- recipe: NAME -->", by name.
std::map<std::string, std::string> ReadRecipes() {
  const std::string text = ReadFile(fs::path(VGTW_SOURCE_DIR) / "docs/masks.md");
  const std::string mark = "<!-- recipe: ";
  const std::string fence = "```sh\n";
  std::map<std::string, std::string> recipes;
  for (size_t at = text.find(mark); at != std::string::npos; at = text.find(mark, at + 1)) {
    const size_t name = at + mark.size();
    const size_t begin = text.find(fence, at) + fence.size();
    recipes[text.substr(name, text.find(" -->", name) - name)] =
        text.substr(begin, text.find("```", begin) - begin);
  }
  return recipes;
}

// Photos of a made scene, their masks, and the tools.
class Recipes : public testing::Test {
 protected:
  void SetUp() override {
    VGTW_NEED_COLMAP();
    WriteScene();
    WriteTools();
  }

  void RunRecipe(const std::string& name) const { RunScript(ReadRecipes().at(name)); }

  fs::path Path(const std::string& name) const { return folder_ / name; }

  // Flags that COLMAP 3.13 renamed are brought to the version at hand.
  void RunScript(std::string script) const {
    Replace("--SiftExtraction.use_gpu", UseGpuFlag("feature_extractor"), script);
    Replace("--SiftMatching.use_gpu", UseGpuFlag("exhaustive_matcher"), script);
    WriteFileAtomically(Path("script.sh"),
                        "set -euo pipefail\ncd '" + folder_.path().string() +
                            "'\nexport PATH=\"$PWD/bin:$PATH\"\n" + script);
    const ColmapRun run = RunColmap({Path("script.sh").string()}, "/bin/bash");
    ASSERT_EQ(run.exit_code, 0) << script << run.output;
  }

  // Nothing is left to remove.
  void ExpectNoMatchOnDistractors(const fs::path& database_path) const {
    const ApplyMasksSummary again =
        ApplyMasks(database_path, Path("masks"), Path("again.db"), {.overwrite = true});
    EXPECT_GT(again.num_matches_after, 100u);
    EXPECT_EQ(again.num_matches_before, again.num_matches_after);
    EXPECT_EQ(again.num_inlier_matches_before, again.num_inlier_matches_after);
  }

  static void ExpectPhotosIn(const fs::path& model) {
    EXPECT_GE(ReadModel(model).images.size(), 5u);
  }

  // A copy of every photo's mask under the name that the tool wants.
  void ExpectMasks(const fs::path& folder, const std::string& ending) const {
    for (const fs::directory_entry& photo : fs::directory_iterator(Path("photos"))) {
      EXPECT_TRUE(fs::exists(folder / (photo.path().stem().string() + ending))) << photo;
    }
  }

 private:
  void WriteScene() const {
    SyntheticOptions options;
    options.num_views = 6;
    options.path_extent_deg = 40.0;
    const SyntheticScene scene(options);
    for (size_t i = 0; i < scene.views().size(); ++i) {
      const SyntheticView view = scene.Render(i);
      const std::string& name = scene.views()[i].name;
      WriteImage(Path("photos") / name, view.image);
      StaticMask mask(view.distractor.width(), view.distractor.height());
      std::transform(view.distractor.data().begin(),
                     view.distractor.data().end(),
                     mask.data().begin(),
                     [](float probability) { return probability > 0.5f ? 0 : 255; });
      WriteImage(MaskPath(Path("masks"), name), mask);
    }
    WriteFileAtomically(Path("pairs.txt"), "");
  }

  void WriteTools() const {
    fs::create_directories(Path("bin"));
    fs::create_symlink(VGTW_PROGRAM, Path("bin/vgtw"));
    for (const char* tool : {"ns-train", "InterfaceCOLMAP", "DensifyPointCloud"}) {
      WriteTool(tool, "");
    }
    WriteTool("python3",
              "if [ \"$2\" = hloc.reconstruction ]; then\n"
              "  mkdir -p \"$4\" && cp database.db \"$4\"\n"
              "fi\n");
  }
  void WriteTool(const std::string& name, const std::string& lines) const {
    WriteFileAtomically(Path("bin") / name, "#!/bin/sh\n" + lines);
    fs::permissions(Path("bin") / name, fs::perms::owner_all);
  }

  static void Replace(const std::string& from, const std::string& to, std::string& text) {
    for (size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
      text.replace(at, from.size(), to);
      at += to.size();
    }
  }

  const TemporaryFolder folder_;
};

// And what exists before a user thinks of masks.
class RecipesForAModel : public Recipes {
 protected:
  void SetUp() override {
    Recipes::SetUp();
    if (IsSkipped()) return;
    RunScript(R"(
colmap feature_extractor --database_path database.db --image_path photos/ \
  --ImageReader.single_camera 1 --SiftExtraction.use_gpu 0
colmap exhaustive_matcher --database_path database.db --SiftMatching.use_gpu 0
mkdir sparse
colmap mapper --database_path database.db --image_path photos/ --output_path sparse/
)");
  }
};

TEST_F(Recipes, LookFindsTheMasksGood) {
  RunRecipe("look");
  EXPECT_EQ(ReadImageSize(Path("preview.jpg")).width, 4u * 400 + 5 * 8);
}

TEST_F(Recipes, ColmapExtractsNothingOnDistractors) {
  RunRecipe("colmap");
  for (const ApplyMasksImageSummary& image :
       CountExcludedKeypoints(Path("database.db"), Path("masks"))) {
    EXPECT_GT(image.num_keypoints, 100u);
    EXPECT_EQ(image.num_excluded_keypoints, 0u);
  }
  ExpectPhotosIn(Path("sparse/0"));
}

TEST_F(RecipesForAModel, DatabasesLoseTheirDistractors) {
  RunRecipe("database");
  ExpectNoMatchOnDistractors(Path("masked.db"));
  ExpectPhotosIn(Path("static/0"));
  RunRecipe("hloc");
  ExpectNoMatchOnDistractors(Path("hloc/masked.db"));
  ExpectPhotosIn(Path("hloc/static/0"));

  fs::remove_all(Path("static"));
  fs::remove(Path("masked.db"));
  RunRecipe("model");
  ExpectNoMatchOnDistractors(Path("masked.db"));
  ExpectPhotosIn(Path("static"));
  EXPECT_LT(ReadModel(Path("static")).points3D.size(), ReadModel(Path("sparse/0")).points3D.size());
}

TEST_F(RecipesForAModel, MasksLieWhereNerfstudioOpenMvsAndSplattingLook) {
  RunRecipe("nerfstudio");
  ExpectMasks(Path("data/masks"), ".png");
  ExpectMasks(Path("data/images"), ".png");
  ExpectPhotosIn(Path("data/colmap/sparse/0"));

  RunRecipe("undistort");
  ExpectMasks(Path("dense/masks"), ".png.png");
  RunRecipe("openmvs");
  ExpectMasks(Path("dense/images"), ".mask.png");
  fs::remove_all(Path("dense"));
  RunRecipe("undistort");
  RunRecipe("splatting");
  ExpectMasks(Path("dense/images"), "_mask.png");
  ExpectPhotosIn(Path("dense/sparse/0"));
}

}  // namespace
}  // namespace vgtw
