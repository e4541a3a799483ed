// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/refine_priors.h"

#include "bridge/seed.h"
#include "scene/geodetic.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

PriorOptions AllOfPredictions() {
  PriorOptions options;
  options.poses = options.focal_lengths = options.depths = true;
  options.keep_percent = 100.0;
  options.num_threads = 1;
  return options;
}

// The wall's views with keypoints at (10.5, 10.5), (30.5, 10.5), (50.5, 10.5) and (10.5, 40.5), the
// first three of them in tracks.
class PredictionPriorsTest : public testing::Test {
 protected:
  BundlePriors Make(const Prediction& prediction, const PriorOptions& options) {
    WritePrediction(prediction, folder_ / "predictions", true);
    const PredictionReader reader(folder_ / "predictions");
    SeedOptions seed_options;
    seed_options.with_points = false;
    seed_options.shared_camera = shared_camera_;
    seed_ = MakeSeed(reader, seed_options).reconstruction;
    std::vector<Track> tracks(3);
    for (auto& [id, image] : seed_.images) {
      for (const auto& [x, y] : {std::pair(10.5, 10.5), {30.5, 10.5}, {50.5, 10.5}, {10.5, 40.5}}) {
        image.points2D.push_back({{x, y}, kInvalidPoint3DId});
      }
      for (uint32_t i = 0; i < 3; ++i) tracks[i].push_back({id, i});
    }
    if (!renamed_.empty()) seed_.images.at(1).name = renamed_;
    return PredictionPriors(options, reader, seed_, tracks);
  }

  const TemporaryFolder folder_;
  Reconstruction seed_;
  bool shared_camera_ = false;
  std::string renamed_;
};

// Pixels of the network: half the photo's.
constexpr int kColumns[] = {5, 15, 25};
constexpr int kRow = 5;

