// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_selection.h"

#include "matching/pair_graph.h"
#include "scene/disjoint_sets.h"
#include "scene/perturb.h"
#include "scene/random.h"
#include "scene/static_view.h"
#include "scene/synthetic.h"
#include "tests/support/wall_prediction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using IndexPair = std::pair<size_t, size_t>;

std::vector<ViewSketch> SketchAll(const Prediction& prediction) {
  std::vector<ViewSketch> sketches;
  for (const ViewPrediction& view : prediction.views) {
    sketches.push_back(MakeViewSketch(StaticView(view, 0.5), 0.0));
  }
  return sketches;
}

std::vector<ViewSketch> SketchWallFrom(const std::vector<Eigen::Vector2d>& xzs) {
  Prediction prediction;
  for (const Eigen::Vector2d& xz : xzs) {
    ViewPrediction view = MakeWallView("a.png", xz.x());
    view.view.cam_from_world.translation.z() = -xz.y();
    view.depth = DepthMap(32, 24, static_cast<float>(kWallDepth - xz.y()));
    prediction.views.push_back(view);
  }
  return SketchAll(prediction);
}

std::set<IndexPair> IndicesOf(const std::vector<ViewPair>& pairs) {
  std::set<IndexPair> indices;
  for (const ViewPair& pair : pairs) indices.emplace(pair.view_idx1, pair.view_idx2);
  return indices;
}

std::vector<ViewPair> MeasureAll(const std::vector<ViewSketch>& sketches) {
  const Covisibility covisibility(sketches, {});
  std::vector<ViewPair> pairs;
  for (size_t i = 0; i < sketches.size(); ++i) {
    for (size_t j = i + 1; j < sketches.size(); ++j) {
      if (const auto pair = covisibility.Measure(i, j)) pairs.push_back(*pair);
    }
  }
  return pairs;
}

size_t NumParts(size_t num_views, const std::vector<ViewPair>& pairs) {
  DisjointSets<> parts(num_views);
  for (const ViewPair& pair : pairs) parts.Join(pair.view_idx1, pair.view_idx2);
  return parts.num_sets();
}

PairSelectionOptions TakeAllGood() {
  PairSelectionOptions options;
  options.num_best = 1000;
  options.min_angle_deg = 0.0;
  return options;
}

// A view with exact depth and every 4th of its points along x and y.
struct TrueView {
  explicit TrueView(const ViewPrediction& prediction) : view(prediction, 0.5) {
    for (const StaticView::Point& point : view.StaticPoints(0.0)) {
      const Eigen::Vector2d pixel =
          Apply(Inverse(prediction.view.original_from_network), point.pixel_in_original);
      if (static_cast<int>(pixel.x()) % 4 != 0 || static_cast<int>(pixel.y()) % 4 != 0) continue;
      points.push_back(point.xyz);
    }
  }

  Eigen::Vector3d RayTo(const Eigen::Vector3d& point) const {
    return (point - OriginInSource(view.view().cam_from_world)).normalized();
  }

  // The share of its points that another view sees at the same depth within 2 %, and not under more
  // than 60 deg.
  double ShareSeenBy(const TrueView& other) const {
    const auto num_seen =
        std::count_if(points.begin(), points.end(), [&](const Eigen::Vector3d& point) {
          return RayTo(point).dot(other.RayTo(point)) >= 0.5 && other.view.See(point, 0.02);
        });
    return static_cast<double>(num_seen) / static_cast<double>(points.size());
  }

  StaticView view;
  std::vector<Eigen::Vector3d> points;
};

struct TrueScene {
  Prediction prediction;
  std::map<IndexPair, double> shares;  // the smaller one of both directions
};

TrueScene MakeTrueScene(CameraPath path) {
  const SyntheticScene scene({.path = path, .num_views = 18, .path_extent_deg = 340.0});
  TrueScene truth{MakeTruePrediction(scene, 98), {}};
  std::vector<TrueView> views;
  for (const ViewPrediction& view : truth.prediction.views) views.emplace_back(view);
  for (size_t i = 0; i < views.size(); ++i) {
    for (size_t j = i + 1; j < views.size(); ++j) {
      truth.shares[{i, j}] =
          std::min(views[i].ShareSeenBy(views[j]), views[j].ShareSeenBy(views[i]));
    }
  }
  return truth;
}

