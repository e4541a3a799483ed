// SPDX-License-Identifier: BSD-3-Clause
// repetitive_matching_benchmark [NUM_SEEDS]
// False matches where texture repeats and masks are wrong, guided against exhaustive matching with
// the ratio test. A facade of equal windows, each a little different in brightness, behind panels
// that hang elsewhere in every photo; masks miss 30 % of the panels. Exhaustive matching is shown
// for several ratios, before verification as guided matching is: recall is the share of all
// features of the facade in both photos that are matched rightly (to 3 px). The last line compares
// at equal recall, between the ratios by linear interpolation.
#include "matching/match_pair.h"
#include "matching/sift.h"
#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

namespace vgtw {
namespace {

constexpr int kWidth = 960;
constexpr int kHeight = 720;
constexpr int kNumViews = 5;
constexpr double kCell = 0.5;         // edge length of a repeated cell of the facade; it is 12 x 9
constexpr int kTexels = 96;           // per cell
constexpr int kNumPanels = 6;         // per photo
constexpr double kMissedShare = 0.3;  // of the panels, by the masks
constexpr double kMaxErrorPx = 3.0;

// Smooth random blobs on a torus, so that cells fit beside each other.
std::vector<float> MakeTile(uint64_t seed) {
  RandomStream random(HashKey({seed, 1}));
  std::vector<float> tile(kTexels * kTexels, 128.0f);
  for (int blob = 0; blob < 120; ++blob) {
    const double cx = random.Uniform(0, kTexels);
    const double cy = random.Uniform(0, kTexels);
    const double sigma = random.Uniform(1.5, 5.0);
    const double height = random.Uniform(-90, 90);
    for (int y = 0; y < kTexels; ++y) {
      for (int x = 0; x < kTexels; ++x) {
        const double dx = std::remainder(x - cx, kTexels);
        const double dy = std::remainder(y - cy, kTexels);
        tile[static_cast<size_t>(y * kTexels + x)] +=
            static_cast<float>(height * std::exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma)));
      }
    }
  }
  return tile;
}

float Sample(const std::vector<float>& tile, double u, double v) {
  const auto at = [&](int x, int y) {
    return tile[static_cast<size_t>(((y % kTexels) + kTexels) % kTexels * kTexels +
                                    ((x % kTexels) + kTexels) % kTexels)];
  };
  const double x = u * kTexels - 0.5;
  const double y = v * kTexels - 0.5;
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const auto fx = static_cast<float>(x - x0);
  const auto fy = static_cast<float>(y - y0);
  return (1 - fy) * ((1 - fx) * at(x0, y0) + fx * at(x0 + 1, y0)) +
         fy * ((1 - fx) * at(x0, y0 + 1) + fx * at(x0 + 1, y0 + 1));
}

struct Photo {
  View view;
  GrayImage image;
  StaticMask mask;       // what the features were made with
  StaticMask true_mask;  // all panels
  Features features;
};

// Where the ray of a pixel meets the facade, z = 0.
Eigen::Vector3d OnFacade(const View& view, const Eigen::Vector2d& pixel) {
  const Rigid3d world_from_cam = Inverse(view.cam_from_world);
  const Eigen::Vector3d ray =
      world_from_cam.rotation * Unproject(view.camera, pixel)->homogeneous();
  const Eigen::Vector3d& centre = world_from_cam.translation;
  return centre - centre.z() / ray.z() * ray;
}

