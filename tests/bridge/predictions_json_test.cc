// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions_json.h"

#include "scene/error.h"
#include "tests/support/bytes.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const std::filesystem::path kPath = "p/predictions.json";

// One view as an outside program would write it.
const std::string kText = R"({"format": "vgtw-predictions", "version": 1,
"producer": "some network", "weights_hash": "ab12", "views": [{"name": "a/b.jpg",
"original_size": [1600, 1200], "network_size": [518, 392],
"original_from_network": [[3.0, 0, 0.5], [0, 3, -0.5]],
"camera": {"model": "PINHOLE", "params": [1500.5, 1501, 800, 600]},
"cam_from_world": {"rotation_wxyz": [0.5, -0.5, 0.5, -0.5], "translation": [1, 2.5, -3e-3]},
"file": "views/a/b.jpg.safetensors"}]})";

std::string Replaced(const std::string& from, const std::string& to) {
  std::string text = kText;
  const size_t position = text.find(from);
  EXPECT_NE(position, std::string::npos) << from;
  return text.replace(position, from.size(), to);
}

std::string ErrorIn(const std::string& text) {
  return ErrorOf([&] { ParsePredictionsIndex(text, kPath); });
}

TEST(PredictionsJson, ReadsTheDocumentedFormat) {
  const PredictionsIndex index = ParsePredictionsIndex(kText, kPath);
  EXPECT_EQ(index.producer, "some network");
  EXPECT_EQ(index.weights_hash, "ab12");
  ASSERT_EQ(index.entries.size(), 1u);
  const auto& [view, file] = index.entries[0];
  EXPECT_EQ(file, "views/a/b.jpg.safetensors");
  EXPECT_EQ(view.name, "a/b.jpg");
  EXPECT_EQ(view.camera,
            (Camera{0, CameraModel::kPinhole, 1600, 1200, {1500.5, 1501.0, 800.0, 600.0}, false}));
  EXPECT_EQ(view.cam_from_world.rotation.coeffs(),
            Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5).coeffs());
  EXPECT_EQ(view.cam_from_world.translation, Eigen::Vector3d(1.0, 2.5, -3e-3));
  EXPECT_EQ(view.network_width, 518);
  EXPECT_EQ(view.network_height, 392);
  PixelMap map;
  map << 3.0, 0.0, 0.5, 0.0, 3.0, -0.5;
  EXPECT_EQ(view.original_from_network, map);
}

TEST(PredictionsJson, AnotherFormatWithoutVersionIsAnError) {
  EXPECT_THAT(ErrorIn(R"({"format": "another"})"), HasSubstr("lacks 'version'"));
}

TEST(PredictionsJson, DoublesAreReadBackExactly) {
  PredictionsIndex index = ParsePredictionsIndex(kText, kPath);
  View& view = index.entries[0].view;
  view.camera.params = {1.0 / 3.0, std::numeric_limits<double>::min(), -0.0, 1e22};
  view.cam_from_world.translation = {5e-324, -std::numeric_limits<double>::max(), 0.1 + 0.2};
  view.cam_from_world.rotation = Eigen::Quaterniond(1.0, 2.0, 3.0, 4.0).normalized();
  view.original_from_network(0, 0) = 1600.0 / 518.0;
  const std::string text = FormatPredictionsIndex(index);
  const View read = ParsePredictionsIndex(text, kPath).entries[0].view;
  EXPECT_EQ(read.camera, view.camera);
  EXPECT_EQ(read.cam_from_world.translation, view.cam_from_world.translation);
  EXPECT_EQ(read.cam_from_world.rotation.coeffs(), view.cam_from_world.rotation.coeffs());
  EXPECT_EQ(read.original_from_network, view.original_from_network);
  EXPECT_EQ(FormatPredictionsIndex(ParsePredictionsIndex(text, kPath)), text);
}

TEST(PredictionsJson, ViewsAreSortedByteWise) {
  PredictionsIndex index = ParsePredictionsIndex(kText, kPath);
  for (const std::string name : {"b.jpg", "a/B.jpg", "\xc3\xa4.jpg"}) {
    index.entries.push_back(index.entries[0]);
    index.entries.back().view.name = name;
  }
  const PredictionsIndex read = ParsePredictionsIndex(FormatPredictionsIndex(index), kPath);
  std::vector<std::string> names;
  for (const auto& entry : read.entries) names.push_back(entry.view.name);
  EXPECT_THAT(names, testing::ElementsAre("a/B.jpg", "a/b.jpg", "b.jpg", "\xc3\xa4.jpg"));
}