TEST_F(PredictionPriorsTest, PosesAndTheirSigmasAreThePredictions) {
  const PosePriors poses = Make(MakeWallPrediction(), AllOfPredictions()).poses;
  EXPECT_EQ(poses.world, PriorWorld::kFree);
  ASSERT_THAT(poses.by_image, SizeIs(3));
  EXPECT_EQ(poses.by_image.at(3).cam_from_reference.translation, Eigen::Vector3d(-0.5, 0.0, 0.0));
  // The difference of two views has errors of 1 degree and 2 % of the extent 1, which is less than
  // the depth 5.1.
  EXPECT_NEAR(poses.by_image.at(3).rotation_sigma_deg, 1.0 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(poses.by_image.at(3).centre_sigma, 0.02 / std::sqrt(2.0), 1e-12);
}

TEST_F(PredictionPriorsTest, CentresThatCoincideAreNoPriors) {
  Prediction prediction = MakeWallPrediction();
  for (ViewPrediction& view : prediction.views) view.view.cam_from_world.translation.setZero();
  EXPECT_THAT(Make(prediction, AllOfPredictions()).poses.by_image, IsEmpty());
}

TEST_F(PredictionPriorsTest, ASharedCameraHasTheMedianFocalLength) {
  shared_camera_ = true;
  Prediction prediction = MakeWallPrediction();
  prediction.views[0].view.camera.SetFocalLength(60.0, 70.0);
  prediction.views[2].view.camera.SetFocalLength(62.0, 80.0);
  const auto focal_lengths = Make(prediction, AllOfPredictions()).focal_lengths;
  ASSERT_THAT(focal_lengths, SizeIs(1));
  EXPECT_EQ(focal_lengths.at(1).focal_length_x, 61.2);
  EXPECT_EQ(focal_lengths.at(1).focal_length_y, 70.0);
  EXPECT_NEAR(focal_lengths.at(1).log_sigma, 0.03, 1e-12);
}

TEST_F(PredictionPriorsTest, DepthsAreThoseOfKeypointsInTracks) {
  const auto depths = Make(MakeWallPrediction(), AllOfPredictions()).depths.by_image;
  ASSERT_THAT(depths, SizeIs(3));
  ASSERT_THAT(depths.at(2), SizeIs(3));
  for (uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(depths.at(2)[i].point2D_idx, i);
    EXPECT_NEAR(depths.at(2)[i].depth, kWallDepth, 1e-6);  // maps are of single precision
    EXPECT_NEAR(depths.at(2)[i].log_sigma, 0.06, 1e-12);
  }
}

TEST_F(PredictionPriorsTest, UnknownDepthsAndDistractorsGiveNone) {
  Prediction prediction = MakeWallPrediction();
  ViewPrediction& view = prediction.views[1];
  view.distractor = DistractorMask(32, 24, 0.0f);
  for (int x = 4; x <= 6; ++x) {
    for (int y = 4; y <= 6; ++y) {
      view.depth(x, y) = kNaN;
      view.distractor(x + 10, y) = 0.6f;
    }
  }
  prediction.views[2].depth = DepthMap(32, 24, kNaN);
  const auto depths = Make(prediction, AllOfPredictions()).depths.by_image;
  EXPECT_THAT(depths, SizeIs(2));
  ASSERT_THAT(depths.at(2), SizeIs(1));
  EXPECT_EQ(depths.at(2)[0].point2D_idx, 2u);
}

// Sigmas are inverse to the confidence below its median over the keypoints, 8, up to four times.
TEST_F(PredictionPriorsTest, LowConfidenceWidensTheSigmaOfADepth) {
  Prediction prediction = MakeWallPrediction();
  ViewPrediction& view = prediction.views[0];
  view.depth_conf = ConfidenceMap(32, 24, 1.0f);
  const float confidences[] = {4.0f, 100.0f, 8.0f};
  for (int i = 0; i < 3; ++i) {
    for (int x = -1; x <= 1; ++x) view.depth_conf(kColumns[i] + x, kRow) = confidences[i];
  }
  const auto depths = Make(prediction, AllOfPredictions()).depths.by_image.at(1);
  ASSERT_THAT(depths, SizeIs(3));
  EXPECT_NEAR(depths[0].log_sigma, 2.0 * 0.06, 1e-9);
  EXPECT_NEAR(depths[1].log_sigma, 0.06, 1e-9);
  EXPECT_NEAR(depths[2].log_sigma, 0.06, 1e-9);
  // 3 of the 768 pixels have 100.
  PriorOptions options = AllOfPredictions();
  options.keep_percent = 0.3;
  EXPECT_THAT(Make(prediction, options).depths.by_image.at(1), SizeIs(1));
}

// Two columns: the third keypoint has the right one, of the other two the more confident is taken.
TEST_F(PredictionPriorsTest, ACellHasItsMostConfidentDepth) {
  Prediction prediction = MakeWallPrediction();
  ViewPrediction& view = prediction.views[0];
  view.depth_conf = ConfidenceMap(32, 24, 1.0f);
  for (int x = -1; x <= 1; ++x) view.depth_conf(kColumns[1] + x, kRow) = 2.0f;
  PriorOptions options = AllOfPredictions();
  options.num_depth_cells = 2;
  const auto depths = Make(prediction, options).depths.by_image;
  ASSERT_THAT(depths.at(1), SizeIs(2));
  EXPECT_EQ(depths.at(1)[0].point2D_idx, 1u);
  EXPECT_EQ(depths.at(1)[1].point2D_idx, 2u);
  // Of equal ones the first.
  EXPECT_EQ(depths.at(2)[0].point2D_idx, 0u);
}

TEST_F(PredictionPriorsTest, OnlyWhatIsAskedForIsMade) {
  PriorOptions none;
  none.poses = none.focal_lengths = none.depths = false;
  const BundlePriors priors = Make(MakeWallPrediction(), none);
  EXPECT_THAT(priors.poses.by_image, IsEmpty());
  EXPECT_THAT(priors.focal_lengths, IsEmpty());
  EXPECT_THAT(priors.depths.by_image, IsEmpty());
}

TEST_F(PredictionPriorsTest, ImagesWithoutPredictionHaveNone) {
  renamed_ = "other.png";
  const BundlePriors priors = Make(MakeWallPrediction(), AllOfPredictions());
  EXPECT_FALSE(priors.poses.by_image.contains(1));
  EXPECT_FALSE(priors.depths.by_image.contains(1));
  EXPECT_THAT(priors.poses.by_image, SizeIs(2));
  EXPECT_NO_THROW(priors.Check());
}

TEST_F(PredictionPriorsTest, PredictionsOfOtherPhotosAreRefused) {
  WritePrediction(MakeWallPrediction(), folder_ / "predictions", true);
  EXPECT_THAT(ErrorOf([&] {
                PredictionPriors(
                    AllOfPredictions(), PredictionReader(folder_ / "predictions"), {}, {});
              }),
              HasSubstr("views of the same names"));
}

TEST_F(PredictionPriorsTest, SigmasMustBePositive) {
  PriorOptions options = AllOfPredictions();
  options.errors.depth_percent = 0.0;
  EXPECT_THROW(Make(MakeWallPrediction(), options), std::invalid_argument);
}

class KnownCentresTest : public testing::Test {
 protected:
  KnownCentresTest() : database_(ColmapDatabase::Create(folder_ / "a.db")) {
    ColmapDatabase::Transaction transaction(database_);
    Camera camera = MakePinhole(40, 20, 30.0, 30.0);
    camera.camera_id = 1;
    database_.WriteCamera(camera);
    for (ImageId id = 1; id <= 4; ++id) {
      database_.WriteImage({id, std::to_string(id) + ".png", 1});
      seed_.images[id].image_id = id;
    }
    transaction.Commit();
  }
  void Write(const DatabasePosePrior& prior) {
    ColmapDatabase::Transaction transaction(database_);
    database_.WritePosePrior(prior);
    transaction.Commit();
  }
  std::string ErrorOfReading() const {
    return ErrorOf([&] { KnownCentres(database_, seed_, 5.0); });
  }

  const TemporaryFolder folder_;
  ColmapDatabase database_;
  Reconstruction seed_;
};

TEST_F(KnownCentresTest, CartesianOnesAreTakenAsTheyAre) {
  Write({.image_id = 1, .position = {1.0, 2.0, 3.0}});
  Write({.image_id = 2, .position = {4.0, 5.0, 6.0}});
  DatabasePosePrior measured{.image_id = 3, .position = {7.0, 8.0, 9.0}};
  measured.position_covariance = Eigen::Matrix3d(Eigen::Vector3d(4.0, 0.0, 0.25).asDiagonal());
  Write(measured);
  const CentrePriors priors = KnownCentres(database_, seed_, 5.0);
  ASSERT_THAT(priors.by_image, SizeIs(3));
  EXPECT_EQ(priors.by_image.at(2).centre_in_reference, Eigen::Vector3d(4.0, 5.0, 6.0));
  EXPECT_EQ(priors.by_image.at(2).sigma, Eigen::Vector3d(5.0, 5.0, 5.0));
  EXPECT_EQ(priors.by_image.at(3).sigma, Eigen::Vector3d(2.0, 5.0, 0.5));
}

TEST_F(KnownCentresTest, GpsBecomesMetresFromTheFirst) {
  const GeodeticPosition places[] = {
      {48.2, 16.4, 200.0}, {48.2001, 16.4, 201.0}, {48.2, 16.4002, 199.0}};
  for (ImageId id = 1; id <= 3; ++id) {
    const GeodeticPosition& place = places[id - 1];
    Write({.image_id = id,
           .position = {place.latitude_deg, place.longitude_deg, place.altitude},
           .coordinate_system = 0});
  }
  const CentrePriors priors = KnownCentres(database_, seed_, 5.0);
  for (ImageId id = 1; id <= 3; ++id) {
    EXPECT_EQ(priors.by_image.at(id).centre_in_reference,
              EnuFromGeodetic(places[id - 1], places[0]));
  }
}

TEST_F(KnownCentresTest, OfOtherImagesDoNotCount) {
  for (ImageId id = 1; id <= 3; ++id) Write({.image_id = id, .position = {1.0 * id, 0.0, 0.0}});
  seed_.images.erase(2);
  EXPECT_THAT(ErrorOfReading(), HasSubstr("for 2 images of the model, expected at least 3"));
}

TEST_F(KnownCentresTest, MustBeOfOneKnownSystem) {
  for (ImageId id = 1; id <= 3; ++id) Write({.image_id = id, .position = {1.0 * id, 0.0, 0.0}});
  Write({.image_id = 4, .position = {48.2, 16.4, 200.0}, .coordinate_system = 0});
  EXPECT_THAT(ErrorOfReading(), HasSubstr("image 4 is of another coordinate system"));
  Write({.image_id = 4, .position = {1.0, 0.0, 0.0}, .coordinate_system = -1});
  EXPECT_THAT(ErrorOfReading(), HasSubstr("image 4 has coordinate_system -1"));
}

TEST_F(KnownCentresTest, ALatitudeBeyondThePoleIsRefused) {
  for (ImageId id = 1; id <= 3; ++id) {
    Write({.image_id = id, .position = {91.0, 1.0 * id, 0.0}, .coordinate_system = 0});
  }
  EXPECT_THAT(ErrorOfReading(), HasSubstr("latitude 91"));
}

TEST(MakePriors, CentresNeedADatabase) {
  PriorOptions options;
  options.centres = true;
  EXPECT_THROW(MakePriors(options, nullptr, nullptr, {}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
