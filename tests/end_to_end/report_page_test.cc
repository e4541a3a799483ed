// SPDX-License-Identifier: BSD-3-Clause
// report.html as a person meets it, in a real browser.
#include "plugin/report_page.h"

#include "plugin/base64.h"
#include "plugin/subprocess.h"
#include "tests/end_to_end/browser.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using nlohmann::json;

constexpr Rgb kRed = {200, 30, 30};
constexpr Rgb kGreen = {20, 150, 40};
constexpr Rgb kBlue = {40, 60, 220};

// A cube of points around a place, dense enough to hide what is behind at 8 pixels a point.
struct Cluster {
  std::array<double, 3> centre;
  Rgb color;
};

json PointsOf(const std::vector<Cluster>& clusters) {
  constexpr int kSide = 12;
  constexpr double kSpacing = 0.02;
  constexpr double kStep = 1e-4;
  std::vector<std::byte> xyz, rgb;
  int count = 0;
  for (const Cluster& cluster : clusters) {
    for (int i = 0; i < kSide * kSide * kSide; ++i, ++count) {
      const std::array<int, 3> cell = {i % kSide, i / kSide % kSide, i / kSide / kSide};
      for (size_t k = 0; k < 3; ++k) {
        const double x = cluster.centre[k] + (cell[k] - (kSide - 1) / 2.0) * kSpacing;
        const auto q = static_cast<uint16_t>(std::lround((x + 2.0) / kStep));
        xyz.push_back(static_cast<std::byte>(q & 255));
        xyz.push_back(static_cast<std::byte>(q >> 8));
        rgb.push_back(static_cast<std::byte>(cluster.color[k]));
      }
    }
  }
  return {{"count", count},
          {"min", {-2.0, -2.0, -2.0}},
          {"step", {kStep, kStep, kStep}},
          {"xyz", Base64(xyz)},
          {"rgb", Base64(rgb)}};
}

// Cameras in a row along x, above (y is down) what they see; they look along z.
json CamerasOf(int num_views, double shift) {
  json cameras = json::array();
  for (int i = 0; i < num_views; ++i) {
    const double x = num_views == 1 ? 0.0 : -0.6 + 1.2 * i / (num_views - 1);
    cameras.push_back({{"view", i},
                       {"centre", {x, -0.6, shift}},
                       {"rotation_wxyz", {1.0, 0.0, 0.0, 0.0}},
                       {"fov_x_deg", 60.0},
                       {"fov_y_deg", 45.0}});
  }
  return cameras;
}

json ModelOf(const std::string& name, const std::string& role, double error_px) {
  return {{"name", name},
          {"path", "out/" + name},
          {"role", role},
          {"num_images", 5},
          {"median_px", error_px},
          {"mean_track_length", 3.5},
          {"error_histogram", {{"first", 0}, {"step", 0.5}, {"counts", {9, 5, 1}}}},
          {"pose_error", nullptr}};
}

json ViewOf(const std::string& name, size_t num_models) {
  json by_model = json::array();
  for (size_t k = 0; k < num_models; ++k) {
    by_model.push_back({{"median_px", 2.0 - 0.3 * static_cast<double>(k)},
                        {"rotation_change_deg", 0.1 * static_cast<double>(k)},
                        {"status", k == 0 ? json() : json("refined")}});
  }
  return {{"name", name},
          {"width", 640},
          {"height", 480},
          {"thumbnail", nullptr},
          {"overlay", nullptr},
          {"by_model", by_model}};
}

// Before: a green cube in the middle. After: a red one there, and a blue one beside it, along x.
json MakeData() {
  json data = {{"title", "a scene"},
               {"summary", {"After is better than before.", "By far."}},
               {"notes", {"a note"}},
               {"models", {ModelOf("first", "before", 2.0), ModelOf("second", "after", 0.5)}},
               {"guilty", {{{"name", "3.jpg"}, {"why", "turned far"}}}}};
  for (int i = 0; i < 5; ++i) data["views"].push_back(ViewOf(std::to_string(i) + ".jpg", 2));
  data["scene"] = {{"up", {0, -1, 0}},
                   {"centre", {0, 0, 0}},
                   {"radius", 1.0},
                   {"models",
                    {{{"cameras", CamerasOf(5, 0.2)}, {"points", PointsOf({{{0, 0, 0}, kGreen}})}},
                     {{"cameras", CamerasOf(5, 0.0)},
                      {"points", PointsOf({{{0, 0, 0}, kRed}, {{0.6, 0, 0}, kBlue}})}}}}};
  return data;
}

