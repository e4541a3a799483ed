// SPDX-License-Identifier: BSD-3-Clause
// Whatever refinement is given, it ends no worse than it began.
#include "tests/refine/never_worse.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr uint64_t kNumProblems = 500;
constexpr uint64_t kProblemsPerTest = 50;

class RefineModelNeverWorse : public testing::TestWithParam<uint64_t> {};

TEST_P(RefineModelNeverWorse, ThanItsSeed) { CheckNeverWorse(GetParam(), kProblemsPerTest); }

INSTANTIATE_TEST_SUITE_P(Problems,
                         RefineModelNeverWorse,
                         testing::Range(uint64_t{0}, kNumProblems, kProblemsPerTest));

}  // namespace
}  // namespace vgtw
