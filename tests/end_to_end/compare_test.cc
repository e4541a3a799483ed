// SPDX-License-Identifier: BSD-3-Clause
// `vgtw compare`.
#include "bridge/colmap_model.h"
#include "scene/files.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/model_database.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

class CompareTest : public testing::Test {
 protected:
  CompareTest() {
    Reconstruction truth = MakeSyntheticModel({});
    ProjectAgain(truth, 0.4, 1);
    Reconstruction off = truth;
    PerturbPoses(off, 1.0, 0.05, 2);
    WriteModel(off, before_, {});
    WriteModel(truth, after_, {});
    ColmapDatabase database = CreateDatabaseOf(truth, folder_ / "a.db");
    WriteMatchesOfTracks(truth, database);
  }

  std::vector<std::string> Command(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> command = {"compare", before_.string(), after_.string()};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }

  TemporaryFolder folder_;
  const fs::path before_ = folder_ / "one/sparse";
  const fs::path after_ = folder_ / "two/sparse";
};

TEST_F(CompareTest, WritesTheSameFiguresInEveryForm) {
  const std::string page = (folder_ / "report.html").string();
  const std::string csv = (folder_ / "figures.csv").string();
  const std::string markdown = (folder_ / "tables.md").string();
  const std::string json_path = (folder_ / "result.json").string();
  const ColmapRun run = RunVgtw(Command({"--database_path",
                                         (folder_ / "a.db").string(),
                                         "--output_path",
                                         page,
                                         "--csv_path",
                                         csv,
                                         "--markdown_path",
                                         markdown,
                                         "--json",
                                         json_path}));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  // Models whose folders have one name are told apart by their parents.
  const std::string answer = "'two/sparse' explains tracks held out better than 'one/sparse'.";
  EXPECT_THAT(run.output, HasSubstr(answer));
  EXPECT_THAT(ReadFile(markdown), HasSubstr(answer));
  EXPECT_THAT(ReadFile(page), HasSubstr("explains tracks held out better"));
  const json result = ReadJson(json_path);
  EXPECT_EQ(result.at("summary").at(0), answer);
  const double held_out_px = result.at("models").at(1).at("held_out_px");
  EXPECT_LT(held_out_px, 0.6);
  EXPECT_THAT(ReadFile(csv), HasSubstr(",two/sparse,720,"));
  EXPECT_THAT(ReadFile(csv), HasSubstr("," + json(held_out_px).dump() + ","));
  // Pictures belong to the page alone.
  EXPECT_FALSE(result.contains("scene"));
}

TEST_F(CompareTest, RefusesWhatItCannotRead) {
  const ColmapRun missing = RunVgtw({"compare", before_.string(), (folder_ / "none").string()});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.output, HasSubstr("none"));
  const ColmapRun twice = RunVgtw({"compare", before_.string(), before_.string()});
  EXPECT_EQ(twice.exit_code, 1);
  EXPECT_THAT(twice.output, HasSubstr("is named twice"));
  EXPECT_EQ(RunVgtw({"compare"}).exit_code, 2);
}

TEST_F(CompareTest, ReplacesNothingUnasked) {
  const fs::path page = folder_ / "report.html";
  WriteFileAtomically(page, "mine");
  const ColmapRun refused = RunVgtw(Command({"--output_path", page.string()}));
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.output, HasSubstr("--overwrite"));
  EXPECT_EQ(ReadFile(page), "mine");
  EXPECT_EQ(RunVgtw(Command({"--output_path", page.string(), "--overwrite"})).exit_code, 0);
  EXPECT_THAT(ReadFile(page), HasSubstr("</html>"));
}

}  // namespace
}  // namespace vgtw