const TrueScene& TrueSceneOf(CameraPath path) {
  static const std::map<CameraPath, TrueScene> kScenes = [] {
    std::map<CameraPath, TrueScene> scenes;
    for (const CameraPath p : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
      scenes.emplace(p, MakeTrueScene(p));
    }
    return scenes;
  }();
  return kScenes.at(path);
}

struct Quality {
  double recall = 0.0;     // of pairs that share more than 0.3
  double precision = 0.0;  // of chosen pairs, those that share more than 0.05
};

Quality Judge(const TrueScene& truth, const std::vector<ViewPair>& pairs) {
  const std::set<IndexPair> chosen = IndicesOf(pairs);
  size_t num_shared = 0;
  size_t num_found = 0;
  size_t num_right = 0;
  for (const auto& [indices, share] : truth.shares) {
    if (share > 0.3) {
      ++num_shared;
      num_found += chosen.count(indices);
    }
    if (share > 0.05) num_right += chosen.count(indices);
  }
  return {static_cast<double>(num_found) / static_cast<double>(num_shared),
          static_cast<double>(num_right) / static_cast<double>(chosen.size())};
}

TEST(SelectPairs, FewerThanTwoViewsHaveNone) {
  EXPECT_TRUE(SelectPairs({}, {}).empty());
  EXPECT_TRUE(SelectPairs(SketchWallFrom({{0.0, 0.0}}), {}).empty());
}

TEST(SelectPairs, TakesTheGoodOnesWithWhatWasMeasured) {
  const std::vector<ViewSketch> sketches =
      SketchWallFrom({{0.0, 0.0}, {0.5, 0.0}, {1.0, 0.0}, {30.0, 0.0}});
  const std::vector<ViewPair> pairs = SelectPairs(sketches, {});
  ASSERT_EQ(IndicesOf(pairs), (std::set<IndexPair>{{0, 1}, {0, 2}, {1, 2}}));
  const auto measured = Covisibility(sketches, {}).Measure(0, 2);
  EXPECT_EQ(pairs[1].covisibility, measured->covisibility);
  EXPECT_EQ(pairs[1].angle_deg, measured->angle_deg);
}

TEST(SelectPairs, FindsWhatViewsTrulyShare) {
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    const TrueScene& truth = TrueSceneOf(path);
    const Quality quality = Judge(truth, SelectPairs(SketchAll(truth.prediction), TakeAllGood()));
    EXPECT_EQ(quality.recall, 1.0) << static_cast<int>(path);
    EXPECT_GT(quality.precision, 0.98) << static_cast<int>(path);
  }
}

TEST(SelectPairs, DegradesGracefullyWithThePrediction) {
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    const TrueScene& truth = TrueSceneOf(path);
    for (const double noise : {0.25, 0.5, 1.0, 2.0, 5.0}) {
      const Prediction perturbed = Perturb(truth.prediction,
                                           {.rotation_deg = noise,
                                            .centre_percent = 2.0 * noise,
                                            .focal_percent = 4.0 * noise,
                                            .depth_scale_percent = 4.0 * noise,
                                            .depth_noise_percent = 2.0 * noise});
      const std::vector<ViewPair> pairs = SelectPairs(SketchAll(perturbed), TakeAllGood());
      const Quality quality = Judge(truth, pairs);
      // Depths of two views differ by 1.4 * 8 % at 2 deg, well within the tolerance of 40 %; at 5
      // deg by 30 %, so that every sixth pair may fall outside.
      EXPECT_GE(quality.recall, noise < 5.0 ? 0.98 : 0.8) << static_cast<int>(path) << " " << noise;
      EXPECT_GE(quality.precision, 0.95) << static_cast<int>(path) << " " << noise;
      EXPECT_EQ(NumParts(truth.prediction.views.size(), pairs), 1u) << noise;
    }
  }
}

TEST(SelectPairs, WorksFromPosesAlone) {
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    const TrueScene& truth = TrueSceneOf(path);
    Prediction prediction = truth.prediction;
    for (ViewPrediction& view : prediction.views) view.depth = {};
    std::vector<ViewPair> pairs = SelectPairs(SketchAll(prediction), TakeAllGood());
    // Of occlusion nothing is known, and of depth the order of magnitude.
    EXPECT_GE(Judge(truth, pairs).recall, 0.9) << static_cast<int>(path);
    EXPECT_GE(Judge(truth, pairs).precision, 0.9) << static_cast<int>(path);
    EXPECT_EQ(NumParts(prediction.views.size(), pairs), 1u);
    // If every other view has depth, it is known where the others look.
    for (size_t i = 0; i < prediction.views.size(); i += 2) {
      prediction.views[i].depth = truth.prediction.views[i].depth;
    }
    pairs = SelectPairs(SketchAll(prediction), TakeAllGood());
    EXPECT_EQ(Judge(truth, pairs).recall, 1.0) << static_cast<int>(path);
    EXPECT_GE(Judge(truth, pairs).precision, 0.95) << static_cast<int>(path);
  }
}

