// SPDX-License-Identifier: BSD-3-Clause
// With a script in place of vgtw-network: what is asked of it, and what becomes of its answers.
#include "plugin/network_times.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class MeasureNetworkTest : public testing::Test {
 protected:
  void SetUp() override {
    options_.image_path = folder_ / "photos";
    options_.scratch = folder_ / "scratch";
    options_.program = folder_ / "program";
    fs::create_directories(options_.image_path);
    fs::create_directories(options_.scratch);
    for (int i = 0; i < 12; ++i) {
      std::ofstream(options_.image_path / ("photo_" + std::to_string(10 + i) + ".jpg")) << "x";
    }
    options_.num_views = {4, 12, 13};
    options_.flags = {"--weights_path", "w.safetensors"};
  }
  // The JSON file is what follows --json.
  void WriteProgram(const std::string& rest) const {
    std::ofstream(options_.program) << "#!/bin/sh\necho \"$@\" >> " << (folder_ / "calls").string()
                                    << "\nwhile [ \"$1\" != --image_path ]; do shift; done\n"
                                       "photos=$2\n"
                                       "while [ \"$1\" != --json ]; do shift; done\n"
                                    << rest;
    fs::permissions(options_.program, fs::perms::owner_all);
  }

  const TemporaryFolder folder_;
  NetworkTimesOptions options_;
};

TEST_F(MeasureNetworkTest, AddsTrunkAndHeadsOfTheMedianRun) {
  // Takes as many seconds as there are photos, and one more in each further run.
  WriteProgram("n=$(ls $photos | wc -l); r=$(grep -c photos_$n " + (folder_ / "calls").string() +
               ")\necho \"{\\\"load_sec\\\": 100, \\\"encode_sec\\\": $n, \\\"heads_sec\\\": $r, "
               "\\\"views\\\": []}\" > $2\n");
  options_.num_repeats = 3;
  const std::vector<NetworkTime> times = MeasureNetwork(options_);
  ASSERT_EQ(times.size(), 2u);  // there are not 13 photos
  EXPECT_EQ(times[0].num_views, 4);
  EXPECT_THAT(times[0].seconds, testing::ElementsAre(5.0, 6.0, 7.0));
  EXPECT_EQ(times[0].median_sec, 6.0);
  EXPECT_EQ(times[1].median_sec, 14.0);
  EXPECT_FALSE(times[0].summary.contains("views"));
  EXPECT_THAT(ReadFile(folder_ / "calls"), HasSubstr("--weights_path w.safetensors"));
  // Evenly spaced: photos 0, 3, 6, 9 of 12.
  EXPECT_TRUE(fs::exists(options_.scratch / "photos_4/photo_13.jpg"));
  EXPECT_TRUE(fs::exists(options_.scratch / "photos_4/photo_19.jpg"));
}

TEST_F(MeasureNetworkTest, AFailureOfTheNetworkIsOne) {
  WriteProgram("echo no such weights; exit 1\n");
  try {
    MeasureNetwork(options_);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("ended with 1: no such weights"));
  }
  WriteProgram("echo '{}' > $2\n");
  EXPECT_THROW(MeasureNetwork(options_), Error);
}

}  // namespace
}  // namespace vgtw
