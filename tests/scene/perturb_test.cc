// SPDX-License-Identifier: BSD-3-Clause
#include "scene/perturb.h"

#include "scene/sim3d.h"
#include "scene/synthetic.h"

#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr PerturbOptions kNothing{.rotation_deg = 0.0,
                                  .centre_percent = 0.0,
                                  .focal_percent = 0.0,
                                  .depth_scale_percent = 0.0,
                                  .depth_noise_percent = 0.0,
                                  .random_world = false};

// `num_views` cameras on a line of length 10 with small maps, to measure errors over many views.
Prediction MakeManyViews(int num_views, int map_size) {
  Prediction prediction;
  for (int i = 0; i < num_views; ++i) {
    ViewPrediction view;
    view.view.name = "view_" + std::to_string(100000 + i) + ".png";
    view.view.camera = MakePinhole(640, 480, 500.0, 600.0);
    const Eigen::Vector3d centre(10.0 * i / (num_views - 1), 0.0, 0.0);
    view.view.cam_from_world =
        LookAt(centre, centre + Eigen::Vector3d(0.3, 1.0, 0.1), Eigen::Vector3d::UnitZ());
    view.view.network_width = map_size;
    view.view.network_height = map_size;
    view.view.original_from_network << 640.0 / map_size, 0.0, 0.0, 0.0, 480.0 / map_size, 0.0;
    view.depth = DepthMap(map_size, map_size, 2.0f);
    prediction.views.push_back(view);
  }
  return prediction;
}

double Rms(const std::vector<double>& values) {
  return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0) /
                   static_cast<double>(values.size()));
}

constexpr int kNumViews = 2000;
// Five standard errors of an rms of so many normal values, relative.
const double kTolerance = 5.0 / std::sqrt(2.0 * kNumViews);

template <typename Measure>
double RmsOverViews(const PerturbOptions& options, const Measure& measure) {
  const Prediction truth = MakeManyViews(kNumViews, 1);
  const Prediction perturbed = Perturb(truth, options);
  std::vector<double> errors;
  for (size_t i = 0; i < truth.views.size(); ++i) {
    errors.push_back(measure(truth.views[i], perturbed.views[i]));
  }
  return Rms(errors);
}

TEST(Perturb, RotationErrorHasItsSigma) {
  PerturbOptions options = kNothing;
  options.rotation_deg = 0.7;
  const double rms = RmsOverViews(options, [](const auto& a, const auto& b) {
    EXPECT_LT(
        (OriginInSource(a.view.cam_from_world) - OriginInSource(b.view.cam_from_world)).norm(),
        1e-9);
    return AngleBetweenDeg(a.view.cam_from_world.rotation, b.view.cam_from_world.rotation);
  });
  EXPECT_NEAR(rms, 0.7, 0.7 * kTolerance);
}

TEST(Perturb, CentreErrorHasItsRmsLength) {
  PerturbOptions options = kNothing;
  options.centre_percent = 3.0;
  const double rms = RmsOverViews(options, [](const auto& a, const auto& b) {
    EXPECT_LT(AngleBetweenDeg(a.view.cam_from_world.rotation, b.view.cam_from_world.rotation),
              1e-9);
    return (OriginInSource(a.view.cam_from_world) - OriginInSource(b.view.cam_from_world)).norm();
  });
  EXPECT_NEAR(rms, 0.3, 0.3 * kTolerance);  // 3 % of an extent of 10
}

TEST(Perturb, FocalErrorHasItsSigmaAndKeepsTheAspect) {
  PerturbOptions options = kNothing;
  options.focal_percent = 2.0;
  const double rms = RmsOverViews(options, [](const auto& a, const auto& b) {
    EXPECT_NEAR(b.view.camera.FocalLengthY() / b.view.camera.FocalLengthX(), 1.2, 1e-12);
    EXPECT_EQ(b.view.camera.PrincipalPoint(), a.view.camera.PrincipalPoint());
    return std::log(b.view.camera.FocalLengthX() / a.view.camera.FocalLengthX());
  });
  EXPECT_NEAR(rms, 0.02, 0.02 * kTolerance);
}

TEST(Perturb, DepthScaleHasItsSigma) {
  PerturbOptions options = kNothing;
  options.depth_scale_percent = 1.5;
  const double rms = RmsOverViews(options, [](const auto& a, const auto& b) {
    return std::log(b.depth(0, 0) / a.depth(0, 0));
  });
  EXPECT_NEAR(rms, 0.015, 0.015 * kTolerance);
}