// `num_views` views at one place, each turned by 5 deg more, all at depth 5.
std::vector<ViewSketch> MakePanorama(int num_views) {
  Prediction prediction;
  for (int i = 0; i < num_views; ++i) {
    ViewPrediction view = MakeWallView("a.png", 0.0);
    view.view.cam_from_world.rotation = RotationAboutAxis(Eigen::Vector3d::UnitY(), 5.0 * i);
    view.depth = DepthMap(32, 24, 5.0f);
    prediction.views.push_back(view);
  }
  return SketchAll(prediction);
}

TEST(SelectPairs, PairsWithoutBaselineOnlyConnect) {
  const std::vector<ViewSketch> panorama = MakePanorama(4);
  const std::vector<ViewPair> pairs = SelectPairs(panorama, {});
  // The spanning tree of the most covisible pairs: neighbours.
  EXPECT_EQ(IndicesOf(pairs), (std::set<IndexPair>{{0, 1}, {1, 2}, {2, 3}}));
  for (const ViewPair& pair : pairs) EXPECT_LT(pair.angle_deg, 1e-3);
  // A view from the side, which all share, makes them needless.
  std::vector<ViewSketch> with_baseline = MakePanorama(4);
  ViewPrediction side = MakeWallView("b.png", 1.0);
  side.depth = DepthMap(32, 24, 5.0f);
  with_baseline.push_back(MakeViewSketch(StaticView(side, 0.5), 0.0));
  EXPECT_EQ(IndicesOf(SelectPairs(with_baseline, {})),
            (std::set<IndexPair>{{0, 4}, {1, 4}, {2, 4}, {3, 4}}));
}

// Views at random places before a long wall, near and far, some far off.
std::vector<ViewSketch> MakeScatter(int num_views, uint64_t seed) {
  RandomStream random(seed);
  std::vector<Eigen::Vector2d> xzs;
  for (int i = 0; i < num_views; ++i) {
    const double x = random.Uniform(0.0, 4.0 * num_views);
    const double z = random.Uniform(-5.0, 4.0);
    xzs.push_back({x, z});
  }
  return SketchWallFrom(xzs);
}

TEST(SelectPairs, ConnectsWhatAllPairsConnect) {
  bool was_apart = false;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const std::vector<ViewSketch> sketches = MakeScatter(40, seed);
    PairSelectionOptions options;
    options.num_best = 0;
    options.num_diverse = 0;
    options.max_candidates = 2;
    const size_t num_parts = NumParts(sketches.size(), SelectPairs(sketches, options));
    EXPECT_EQ(num_parts, NumParts(sketches.size(), MeasureAll(sketches))) << seed;
    was_apart |= num_parts > 1;
  }
  EXPECT_TRUE(was_apart);  // else nothing is tested
}

TEST(SelectPairs, ForestTakesTheMostCovisibleOfEachCycle) {
  const std::vector<ViewSketch> sketches = SketchWallFrom({{0.0, 0.0}, {2.4, 0.0}, {1.0, 0.0}});
  PairSelectionOptions options;
  options.num_best = 0;
  options.num_diverse = 0;
  EXPECT_EQ(IndicesOf(SelectPairs(sketches, options)), (std::set<IndexPair>{{0, 2}, {1, 2}}));
}

TEST(SelectPairs, GoodPairsAreFewHopsApart) {
  const Prediction truth = MakeTruePrediction(
      SyntheticScene({.path = CameraPath::kOrbit, .num_views = 48, .path_extent_deg = 352.5}), 70);
  const std::vector<ViewSketch> sketches = SketchAll(truth);
  PairSelectionOptions options;
  options.num_best = 2;
  options.num_diverse = 0;
  for (const int max_hops : {1, 2, 3, 5}) {
    options.max_hops = max_hops;
    HopGraph graph(sketches.size());
    for (const ViewPair& pair : SelectPairs(sketches, options)) {
      graph.AddEdge(pair.view_idx1, pair.view_idx2);
    }
    size_t num_good = 0;
    for (const ViewPair& pair : MeasureAll(sketches)) {
      if (pair.covisibility < options.min_covisibility) continue;
      if (pair.angle_deg < options.min_angle_deg) continue;
      ++num_good;
      EXPECT_TRUE(graph.IsWithin(pair.view_idx1, pair.view_idx2, max_hops));
    }
    EXPECT_GT(num_good, sketches.size());
  }
}