Photo MakePhoto(uint64_t seed, int idx, const std::vector<float>& tile) {
  RandomStream random(HashKey({seed, 2, static_cast<uint64_t>(idx)}));
  Photo photo;
  photo.view.name = std::to_string(idx);
  photo.view.camera = MakePinhole(kWidth, kHeight, 900.0, 900.0);
  const double x = -1.2 + 0.6 * idx;
  photo.view.cam_from_world = LookAt({x, 0.2 * random.Normal(), -5.0}, {0.3 * x, 0, 0}, {0, -1, 0});
  photo.image = GrayImage(kWidth, kHeight);
  photo.mask = photo.true_mask = StaticMask(kWidth, kHeight, 255);
  for (int y = 0; y < kHeight; ++y) {
    for (int column = 0; column < kWidth; ++column) {
      const Eigen::Vector3d point = OnFacade(photo.view, {column + 0.5, y + 0.5});
      const double u = point.x() / kCell;
      const double v = point.y() / kCell;
      const uint64_t cell = HashKey({seed,
                                     static_cast<uint64_t>(static_cast<int64_t>(std::floor(u))),
                                     static_cast<uint64_t>(static_cast<int64_t>(std::floor(v)))});
      const double gain = 0.8 + 0.4 * static_cast<double>(cell % 1000) / 1000.0;
      const double value = gain * Sample(tile, u, v) + 2.0 * random.Normal();
      photo.image(column, y) = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
    }
  }
  for (int panel = 0; panel < kNumPanels; ++panel) {
    const int left = static_cast<int>(random.Uniform(0, kWidth - 150));
    const int top = static_cast<int>(random.Uniform(0, kHeight - 120));
    const bool is_missed = random.Uniform() < kMissedShare;
    const std::vector<float> texture = MakeTile(HashKey({seed, 3, static_cast<uint64_t>(panel)}));
    for (int y = top; y < top + 120; ++y) {
      for (int column = left; column < left + 150; ++column) {
        photo.image(column, y) = static_cast<uint8_t>(
            std::clamp(Sample(texture, (column - left) / 150.0, (y - top) / 120.0), 0.0f, 255.0f));
        photo.true_mask(column, y) = 0;
        if (!is_missed) photo.mask(column, y) = 0;
      }
    }
  }
  photo.features = ExtractSift(photo.image, photo.mask, {});
  return photo;
}

struct Tally {
  double num_right = 0;
  double num_false = 0;
  double num_possible = 0;

  double Recall() const { return num_right / std::max(1.0, num_possible); }
};

std::optional<Eigen::Vector2d> TrueCounterpart(const Photo& photo1,
                                               const Photo& photo2,
                                               size_t row) {
  const Keypoints& keypoints = photo1.features.keypoints;
  if (IsExcluded(photo1.true_mask, keypoints.x(row), keypoints.y(row))) return std::nullopt;
  const Eigen::Vector3d point = OnFacade(photo1.view, {keypoints.x(row), keypoints.y(row)});
  const auto pixel = Project(photo2.view.camera, photo2.view.cam_from_world * point);
  if (!pixel || IsExcluded(photo2.true_mask, pixel->x(), pixel->y())) return std::nullopt;
  return pixel;
}

// Features of photo 1 that have a counterpart among those of photo 2.
size_t NumPossible(const Photo& photo1, const Photo& photo2) {
  size_t count = 0;
  for (size_t i = 0; i < photo1.features.keypoints.rows; ++i) {
    const auto pixel = TrueCounterpart(photo1, photo2, i);
    if (!pixel) continue;
    const Keypoints& keypoints = photo2.features.keypoints;
    for (size_t j = 0; j < keypoints.rows; ++j) {
      if ((*pixel - Eigen::Vector2d(keypoints.x(j), keypoints.y(j))).norm() > kMaxErrorPx) continue;
      ++count;
      break;
    }
  }
  return count;
}

void Count(const Photo& photo1, const Photo& photo2, const FeatureMatches& matches, Tally& tally) {
  for (const auto& [row1, row2] : matches) {
    const auto pixel = TrueCounterpart(photo1, photo2, row1);
    const Keypoints& keypoints = photo2.features.keypoints;
    const Eigen::Vector2d matched(keypoints.x(row2), keypoints.y(row2));
    if (pixel && (*pixel - matched).norm() <= kMaxErrorPx) {
      ++tally.num_right;
    } else {
      ++tally.num_false;
    }
  }
}