TEST(PredictionsJson, EveryTruncationIsAnError) {
  for (size_t length = 0; length < kText.size(); ++length) {
    EXPECT_THAT(ErrorIn(kText.substr(0, length)), HasSubstr("p/predictions.json: ")) << length;
  }
  EXPECT_EQ(ErrorIn(kText), "");
}

TEST(PredictionsJson, FaultsAreErrorsThatNameTheView) {
  struct Case {
    std::string from, to, message;
  };
  const std::string view = "view 'a/b.jpg'";
  const std::vector<Case> cases = {
      {"vgtw-predictions", "other", "has format \"other\""},
      {"\"version\": 1", "\"version\": 2", "version 2"},
      {"\"version\": 1", "\"version\": \"1\"", "version \"1\""},
      {"\"version\": 1,", "", "lacks 'version'"},
      {"\"some network\"", "7", "'producer' = 7"},
      {"\"weights_hash\"", "\"hash\"", "lacks 'weights_hash'"},
      {"[{\"name\"", "[5, {\"name\"", "view 0 is a JSON number"},
      {"a/b.jpg\",", "../b.jpg\",", "not a safe relative path"},
      {"a/b.jpg\",", "/b.jpg\",", "not a safe relative path"},
      {"1600, 1200", "1600", view + " has 'original_size' = an array of 1"},
      {"1600, 1200", "-1600, 1200", view + " has 'original_size'"},
      {"1600, 1200", "1600.0, 1200", view + " has 'original_size'"},
      {"1600, 1200", "65537, 1200", view + " has 'original_size'"},
      {"1600, 1200", "0, 1200", "image size 0 x 1200"},
      {"518, 392", "518, 1152921504606846976", view + " has 'network_size'"},
      {"[3.0, 0, 0.5], [0, 3, -0.5]", "[3.0, 0, 0.5]", "original_from_network' of two rows"},
      {"[3.0, 0, 0.5]", "[3.0, 0]", "an array of 3 finite numbers"},
      {"[3.0, 0, 0.5]", "[0, 0, 0.5]", "original_from_network has no inverse"},
      {"PINHOLE", "PINHOLE2", view + " 'camera' has model PINHOLE2"},
      {"1500.5, ", "", "3 parameters, must have 4"},
      {"1500.5", "-1", "focal length is not positive"},
      {"1500.5", "\"x\"", view + " 'camera' has 'params' = \"x\""},
      {"1500.5", "null", "'params' = null"},
      {"1500.5", "NaN", "in which NaN and Infinity do not exist"},
      {"1500.5", "1e999", "out_of_range"},
      {"0.5, -0.5, 0.5, -0.5", "1, 1, 0, 0", "not a unit quaternion"},
      {"0.5, -0.5, 0.5, -0.5", "1, 0, 0", view + " 'cam_from_world' has 'rotation_wxyz'"},
      {"views/a/b.jpg.safetensors", "../b.safetensors", view + " has its maps in"},
      {"views/a/b.jpg.safetensors", "/etc/passwd", "a file inside the folder"},
      {"\"file\"", "\"path\"", view + " lacks 'file'"},
  };
  for (const auto& [from, to, message] : cases) {
    EXPECT_THAT(ErrorIn(Replaced(from, to)), HasSubstr(message)) << from << " -> " << to;
  }
}

TEST(PredictionsJson, RepeatedViewsAreAnError) {
  PredictionsIndex index = ParsePredictionsIndex(kText, kPath);
  index.entries.push_back(index.entries[0]);
  EXPECT_THAT(ErrorIn(FormatPredictionsIndex(index)), HasSubstr("view 'a/b.jpg' twice"));
}

TEST(PredictionsJson, NamesThatAreNotUtf8AreAnError) {
  PredictionsIndex index = ParsePredictionsIndex(kText, kPath);
  index.entries[0].view.name = "caf\xe9.jpg";  // Latin-1
  EXPECT_THAT(ErrorOf([&] { FormatPredictionsIndex(index); }),
              AllOf(HasSubstr("not UTF-8"), HasSubstr("rename the photo")));
}

}  // namespace
}  // namespace vgtw
