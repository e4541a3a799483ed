// SPDX-License-Identifier: BSD-3-Clause
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

TEST(Doctor, NamesTheColmapThatIsHereAndItsSchema) {
  VGTW_NEED_COLMAP();
  const TemporaryFolder folder;
  const std::string json_path = folder / "doctor.json";
  const ColmapRun run = RunVgtw({"doctor", "--colmap", ColmapExecutable(), "--json", json_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const nlohmann::json report = ReadJson(json_path);
  const std::string version = report["colmap"]["version"];
  EXPECT_THAT(RunColmap({"-h"}).output, HasSubstr("COLMAP " + version));
  EXPECT_THAT(std::string(report["colmap"]["schema"]), HasSubstr("COLMAP"));
  EXPECT_THAT(run.output, HasSubstr("Next: vgtw demo"));
  EXPECT_GT(report["memory_gib"].get<double>(), 0.1);
}

TEST(Doctor, SaysWhatToInstallWhereColmapIsMissing) {
  const ColmapRun run = RunVgtw({"doctor", "--colmap", "/nonexistent/colmap"});
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("missing  colmap"));
  EXPECT_THAT(run.output, HasSubstr("apt-get install colmap"));
}

}  // namespace
}  // namespace vgtw