// The view as a network errs: turned, moved, with noisy depth.
std::unique_ptr<MatchingView> Predict(const Photo& photo, uint64_t seed) {
  RandomStream random(HashKey({seed, 4}));
  View view = photo.view;
  const Eigen::Vector3d axis = random.NormalVector().normalized();
  const Rigid3d turn = {RotationAboutAxis(axis, random.Normal()), 0.05 * random.NormalVector()};
  view.cam_from_world = turn * view.cam_from_world;
  ViewFeatures features = MakeViewFeatures(view, photo.features, nullptr);
  for (size_t i = 0; i < features.size(); ++i) {
    const Eigen::Vector3d point = OnFacade(photo.view, features.pixels[i].cast<double>());
    const double depth = (photo.view.cam_from_world * point).z();
    features.depths[i] = static_cast<float>(depth * (1.0 + 0.03 * random.Normal()));
    features.depth_confs[i] = 1.0f;
  }
  return std::make_unique<MatchingView>(std::move(features));
}

constexpr double kRatios[] = {0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0};

void Print(const char* name, double ratio, const Tally& tally) {
  std::printf("%-11s %5.2f %8.0f %8.0f %8.4f\n",
              name,
              ratio,
              tally.num_right,
              tally.num_false,
              tally.Recall());
}

void Run(uint64_t num_seeds) {
  Tally guided, verified;
  std::vector<Tally> plain(std::size(kRatios));
  for (uint64_t seed = 0; seed < num_seeds; ++seed) {
    const std::vector<float> tile = MakeTile(seed);
    std::vector<Photo> photos;
    std::vector<std::unique_ptr<MatchingView>> views;
    for (int i = 0; i < kNumViews; ++i) {
      photos.push_back(MakePhoto(seed, i, tile));
      views.push_back(Predict(photos.back(), HashKey({seed, static_cast<uint64_t>(i)})));
    }
    for (size_t i = 0; i < photos.size(); ++i) {
      for (size_t j = i + 1; j < photos.size(); ++j) {
        MatchPairOptions options;
        options.uncertainty.centre = 0.05;
        const MatchedPair pair = MatchPair(*views[i], *views[j], options);
        Count(photos[i], photos[j], pair.matches, guided);
        Count(photos[i], photos[j], pair.geometry.inlier_matches, verified);
        const auto num_possible = static_cast<double>(NumPossible(photos[i], photos[j]));
        guided.num_possible += num_possible;
        verified.num_possible += num_possible;
        for (size_t k = 0; k < plain.size(); ++k) {
          options.search.max_ratio = kRatios[k];
          options.search.max_background_ratio = 1.0;
          const FeatureMatches matches = SearchAll(*views[i],
                                                   *views[j],
                                                   views[i]->idxs_by_scale(),
                                                   views[j]->idxs_by_scale(),
                                                   options.search);
          Count(photos[i], photos[j], matches, plain[k]);
          plain[k].num_possible += num_possible;
        }
      }
    }
  }
  std::printf("            ratio    right    false   recall\n");
  for (size_t k = 0; k < plain.size(); ++k) Print("exhaustive", kRatios[k], plain[k]);
  Print("guided", WindowSearchOptions().max_ratio, guided);
  Print("verified", WindowSearchOptions().max_ratio, verified);
  for (size_t k = 1; k < plain.size(); ++k) {
    if (plain[k].Recall() < guided.Recall()) continue;
    const double share = (guided.Recall() - plain[k - 1].Recall()) /
                         std::max(1e-9, plain[k].Recall() - plain[k - 1].Recall());
    const double num_false = plain[k - 1].num_false +
                             std::max(0.0, share) * (plain[k].num_false - plain[k - 1].num_false);
    std::printf("false matches at equal recall: exhaustive %.0f, guided %.0f: %.1fx\n",
                num_false,
                guided.num_false,
                num_false / std::max(1.0, guided.num_false));
    return;
  }
  std::printf(
      "exhaustive matching reaches no such recall: at most %.4f, with %.1fx the false ones\n",
      plain.back().Recall(),
      plain.back().num_false / std::max(1.0, guided.num_false));
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  vgtw::Run(argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 2);
  return 0;
}
