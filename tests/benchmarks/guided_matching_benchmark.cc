// SPDX-License-Identifier: BSD-3-Clause
// guided_matching_benchmark [NUM_SEEDS]
// What guided matching finds as predictions get worse, beside plain matching of the same features,
// on the synthetic scene without its movers: verified matches, the share of them that is right (the
// true counterpart lies within 3 px), pairs with a geometry, and time.
#include "matching/match_pair.h"
#include "matching/sift.h"
#include "scene/perturb.h"
#include "scene/statistics.h"
#include "scene/synthetic.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

namespace vgtw {
namespace {

constexpr double kMaxErrorPx = 3.0;

struct Noise {
  double rotation_deg, centre_percent, focal_percent, depth_percent;
};
constexpr Noise kNoises[] = {{0.0, 0.0, 0.0, 0.0},
                             {0.25, 0.5, 1.0, 1.0},
                             {0.5, 1.0, 2.0, 2.0},
                             {1.0, 2.0, 4.0, 5.0},
                             {2.0, 5.0, 10.0, 10.0},
                             {5.0, 10.0, 20.0, 20.0}};

struct Tally {
  size_t num_inliers = 0;
  size_t num_right = 0;
  size_t num_pairs = 0;  // with a geometry
  double seconds = 0.0;
  size_t num_by_method[4] = {};
};

StaticMask MaskOf(const SyntheticView& rendered) {
  const DistractorMask& distractor = rendered.distractor;
  StaticMask mask(distractor.width(), distractor.height(), 255);
  for (size_t i = 0; i < mask.size(); ++i) {
    if (distractor.data()[i] > 0.5f) mask.data()[i] = 0;
  }
  return mask;
}

GrayImage Gray(const RgbImage& image) {
  GrayImage gray(image.width(), image.height());
  for (size_t i = 0; i < gray.size(); ++i) {
    const Rgb& rgb = image.data()[i];
    gray.data()[i] = static_cast<uint8_t>((54 * rgb[0] + 183 * rgb[1] + 19 * rgb[2]) / 256);
  }
  return gray;
}

// One scene: its features, and which matches of two views are right.
class Scene {
 public:
  explicit Scene(uint64_t seed)
      : scene_(
            {.num_views = 12, .width = 960, .height = 720, .path_extent_deg = 70.0, .seed = seed}),
        truth_(MakeTruePrediction(scene_)) {
    for (size_t i = 0; i < scene_.views().size(); ++i) {
      const SyntheticView rendered = scene_.Render(i);
      features_.push_back(ExtractSift(Gray(rendered.image), MaskOf(rendered), {}));
    }
  }

  const Prediction& truth() const { return truth_; }
  const std::vector<Features>& features() const { return features_; }

  void Count(size_t idx1, size_t idx2, const MatchedPair& pair, Tally& tally) const {
    const View& view2 = scene_.views()[idx2];
    if (!pair.geometry.inlier_matches.empty()) ++tally.num_pairs;
    tally.num_inliers += pair.geometry.inlier_matches.size();
    ++tally.num_by_method[static_cast<int>(pair.method)];
    for (const auto& match : pair.geometry.inlier_matches) {
      const Keypoints& keypoints1 = features_[idx1].keypoints;
      const Keypoints& keypoints2 = features_[idx2].keypoints;
      const auto point = scene_.StaticPoint(idx1, {keypoints1.x(match[0]), keypoints1.y(match[0])});
      if (!point) continue;
      const auto pixel = Project(view2.camera, view2.cam_from_world * *point);
      const Eigen::Vector2d matched(keypoints2.x(match[1]), keypoints2.y(match[1]));
      if (pixel && (*pixel - matched).norm() <= kMaxErrorPx) ++tally.num_right;
    }
  }

 private:
  SyntheticScene scene_;
  Prediction truth_;
  std::vector<Features> features_;
};

double Seconds(const auto& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<std::unique_ptr<MatchingView>> MakeViews(const Scene& scene,
                                                     const Prediction& prediction) {
  std::vector<std::unique_ptr<MatchingView>> views;
  for (size_t i = 0; i < prediction.views.size(); ++i) {
    const StaticView static_view(prediction.views[i], 0.5);
    views.push_back(std::make_unique<MatchingView>(
        MakeViewFeatures(prediction.views[i].view, scene.features()[i], &static_view)));
  }
  return views;
}

MatchPairOptions OptionsFor(const Prediction& prediction) {
  std::vector<Eigen::Vector3d> centres;
  for (const ViewPrediction& view : prediction.views) {
    centres.push_back(OriginInSource(view.view.cam_from_world));
  }
  MatchPairOptions options;
  options.uncertainty.centre = 0.02 * Diameter(centres);
  return options;
}

template <typename Match>
void CountPairs(const Scene& scene,
                const Prediction& prediction,
                const Match& match,
                Tally& tally) {
  const auto views = MakeViews(scene, prediction);
  const MatchPairOptions options = OptionsFor(prediction);
  for (size_t i = 0; i < views.size(); ++i) {
    for (size_t j = i + 1; j < views.size() && j <= i + 4; ++j) {
      MatchedPair pair;
      tally.seconds += Seconds([&] { pair = match(*views[i], *views[j], options); });
      scene.Count(i, j, pair, tally);
    }
  }
}

void Print(const char* name, const Noise& noise, const Tally& tally) {
  const auto num_pairs = static_cast<double>(tally.num_by_method[0] + tally.num_by_method[1] +
                                             tally.num_by_method[2] + tally.num_by_method[3]);
  std::printf("%-9s %5.2f %5.1f %5.1f %5.1f %9.1f %8.2f %5zu/%-4.0f %8.1f   %zu/%zu/%zu\n",
              name,
              noise.rotation_deg,
              noise.centre_percent,
              noise.focal_percent,
              noise.depth_percent,
              static_cast<double>(tally.num_inliers) / num_pairs,
              100.0 * static_cast<double>(tally.num_right) /
                  std::max(1.0, static_cast<double>(tally.num_inliers)),
              tally.num_pairs,
              num_pairs,
              1e3 * tally.seconds / num_pairs,
              tally.num_by_method[1],
              tally.num_by_method[2],
              tally.num_by_method[3]);
}

void Sweep(uint64_t num_seeds) {
  std::printf(
      "          rot.  centre focal depth  matches    right    pairs      ms     guided/widened/\n"
      "           deg     %%     %%     %%   a pair        %%               a pair   unguided\n");
  std::vector<Scene> scenes;
  for (uint64_t seed = 0; seed < num_seeds; ++seed) scenes.emplace_back(seed);
  Tally plain;
  for (const Scene& scene : scenes) {
    CountPairs(scene, scene.truth(), MatchPairUnguided, plain);
  }
  Print("plain", {}, plain);
  for (const Noise& noise : kNoises) {
    Tally guided;
    for (size_t seed = 0; seed < scenes.size(); ++seed) {
      const Prediction prediction = Perturb(scenes[seed].truth(),
                                            {.rotation_deg = noise.rotation_deg,
                                             .centre_percent = noise.centre_percent,
                                             .focal_percent = noise.focal_percent,
                                             .depth_scale_percent = noise.depth_percent,
                                             .depth_noise_percent = noise.depth_percent,
                                             .seed = seed});
      CountPairs(scenes[seed], prediction, MatchPair, guided);
    }
    Print("guided", noise, guided);
  }
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  vgtw::Sweep(argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 2);
  return 0;
}