// Seen against z of the world, from two radii: 1 radius is 300 / (2 * 2 * tan(22.5 deg)) = 181 px.
// Up is up, so that x of the world points to the left.
constexpr const char* kFront = "points=8&photos=0&turn=0,0,2,0,0,0";

#define VGTW_NEED_3D() \
  VGTW_NEED_BROWSER(); \
  if (!ReportPageHas3D()) GTEST_SKIP() << "libjs-three was absent when this was built"

double Share(const RgbImage& a, const RgbImage& b) {
  int num_different = 0;
  for (int y = 0; y < a.height(); ++y) {
    for (int x = 0; x < a.width(); ++x) num_different += a(x, y) != b(x, y) ? 1 : 0;
  }
  return static_cast<double>(num_different) / (a.width() * a.height());
}

TEST(ReportPageInBrowser, AfterIsShownFirstAndBeforeWhenChosen) {
  VGTW_NEED_3D();
  const ReportInBrowser report(MakeData());
  const RgbImage after = report.SeeStage({.hash = kFront});
  const RgbImage before =
      report.SeeStage({.hash = kFront, .steps = "await click('input[value=before]');"});
  EXPECT_EQ(after(200, 150), kRed);
  EXPECT_EQ(before(200, 150), kGreen);
  // 0.6 radii beside it.
  EXPECT_EQ(after(200 - 109, 150), kBlue);
  EXPECT_EQ(before(200 - 109, 150), (Rgb{255, 255, 255}));
  EXPECT_EQ(after(10, 290), (Rgb{255, 255, 255}));
}

TEST(ReportPageInBrowser, TheSameStateGivesTheSamePicture) {
  VGTW_NEED_3D();
  const ReportInBrowser report(MakeData());
  const RgbImage once = report.SeeStage({.hash = "show=both"});
  EXPECT_EQ(Share(once, report.SeeStage({.hash = "show=both"})), 0.0);
  // Space goes from after to before and back again.
  const RgbImage after = report.SeeStage({.hash = kFront});
  const RgbImage again =
      report.SeeStage({.hash = kFront, .steps = "await press('#canvas', ' ', ' ');"});
  EXPECT_EQ(Share(after, again), 0.0);
}

// From the side where the blue cube is, it hides the red one.
TEST(ReportPageInBrowser, TurningTheViewChangesWhatIsSeen) {
  VGTW_NEED_3D();
  const ReportInBrowser report(MakeData());
  const RgbImage front = report.SeeStage({.hash = kFront});
  const RgbImage by_keys = report.SeeStage(
      {.hash = kFront, .steps = "await press('#canvas', ...Array(15).fill('ArrowLeft'));"});
  EXPECT_EQ(by_keys(200, 150), kBlue);
  const RgbImage by_mouse =
      report.SeeStage({.hash = kFront, .steps = "await drag([300, 250], [180, 200]);"});
  EXPECT_GT(Share(front, by_mouse), 0.05);
}

