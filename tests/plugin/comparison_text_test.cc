// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison_text.h"

#include "plugin/comparison.h"
#include "tests/support/synthetic_model.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using nlohmann::json;

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

json MakeComparison(const std::string& image_name) {
  Reconstruction model = MakeSyntheticModel({});
  model.images.at(1).name = image_name;
  ComparisonInputs inputs;
  inputs.title = "a against b";
  inputs.models = {{"a", "a/", model}, {"b", "b/", model}};
  return CompareModels(inputs);
}

TEST(FormatComparison, LeavesOutWhatIsNotKnown) {
  json comparison = MakeComparison("image1.jpg");
  std::string text = FormatComparison(comparison);
  EXPECT_TRUE(Contains(text, "median px"));
  EXPECT_FALSE(Contains(text, "held out"));
  EXPECT_FALSE(Contains(text, "error: "));
  EXPECT_FALSE(Contains(text, "status"));
  comparison["models"][0]["held_out_px"] = 1.25;
  text = FormatComparison(comparison);
  EXPECT_TRUE(Contains(text, "held out px"));
  EXPECT_TRUE(Contains(text, "1.250"));
}

TEST(ComparisonAsCsv, HasARowPerModelAndPhotoAndQuotesNames) {
  const std::string csv = ComparisonAsCsv(MakeComparison("street, \"left\".jpg"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 2 + 2 * 6);
  EXPECT_TRUE(csv.starts_with("photo,model,num_observations,"));
  EXPECT_TRUE(Contains(csv, "\r\n\"street, \"\"left\"\".jpg\",a,120,6.0,"));
  EXPECT_TRUE(Contains(csv, "\r\nimage2.jpg,b,120,6.0,"));
  // Every row has as many fields as the header; the quoted name holds one comma.
  const auto num_commas = [](const std::string& line) {
    return std::count(line.begin(), line.end(), ',');
  };
  const std::string header = csv.substr(0, csv.find('\r'));
  const size_t begin = csv.find("\r\nimage2.jpg") + 2;
  EXPECT_EQ(num_commas(csv.substr(begin, csv.find('\r', begin) - begin)), num_commas(header));
}

TEST(ComparisonAsMarkdown, EscapesWhatWouldEndACell) {
  const std::string markdown = ComparisonAsMarkdown(MakeComparison("a|b.jpg"));
  EXPECT_TRUE(markdown.starts_with("# a against b\n"));
  EXPECT_TRUE(Contains(markdown, "| a\\|b.jpg |"));
}

}  // namespace
}  // namespace vgtw