TEST(SelectPairs, AnOrbitCloses) {
  const Prediction truth = MakeTruePrediction(
      SyntheticScene({.path = CameraPath::kOrbit, .num_views = 36, .path_extent_deg = 350.0}), 70);
  PairSelectionOptions options;
  options.num_best = 4;
  const std::set<IndexPair> pairs = IndicesOf(SelectPairs(SketchAll(truth), options));
  EXPECT_TRUE(pairs.contains({0, 35}));
}

TEST(SelectPairs, NeighboursDoNotCrowdOutWhoPassesAgain) {
  // A dense pass along the wall, and back again 1.5 farther from it. Neighbours in a pass share
  // more than views of both.
  std::vector<Eigen::Vector2d> xzs;
  for (int i = 0; i < 40; ++i) xzs.push_back({0.2 * i, 0.0});
  for (int i = 0; i < 40; ++i) xzs.push_back({8.0 - 0.2 * i, -1.5});
  const std::vector<ViewSketch> sketches = SketchWallFrom(xzs);
  const auto num_across = [&](int num_diverse) {
    PairSelectionOptions options;
    options.num_best = 4;
    options.num_diverse = num_diverse;
    options.max_hops = 100;
    std::set<size_t> views;
    for (const ViewPair& pair : SelectPairs(sketches, options)) {
      if (pair.view_idx1 >= 40 || pair.view_idx2 < 40) continue;
      views.insert({pair.view_idx1, pair.view_idx2});
    }
    return views.size();
  };
  EXPECT_LT(num_across(0), 40u);
  EXPECT_EQ(num_across(2), 80u);
}

TEST(SelectPairs, DoNotDependOnThreads) {
  const std::vector<ViewSketch> sketches = MakeScatter(60, 5);
  PairSelectionOptions options;
  options.max_candidates = 6;
  options.num_threads = 1;
  const std::vector<ViewPair> one = SelectPairs(sketches, options);
  options.num_threads = 4;
  const std::vector<ViewPair> four = SelectPairs(sketches, options);
  ASSERT_EQ(one.size(), four.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].view_idx1, four[i].view_idx1);
    EXPECT_EQ(one[i].view_idx2, four[i].view_idx2);
    EXPECT_EQ(one[i].covisibility, four[i].covisibility);
    EXPECT_EQ(one[i].angle_deg, four[i].angle_deg);
  }
}

TEST(SelectPairs, LeavesFaultyViewsAlone) {
  std::vector<ViewSketch> sketches =
      SketchWallFrom({{0.0, 0.0}, {0.3, 0.0}, {0.6, 0.0}, {0.9, 0.0}});
  sketches[1].view.cam_from_world.translation.y() = std::numeric_limits<double>::quiet_NaN();
  for (ViewSketch& sketch : sketches) {
    sketch.points[0].setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  EXPECT_EQ(IndicesOf(SelectPairs(sketches, {})), (std::set<IndexPair>{{0, 2}, {0, 3}, {2, 3}}));
}

TEST(PairSelectionOptions, ErrorsNameFieldValueAndBounds) {
  EXPECT_NO_THROW(PairSelectionOptions{}.Check());
  const auto is_refused = [](auto change) {
    PairSelectionOptions options;
    change(options);
    EXPECT_THROW(options.Check(), std::invalid_argument);
    EXPECT_THROW(SelectPairs({}, options), std::invalid_argument);
  };
  is_refused([](PairSelectionOptions& o) { o.covisibility.max_size_ratio = 0.0; });
  is_refused([](PairSelectionOptions& o) { o.min_covisibility = 1.1; });
  is_refused([](PairSelectionOptions& o) { o.min_angle_deg = -1.0; });
  is_refused([](PairSelectionOptions& o) { o.num_best = -1; });
  is_refused([](PairSelectionOptions& o) { o.num_diverse = -1; });
  is_refused([](PairSelectionOptions& o) { o.max_candidates = 1; });
  try {
    PairSelectionOptions{.max_hops = 0}.Check();
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(
        std::string(error.what()).find("PairSelectionOptions::max_hops = 0.000000, must be in [1"),
        std::string::npos);
  }
}

}  // namespace
}  // namespace vgtw