// The middle camera is 0.6 radii above the middle: 109 px.
TEST(ReportPageInBrowser, AClickOnACameraOpensItsPhoto) {
  VGTW_NEED_3D();
  const json answer = ReportInBrowser(MakeData()).Ask({.hash = kFront, .steps = R"(
      await showStageOnly();
      await drag([200, 150 - 109], [200, 150 - 109]);
      return [find('#details').open, find('#details-title').textContent,
              new URLSearchParams(frame.contentWindow.location.hash.slice(1)).get('view')];)"});
  EXPECT_EQ(answer, json({true, "2.jpg", "2.jpg"}));
}

TEST(ReportPageInBrowser, AnAddressLeadsToAPhotoAndKeysToTheNext) {
  VGTW_NEED_BROWSER();
  const json answer = ReportInBrowser(MakeData()).Ask({.hash = "view=1.jpg&sort=name", .steps = R"(
      const seen = [find('#details').open, find('#details-title').textContent];
      await press('#details', 'ArrowRight');
      seen.push(find('#details-title').textContent);
      await press('#details', 'ArrowLeft', 'ArrowLeft');
      seen.push(find('#details-title').textContent);
      await click('[aria-label=Close]');
      seen.push(find('#details').open, frame.contentWindow.location.hash);
      return seen;)"});
  EXPECT_EQ(answer, json({true, "1.jpg", "2.jpg", "0.jpg", false, "#sort=name"}));
}

TEST(ReportPageInBrowser, SaysTheAnswerFirstThenFiguresWithTheirDirection) {
  VGTW_NEED_BROWSER();
  const json answer = ReportInBrowser(MakeData()).Ask({.steps = R"(
      return { answer: find('h1').textContent, firstCard: find('.card').innerText,
               guilty: find('.guilty').innerText, rows: findAll('#plots .row').length,
               cards: findAll('.view').length };)"});
  EXPECT_EQ(answer["answer"], "After is better than before.");
  EXPECT_THAT(std::string(answer["firstCard"]), testing::HasSubstr("better"));
  EXPECT_THAT(std::string(answer["firstCard"]), testing::HasSubstr("4× lower"));
  EXPECT_THAT(std::string(answer["guilty"]), testing::HasSubstr("3.jpg turned far"));
  EXPECT_EQ(answer["cards"], 5);
  EXPECT_EQ(answer["rows"], 10);  // errors and turns of five photos
}

TEST(ReportPageInBrowser, HostileNamesStayText) {
  VGTW_NEED_BROWSER();
  const std::string name = "<img src=x onerror='window.hacked=1'></script>\"&größe 写真 🌿.jpg";
  json data = MakeData();
  data["title"] = data["command"] = data["models"][0]["name"] = data["models"][0]["path"] = name;
  data["views"][1]["name"] = name;
  data["views"][1]["by_model"][1]["reason"] = name;
  data["guilty"][0] = {{"name", name}, {"why", name}};
  const json answer = ReportInBrowser(data).Ask({.steps = R"(
      await click('.guilty button');
      return { title: find('#details-title').textContent, hacked: frame.contentWindow.hacked ?? null,
               images: findAll('img[src=x]').length };)"});
  EXPECT_EQ(answer["title"], name);
  EXPECT_EQ(answer["hacked"], nullptr);
  EXPECT_EQ(answer["images"], 0);
}

json WithLongNames(int num_views) {
  json data = MakeData();
  data["views"] = json::array();
  for (int i = 0; i < num_views; ++i) {
    const std::string name =
        "a_folder/" + std::string(90, 'x') + "_größe_写真_" + std::to_string(i) + ".jpg";
    data["views"].push_back(ViewOf(name, 2));
  }
  data["guilty"][0]["name"] = data["views"][7]["name"];
  data["scene"]["models"][1]["cameras"] = CamerasOf(num_views, 0.0);
  return data;
}

TEST(ReportPageInBrowser, FitsAPhoneWithManyLongNames) {
  VGTW_NEED_BROWSER();
  const ReportInBrowser report(WithLongNames(300));
  const json answer = report.Ask({.width = 360, .steps = R"(
      const closed = sticksOut();
      await click('.view');
      const box = find('#details').getBoundingClientRect();
      return { closed, dialog: [box.left >= 0, box.right <= 360,
               find('#details').scrollWidth <= find('#details').clientWidth],
               cards: findAll('.view').length };)"});
  EXPECT_EQ(answer["closed"], json::array());
  EXPECT_EQ(answer["dialog"], json({true, true, true}));
  EXPECT_EQ(answer["cards"], 300);
}

TEST(ReportPageInBrowser, EveryTextHasTheContrastOfAA) {
  VGTW_NEED_BROWSER();
  json data = MakeData();
  data["views"][0]["by_model"][1]["status"] = "rejected";
  data["views"][1]["by_model"][1] = nullptr;
  data["models"][1]["mean_track_length"] = 2.0;
  const ReportInBrowser report(data);
  for (const bool dark : {false, true}) {
    const json answer = report.Ask({.dark = dark, .steps = R"(
        for (const details of findAll('details')) details.open = true;
        const page = faintTexts();
        await click('.view');
        return { page, dialog: faintTexts() };)"});
    EXPECT_GT(answer["page"]["count"], 100);
    EXPECT_EQ(answer["page"]["faint"], json::array()) << "dark: " << dark;
    EXPECT_EQ(answer["dialog"]["faint"], json::array()) << "dark: " << dark;
  }
}

// Whatever is missing is left out; that nothing is on the console is checked by every visit.
TEST(ReportPageInBrowser, MissingPartsAreLeftOut) {
  VGTW_NEED_BROWSER();
  json one_model = MakeData();
  one_model["models"].erase(0);
  one_model["scene"]["models"].erase(0);
  for (json& view : one_model["views"]) view["by_model"].erase(0);
  json five_models = MakeData();
  for (int k = 0; k < 3; ++k) {
    five_models["models"].push_back(ModelOf("other", k == 2 ? "reference" : "other", 1.0));
    five_models["scene"]["models"].push_back({{"cameras", CamerasOf(5, 0.3)}, {"points", nullptr}});
    for (json& view : five_models["views"]) view["by_model"].push_back(nullptr);
  }
  json no_points = MakeData();
  for (json& model : no_points["scene"]["models"]) model["points"] = PointsOf({});
  json nulls = MakeData();
  for (json& model : nulls["models"]) model = {{"name", "m"}, {"role", model["role"]}};
  for (json& view : nulls["views"]) view["by_model"] = {nullptr, json::object()};
  nulls["scene"] = nullptr;
  nulls["guilty"] = nullptr;
  const std::vector<json> cases = {one_model, five_models, no_points, nulls, json::object()};
  for (size_t i = 0; i < cases.size(); ++i) {
    const json answer = ReportInBrowser(cases[i]).Ask({.steps = R"(
        const switches = findAll('input[name=show]');
        if (switches.length) await click('input[value=both]');
        return [switches.length > 0, findAll('#models thead th').length, findAll('.view').length];)"});
    const bool two = ReportPageHas3D() && (i == 1 || i == 2);
    const size_t num_models = cases[i].value("models", json::array()).size();
    const size_t num_views = cases[i].value("views", json::array()).size();
    EXPECT_EQ(answer, json({two, num_models, num_views})) << "case " << i;
  }
}

#define VGTW_NEED_PRINT()                                         \
  VGTW_NEED_BROWSER();                                            \
  if (FindExecutable("pdftotext").empty()) {                      \
    GTEST_SKIP() << "pdftotext not found: install poppler-utils"; \
  }                                                               \
  static_assert(true)

std::string OutputOf(const std::string& program, const std::vector<std::string>& arguments) {
  const SubprocessResult result = RunSubprocess(FindExecutable(program), arguments);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  return result.output;
}

// More models than fit side by side on a screen, and names as long as folders have them.
json WithManyModels() {
  json data = MakeData();
  for (int k = 2; k < 7; ++k) {
    data["models"].push_back(
        ModelOf("refined_with_masks_and_priors_" + std::to_string(k), "other", 100.25 + k));
    data["scene"]["models"].push_back({{"cameras", CamerasOf(5, 0.3)}, {"points", nullptr}});
    for (json& view : data["views"]) view["by_model"].push_back(nullptr);
  }
  return data;
}

// Tables are cut neither at the paper's edge nor by a scroll bar: the values of every model are
// there, and no word lies beyond the page.
TEST(ReportPageInBrowser, PaperHoldsTheWholeTable) {
  VGTW_NEED_PRINT();
  const ReportInBrowser report(WithManyModels());
  const std::string pdf = report.Print(false).string();
  const std::string text = OutputOf("pdftotext", {"-layout", pdf, "-"});
  EXPECT_THAT(text, testing::HasSubstr("After is better than before."));
  for (const char* value : {"2 px", "0.500 px", "102 px", "103 px", "104 px", "105 px", "106 px"}) {
    EXPECT_THAT(text, testing::ContainsRegex("Reprojection error .* " + std::string(value)));
  }
  EXPECT_THAT(text, testing::HasSubstr("4.jpg"));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("arrow keys")));
  const std::string boxes = OutputOf("pdftotext", {"-bbox", pdf, "-"});
  const std::regex word(R"re(<word xMin="([-\d.]+)" yMin="[-\d.]+" xMax="([-\d.]+)")re");
  int num_words = 0;
  for (std::sregex_iterator it(boxes.begin(), boxes.end(), word), end; it != end; ++it) {
    ++num_words;
    EXPECT_GE(std::stod((*it)[1]), 0.0);
    EXPECT_LE(std::stod((*it)[2]), 612.0);  // points; 8.5 inch
  }
  EXPECT_GT(num_words, 200);
}

// A dark page would cost its reader a cartridge.
TEST(ReportPageInBrowser, PaperHasALightPictureOfTheScene) {
  VGTW_NEED_3D();
  VGTW_NEED_PRINT();
  const ReportInBrowser report(MakeData());
  const TemporaryFolder folder;
  for (const bool dark : {false, true}) {
    const std::string page = folder / "page";
    OutputOf("pdftoppm",
             {"-r", "100", "-png", "-f", "1", "-l", "1", "-singlefile", report.Print(dark), page});
    const RgbImage paper = ReadRgbImage(page + ".png");
    int num_dark = 0, num_red = 0, num_blue = 0;
    for (const Rgb& pixel : paper.data()) {
      num_dark += pixel[0] < 60 && pixel[1] < 60 && pixel[2] < 60 ? 1 : 0;
      num_red += pixel == kRed ? 1 : 0;
      num_blue += pixel == kBlue ? 1 : 0;
    }
    EXPECT_LT(num_dark, static_cast<int>(paper.size()) / 20) << "dark: " << dark;
    EXPECT_GT(num_red, 30) << "dark: " << dark;
    EXPECT_GT(num_blue, 30) << "dark: " << dark;
  }
}

}  // namespace
}  // namespace vgtw
