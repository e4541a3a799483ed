// SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>

#include <gtest/gtest.h>

namespace {

// Every test starts from the same state of the global random generators.
class SeedReset : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo&) override { std::srand(0); }
};

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  testing::UnitTest::GetInstance()->listeners().Append(new SeedReset);
  return RUN_ALL_TESTS();
}
