// SPDX-License-Identifier: BSD-3-Clause
#include "network/probe.h"

#include "tests/parity/parity_fixture.h"
#include "tests/support/shared_data.h"

#include <stdexcept>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A VGTW and a pi3 of a few channels, 2 views of 4 x 6 patches.
class Probe : public testing::TestWithParam<bool> {
 protected:
  Probe() {
    ParityCase parity_case;
    parity_case.name = "probe";
    parity_case.num_views = 2;
    parity_case.height = 56;
    parity_case.width = 84;
    const EncoderConfig encoder = {.dim = 16, .depth = 1, .num_heads = 2, .grid_size = 3};
    if (GetParam()) {
      parity_case.config = Pi3Config{
          .encoder = encoder, .depth = 6, .head_dim = 16, .num_head_heads = 2, .camera_dim = 8};
    } else {
      VggtConfig config;
      config.encoder = encoder;
      config.dim = 16;
      config.depth = 3;
      config.num_heads = 2;
      config.num_camera_heads = 2;
      config.head_layers = {0, 1, 1, 2};
      config.dpt = {.num_features = 8, .num_channels = {8, 8, 8, 8}};
      parity_case.config = config;
    }
    model_ = std::move(MakeParityModel(parity_case).model);
    images_ = MakeParityImages(parity_case);
  }
  std::unique_ptr<Model> model_;
  at::Tensor images_;
};

TEST_P(Probe, AttentionIsAllSpentAndThePatchIsMostLikeItself) {
  const PatchProbe probe = ProbePatch(*model_, images_, {1, 2, 3}, {2}).front();
  EXPECT_NEAR(probe.attention.sum().item<double>() + probe.special_attention, 1.0, 1e-6);
  EXPECT_NEAR(probe.similarity[1][2][3].item<double>(), 1.0, 1e-6);
  EXPECT_LE(probe.similarity.max().item<double>(), 1.0 + 1e-6);
}

// The encoder sees one view at a time, and camera and register tokens of a view whose patches are
// all left out see none of them: so nothing of that view reaches the other.
TEST_P(Probe, ExcludedPatchesLeaveNoTraceInOtherViews) {
  at::Tensor first_view = at::zeros({2, 24}, at::kBool);
  first_view[0].fill_(true);
  at::Tensor changed = images_.clone();
  changed[0].fill_(0.25);
  const auto probe = [&](const at::Tensor& images, const at::Tensor& excluded) {
    return ProbePatch(*model_, images, {1, 2, 3}, {2}, {.excluded_patches = excluded}).front();
  };
  EXPECT_TRUE(at::equal(probe(images_, first_view).similarity[1],
                        probe(changed, first_view).similarity[1]));
  EXPECT_FALSE(at::equal(probe(images_, {}).similarity[1], probe(changed, {}).similarity[1]));
}

TEST_P(Probe, ExcludedPatchesGetNoAttentionAndTheOthersAllOfIt) {
  at::Tensor excluded = at::zeros({2, 24}, at::kBool);
  excluded[0].slice(0, 3, 9).fill_(true);
  const auto probes =
      ProbePatch(*model_, images_, {1, 2, 3}, {0, 2}, {.excluded_patches = excluded});
  for (const PatchProbe& probe : probes) {
    EXPECT_EQ(probe.attention[0].view({-1}).slice(0, 3, 9).abs().sum().item<double>(), 0.0);
    EXPECT_NEAR(probe.attention.sum().item<double>() + probe.special_attention, 1.0, 1e-6);
  }
  EXPECT_FALSE(at::equal(probes[0].attention, probes[1].attention));
}

TEST_P(Probe, RefusesWhatIsOutside) {
  EXPECT_THROW(ProbePatch(*model_, images_, {2, 0, 0}, {0}), std::invalid_argument);
  EXPECT_THROW(ProbePatch(*model_, images_, {0, 4, 0}, {0}), std::invalid_argument);
  EXPECT_THROW(ProbePatch(*model_, images_, {0, 0, 0}, {3}), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(Networks, Probe, testing::Bool());

}  // namespace
}  // namespace vgtw