TEST(Perturb, DepthNoiseHasItsSigmaAndIsSmooth) {
  PerturbOptions options = kNothing;
  options.depth_noise_percent = 1.5;
  const Prediction perturbed = Perturb(MakeManyViews(500, 16), options);
  std::vector<double> errors;
  std::vector<double> steps;
  for (const ViewPrediction& view : perturbed.views) {
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 16; ++x) {
        errors.push_back(std::log(view.depth(x, y) / 2.0));
        if (x > 0) steps.push_back(std::log(view.depth(x, y) / view.depth(x - 1, y)));
      }
    }
  }
  // At least one independent value per view.
  EXPECT_NEAR(Rms(errors), 0.015, 0.015 * 5.0 / std::sqrt(2.0 * 500));
  EXPECT_LT(Rms(steps), 0.8 * Rms(errors));  // white noise would give 1.41
}

Prediction SmallTruth() {
  SyntheticOptions options;
  options.width = 96;
  options.height = 64;
  options.num_views = 4;
  options.seed = 3;
  Prediction truth = MakeTruePrediction(SyntheticScene(options), 56);
  for (ViewPrediction& view : truth.views) {
    view.points = Grid<Eigen::Vector3f>(view.depth.width(), view.depth.height());
    for (int y = 0; y < view.depth.height(); ++y) {
      for (int x = 0; x < view.depth.width(); ++x) {
        const auto point = UnprojectPixel(view.view, view.depth, x, y);
        view.points(x, y) =
            point ? Eigen::Vector3f(point->cast<float>()) : Eigen::Vector3f::Constant(NAN);
        if (point) {
          const Eigen::Vector2d pixel =
              Apply(view.view.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5));
          view.depth_samples.push_back({pixel.cast<float>(), view.depth(x, y), 1.0f});
        }
      }
    }
  }
  return truth;
}

// With no error but another world, a similarity takes one prediction to the other: its points keep
// their pixels in every view.
TEST(Perturb, AnotherWorldIsAPureSimilarity) {
  const Prediction truth = SmallTruth();
  PerturbOptions options = kNothing;
  options.random_world = true;
  const Prediction moved = Perturb(truth, options);
  std::vector<Eigen::Vector3d> old_points;
  std::vector<Eigen::Vector3d> new_points;
  for (size_t i = 0; i < truth.views.size(); ++i) {
    const ViewPrediction& a = truth.views[i];
    const ViewPrediction& b = moved.views[i];
    EXPECT_EQ(a.view.camera, b.view.camera);
    EXPECT_EQ(a.distractor, b.distractor);
    for (int y = 0; y < a.depth.height(); y += 5) {
      for (int x = 0; x < a.depth.width(); x += 5) {
        const auto old_point = UnprojectPixel(a.view, a.depth, x, y);
        const auto new_point = UnprojectPixel(b.view, b.depth, x, y);
        ASSERT_EQ(old_point.has_value(), new_point.has_value());
        if (!old_point) continue;
        old_points.push_back(*old_point);
        new_points.push_back(*new_point);
      }
    }
  }
  const auto new_from_old = EstimateSim3d(old_points, new_points);
  ASSERT_TRUE(new_from_old.has_value());
  EXPECT_GT(std::abs(std::log(new_from_old->scale)), 0.01);
  for (size_t p = 0; p < old_points.size(); ++p) {
    for (size_t i = 0; i < truth.views.size(); ++i) {
      const auto& a = truth.views[i].view;
      const auto& b = moved.views[i].view;
      const auto old_pixel = Project(a.camera, a.cam_from_world * old_points[p]);
      const auto new_pixel = Project(b.camera, b.cam_from_world * new_points[p]);
      ASSERT_EQ(old_pixel.has_value(), new_pixel.has_value());
      // float depth is rounded by 6e-8 of about 10 units, seen from 1 unit at least.
      if (old_pixel && (a.cam_from_world * old_points[p]).z() > 1.0) {
        EXPECT_LT((*old_pixel - *new_pixel).norm(), 1e-3);
      }
    }
  }
}

TEST(Perturb, NothingChangesNothing) {
  const Prediction truth = SmallTruth();
  const Prediction same = Perturb(truth, kNothing);
  for (size_t i = 0; i < truth.views.size(); ++i) {
    EXPECT_EQ(same.views[i].view.camera, truth.views[i].view.camera);
    EXPECT_EQ(same.views[i].distractor, truth.views[i].distractor);
    for (size_t p = 0; p < truth.views[i].depth.size(); ++p) {
      const float a = truth.views[i].depth.data()[p];
      const float b = same.views[i].depth.data()[p];
      EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b)));
    }
  }
}

TEST(Perturb, PointsAndSamplesFollowTheDepth) {
  const Prediction perturbed = Perturb(SmallTruth(), {.rotation_deg = 3.0, .focal_percent = 10.0});
  for (const ViewPrediction& view : perturbed.views) {
    EXPECT_EQ(FindFault(view), "");
    size_t sample_idx = 0;
    for (int y = 0; y < view.depth.height(); ++y) {
      for (int x = 0; x < view.depth.width(); ++x) {
        const auto point = UnprojectPixel(view.view, view.depth, x, y);
        ASSERT_EQ(point.has_value(), view.points(x, y).allFinite());
        if (!point) continue;
        // float coordinates in a world that may lie 50 units away.
        EXPECT_LT((view.points(x, y).cast<double>() - *point).norm(), 1e-4 * (1.0 + point->norm()));
        EXPECT_NEAR(
            view.depth_samples[sample_idx++].depth, view.depth(x, y), 1e-5 * view.depth(x, y));
      }
    }
  }
}

