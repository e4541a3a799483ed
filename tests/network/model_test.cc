// SPDX-License-Identifier: BSD-3-Clause
// The names and shapes of the published checkpoints against what our networks ask for.
#include "network/pi3.h"
#include "network/vggt.h"
#include "tests/parity/parity_fixture.h"
#include "tests/support/shared_data.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Shapes = std::map<std::string, Shape>;

Shapes OfficialShapes(const std::string& network) {
  Shapes shapes = ReadParityShapes(ParityData() / ("state_dict." + network + ".txt"));
  // Point tracking is no part of reconstruction; loading skips it.
  std::erase_if(shapes, [](const auto& entry) { return entry.first.starts_with("track_head."); });
  return shapes;
}

template <typename Network, typename Config>
Shapes OurShapes(const Config& config) {
  ListingSource listing;
  const Network network(ParameterScope(listing), config);
  Shapes shapes;
  for (const ListingSource::Row& row : listing.rows()) {
    EXPECT_TRUE(shapes.emplace(row.name, row.shape).second) << row.name << " twice";
  }
  return shapes;
}

void ExpectEqual(const Shapes& ours, const Shapes& official) {
  EXPECT_EQ(ours.size(), official.size());
  for (const auto& [name, shape] : official) {
    const auto found = ours.find(name);
    if (found == ours.end()) {
      ADD_FAILURE() << name << " is missing";
    } else {
      EXPECT_EQ(found->second, shape) << name;
    }
  }
  for (const auto& [name, shape] : ours) EXPECT_TRUE(official.contains(name)) << name;
}

TEST(StateDict, OfVggtIsTheOfficialOne) {
  VGTW_NEED_PARITY_DATA();
  ExpectEqual(OurShapes<Vggt>(VggtConfig{}), OfficialShapes("VGGT-1B"));
}

TEST(StateDict, OfVgtwIsTheOfficialOne) {
  VGTW_NEED_PARITY_DATA();
  VggtConfig config;
  config.lora = LoraConfig{};
  config.has_distractor_head = true;
  ExpectEqual(OurShapes<Vggt>(config), OfficialShapes("VGTW-LoRA"));
}

TEST(StateDict, OfPi3IsTheOfficialOne) {
  VGTW_NEED_PARITY_DATA();
  ExpectEqual(OurShapes<Pi3>(Pi3Config{}), OfficialShapes("Pi3"));
}

// No such network was published: its trunk and heads are pi3's, the rest is named as in VGTW.
TEST(StateDict, OfVgtwOnPi3AddsToPi3s) {
  Pi3Config config;
  config.lora = LoraConfig{};
  config.has_distractor_head = true;
  Shapes shapes = OurShapes<Pi3>(config);
  EXPECT_EQ(shapes.at("decoder.35.attn.lora_B_v"), (Shape{1024, 32}));
  EXPECT_EQ(shapes.at("mask_head.projects.0.weight"), (Shape{256, 2048, 1, 1}));
  std::erase_if(shapes, [](const auto& entry) {
    return entry.first.starts_with("mask_head.") || entry.first.find(".lora_") != std::string::npos;
  });
  EXPECT_EQ(shapes, OurShapes<Pi3>(Pi3Config{}));
}

}  // namespace
}  // namespace vgtw
