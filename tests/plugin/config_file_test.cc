// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/config_file.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Words = std::vector<std::string>;

class ConfigFile : public testing::Test {
 protected:
  Words Flags(std::string_view text, const Words& arguments = {}) const {
    const std::filesystem::path path = folder_ / "a.conf";
    WriteFileAtomically(path, text);
    return FlagsOfConfig(path, arguments);
  }

  TemporaryFolder folder_;
};

TEST_F(ConfigFile, LinesBecomeFlags) {
  EXPECT_EQ(Flags("# a comment\ndim = 192\nname = \"a b\"  # another\n\nlayers = [1, 2, 4]\n"),
            (Words{"--dim", "192", "--name", "a b", "--layers", "1,2,4"}));
}

TEST_F(ConfigFile, CommandLineWins) {
  EXPECT_EQ(Flags("dim = 192\ndepth = 6\nheads = 4\n", {"train", "--dim", "8", "--depth=2"}),
            (Words{"--heads", "4"}));
}

TEST_F(ConfigFile, SectionsAreRefused) { EXPECT_THROW(Flags("[network]\ndim = 192\n"), Error); }

TEST_F(ConfigFile, ThatIsMissingIsAnError) {
  EXPECT_THROW(FlagsOfConfig(folder_ / "none.conf", {}), Error);
}

TEST(FindConfig, ReadsBothForms) {
  EXPECT_EQ(FindConfig({"train", "--config", "a.conf"}), "a.conf");
  EXPECT_EQ(FindConfig({"train", "--config=b.conf"}), "b.conf");
  EXPECT_EQ(FindConfig({"train", "--config"}), "");
  EXPECT_EQ(FindConfig({"train"}), "");
}

}  // namespace
}  // namespace vgtw