TEST(Perturb, IsAFunctionOfTheSeed) {
  const Prediction truth = MakeManyViews(3, 2);
  const Prediction first = Perturb(truth, {.seed = 5});
  const Prediction again = Perturb(truth, {.seed = 5});
  const Prediction other = Perturb(truth, {.seed = 6});
  EXPECT_EQ(first.views[1].view.camera, again.views[1].view.camera);
  EXPECT_EQ(first.views[1].view.cam_from_world.ToMatrix(),
            again.views[1].view.cam_from_world.ToMatrix());
  EXPECT_EQ(first.views[2].depth, again.views[2].depth);
  EXPECT_NE(first.views[2].depth, other.views[2].depth);
}

// Nine blobs of 4 x 4 per view in the left half of 80 x 40 pixels.
DistractorMask NineBlobs() {
  DistractorMask distractor(80, 40, 0.0f);
  for (int blob = 0; blob < 9; ++blob) {
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 4; ++x)
        distractor(3 + 12 * (blob % 3) + x, 3 + 12 * (blob / 3) + y) = 1.0f;
    }
  }
  return distractor;
}

TEST(Perturb, FlipsTheShareOfBlobs) {
  constexpr int kNumMasks = 400;
  Prediction truth = MakeManyViews(kNumMasks, 1);
  for (ViewPrediction& view : truth.views) {
    view.depth = {};
    view.view.network_width = 80;
    view.view.network_height = 40;
    view.distractor = NineBlobs();
  }
  PerturbOptions options = kNothing;
  options.mask_flip_percent = 20.0;
  const Prediction perturbed = Perturb(truth, options);
  double num_missed = 0.0;
  double false_area_right = 0.0;
  for (const ViewPrediction& view : perturbed.views) {
    for (int blob = 0; blob < 9; ++blob) {
      int area = 0;
      for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < 4; ++x) {
          area += view.distractor(3 + 12 * (blob % 3) + x, 3 + 12 * (blob / 3) + y) == 1.0f;
        }
      }
      num_missed += area < 16;  // a stamp may cover a part of a missed one again
    }
    for (int y = 0; y < 40; ++y) {
      for (int x = 40; x < 80; ++x) false_area_right += view.distractor(x, y);
    }
  }
  constexpr double kNumBlobs = 9.0 * kNumMasks;
  EXPECT_NEAR(num_missed / kNumBlobs, 0.20, 5.0 * std::sqrt(0.2 * 0.8 / kNumBlobs));
  // Stamps are uniform over 77 x 37 places; the expected column of a stamp's pixel is in the right
  // half with probability 38.5 / 77. Stamps overlap seldom (1.8 per view, 16 of 3200 pixels).
  const double expected_stamps = 0.20 * 0.5 * kNumBlobs;
  EXPECT_NEAR(false_area_right / 16.0, expected_stamps, 5.0 * std::sqrt(expected_stamps));
}

// The edge of a half plane moves along its rows with the given sigma.
TEST(Perturb, EdgesMoveByTheirSigma) {
  constexpr int kNumMasks = 600;
  constexpr int kSize = 60;
  Prediction truth = MakeManyViews(kNumMasks, 1);
  for (ViewPrediction& view : truth.views) {
    view.depth = {};
    view.view.network_width = kSize;
    view.view.network_height = kSize;
    view.distractor = DistractorMask(kSize, kSize, 0.0f);
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize / 2; ++x) view.distractor(x, y) = 1.0f;
    }
  }
  PerturbOptions options = kNothing;
  options.mask_edge_px = 2.0;
  const Prediction perturbed = Perturb(truth, options);
  std::vector<double> shifts;
  for (const ViewPrediction& view : perturbed.views) {
    for (int y = 0; y < kSize; ++y) {
      double width = 0.0;
      for (int x = 0; x < kSize; ++x) width += view.distractor(x, y);
      shifts.push_back(width - kSize / 2);
    }
  }
  // Rounding to pixels adds a variance of 1/12. At least one independent value per view.
  EXPECT_NEAR(Rms(shifts), std::sqrt(4.0 + 1.0 / 12.0), 2.0 * 5.0 / std::sqrt(2.0 * kNumMasks));
}

TEST(Perturb, RefusesNegativeSigmas) {
  EXPECT_THROW(Perturb({}, {.rotation_deg = -1.0}), std::invalid_argument);
  EXPECT_THROW(Perturb({}, {.mask_flip_percent = 101.0}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
