// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/protocol.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;
using testing::HasSubstr;

Protocol SampleProtocol() {
  Protocol protocol;
  protocol.dataset = "on_the_go";
  protocol.dataset_path = "data";
  protocol.sampling.seed = UINT64_MAX;
  protocol.conditions.keep_percent = 33.3;
  protocol.conditions.alignment = "dataset_cameras";
  ProtocolScene scene;
  scene.name = "patio_high";
  scene.title = "Patio-High";
  scene.group = "High occlusion";
  scene.image_path = "patio_high/images";
  scene.test_images = {"a.jpg", "b/c.jpg"};
  scene.clean_images = {"a.jpg"};
  scene.mask_path = "/masks/patio_high";
  scene.pose_reference_path = "patio_high/transforms.json";
  protocol.scenes = {scene};
  return protocol;
}

TEST(Protocol, IsReadAsItWasWritten) {
  const std::string text = FormatProtocol(SampleProtocol());
  const Protocol read = ParseProtocol(text, "p.json");
  EXPECT_EQ(FormatProtocol(read), text);
  EXPECT_EQ(read.sampling.seed, UINT64_MAX);
  EXPECT_EQ(read.conditions.keep_percent, 33.3);
  EXPECT_EQ(read.scenes.at(0).test_images, SampleProtocol().scenes[0].test_images);
  EXPECT_EQ(read.scenes.at(0).pose_reference_path, "patio_high/transforms.json");
}

TEST(Protocol, PathsAreRelativeToItsFileAndToTheDataset) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "p.json", FormatProtocol(SampleProtocol()));
  const Protocol read = ReadProtocol(folder / "p.json");
  EXPECT_EQ(read.scenes.at(0).image_path, folder / "data/patio_high/images");
  EXPECT_EQ(read.scenes.at(0).mask_path, "/masks/patio_high");
  EXPECT_EQ(read.scenes.at(0).reference_path, "");
}

// Every fault that a hand may write in, with what the message says of it.
TEST(Protocol, RefusesNonsenseInOneLine) {
  struct Case {
    const char* pointer;  // what is replaced
    json value;
    const char* message;
  };
  const Case cases[] = {
      {"/version", 2, "version 2, expected format \"vgtw-protocol\", version 1"},
      {"/dataset_path", "a\nb", "dataset_path"},
      {"/sampling/num_images", 1, "'num_images' = 1, expected at least 2"},
      {"/sampling/seed", -1, "a whole number from 0"},
      {"/sampling/test_images", "some", "one of mixed, clean, clutter"},
      {"/conditions/keep_percent", 0.0, "above 0, at most 100"},
      {"/conditions/keep_percent", 100.5, "above 0, at most 100"},
      {"/conditions/mask_threshold", "half", "a finite number"},
      {"/conditions/alignment", "pixel", "one of pixels, cameras, dataset_cameras, auto, none"},
      {"/conditions/num_normal_neighbours", 2, "at least 3"},
      {"/conditions/rpe_delta", 0, "at least 1"},
      {"/scenes", json::array(), "no scene"},
      {"/scenes/0", 5, "scene 0 is a JSON number"},
      {"/scenes/0/name", "a/b", "a name without '/'"},
      {"/scenes/0/name", "..", "cannot be a folder"},
      {"/scenes/0/test_images", json::array({"a.jpg"}), "1 test images, expected at least 2"},
      {"/scenes/0/test_images", json::array({"b.jpg", "a.jpg"}), "sorted by bytes"},
      {"/scenes/0/test_images", json::array({"a.jpg", "a.jpg"}), "each name once"},
      {"/scenes/0/clean_images", json::array({"../a.jpg"}), "inside the photos' folder"},
      {"/scenes/0/clean_images", json::array({7}), "an array of strings"},
      {"/scenes/0/mask_convention", "painted", "a word of vgtw mask convert"},
  };
  const json good = json::parse(FormatProtocol(SampleProtocol()));
  for (const Case& bad : cases) {
    json changed = good;
    changed[json::json_pointer(bad.pointer)] = bad.value;
    try {
      ParseProtocol(changed.dump(), "p.json");
      FAIL() << bad.pointer << " = " << bad.value << " was accepted";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(bad.message)) << bad.pointer;
      EXPECT_THAT(error.what(), HasSubstr("p.json")) << bad.pointer;
    }
  }
}

TEST(Protocol, EveryFieldIsNeeded) {
  const json good = json::parse(FormatProtocol(SampleProtocol())).flatten();
  for (const auto& [pointer, value] : good.items()) {
    if (pointer.find("_images/") != std::string::npos) continue;  // elements of lists
    json changed = json::parse(FormatProtocol(SampleProtocol()));
    const json::json_pointer at(pointer);
    changed[at.parent_pointer()].erase(at.back());
    EXPECT_THROW(ParseProtocol(changed.dump(), "p.json"), Error) << pointer;
  }
}

TEST(Protocol, RefusesAnotherSceneOfTheName) {
  Protocol protocol = SampleProtocol();
  protocol.scenes.push_back(protocol.scenes[0]);
  EXPECT_THROW(ParseProtocol(FormatProtocol(protocol), "p.json"), Error);
}

}  // namespace
}  // namespace vgtw
