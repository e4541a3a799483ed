// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/seed.h"

#include "scene/error.h"
#include "scene/image_io.h"
#include "scene/reprojection.h"
#include "scene/synthetic.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

namespace fs = std::filesystem;

// Every pixel gives its point.
SeedOptions AllPixels() {
  SeedOptions options;
  options.keep_percent = 100.0;
  options.voxel_size = 0.0;
  options.min_track_length = 1;
  options.num_threads = 2;
  return options;
}

class SeedTest : public testing::Test {
 protected:
  PredictionReader Store(const Prediction& prediction) {
    WritePrediction(prediction, folder_ / "predictions", true);
    return PredictionReader(folder_ / "predictions");
  }
  Seed Make(const Prediction& prediction, const SeedOptions& options) {
    return MakeSeed(Store(prediction), options);
  }
  void StorePhotos(const std::vector<std::string>& names, uint64_t width, uint64_t height) {
    for (const std::string& name : names) {
      WriteImage(folder_ / "photos" / name,
                 GrayImage(static_cast<int>(width), static_cast<int>(height), 90));
    }
  }

  TemporaryFolder folder_;
};

std::map<size_t, size_t> CountTrackLengths(const Reconstruction& reconstruction) {
  std::map<size_t, size_t> counts;
  for (const auto& [id, point] : reconstruction.points3D) ++counts[point.track.size()];
  return counts;
}

std::string MessageOf(const std::function<void()>& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST_F(SeedTest, ImagesAndCamerasFollowTheNames) {
  Prediction prediction = MakeWallPrediction();
  prediction.views[1].view.camera.params[0] = 60.0;
  SeedOptions options;
  options.with_points = false;
  const Seed seed = Make(prediction, options);
  EXPECT_EQ(FindFault(seed.reconstruction), "");
  EXPECT_EQ(seed.summary.num_images, 3u);
  ASSERT_EQ(seed.reconstruction.images.size(), 3u);
  ASSERT_EQ(seed.reconstruction.cameras.size(), 3u);
  const Image& image = seed.reconstruction.images.at(2);
  EXPECT_EQ(image.name, "b.png");
  EXPECT_EQ(image.camera_id, 2u);
  EXPECT_EQ(seed.reconstruction.images.at(1).cam_from_world.translation.x(), 0.5);
  EXPECT_EQ(seed.reconstruction.cameras.at(2).params[0], 60.0);
  EXPECT_TRUE(seed.reconstruction.cameras.at(2).has_prior_focal_length);
  EXPECT_TRUE(seed.reconstruction.points3D.empty());
  EXPECT_TRUE(image.points2D.empty());
}

TEST_F(SeedTest, TracksOfAWallHaveTheLengthsOfItsOverlaps) {
  const Seed seed = Make(MakeWallPrediction(), AllPixels());
  EXPECT_EQ(FindFault(seed.reconstruction), "");
  // Columns of network pixels lie at 1, 3, ..., 63 px; the wall shifts by 6 px to the next view (29
  // columns stay inside) and by 12 px to the one after (26). So in views a and c 26 columns are
  // seen by three, 3 by two and 3 by one; in b, 29 to each side, 26 by three and 6 by two. 24 rows
  // each.
  EXPECT_EQ(CountTrackLengths(seed.reconstruction),
            (std::map<size_t, size_t>{{1, 24 * 6}, {2, 24 * 12}, {3, 24 * 78}}));
  EXPECT_EQ(seed.summary.num_points3D, 24u * 96u);
  EXPECT_NEAR(seed.summary.mean_track_length, (6.0 + 2.0 * 12.0 + 3.0 * 78.0) / 96.0, 1e-12);
  for (const auto& [id, point] : seed.reconstruction.points3D) {
    ASSERT_NEAR(point.xyz.z(), kWallDepth, 1e-6);  // floats
  }
  // points2D are stored through floats, too: 64 px to 4e-6.
  EXPECT_LT(ComputeReprojectionStats(seed.reconstruction).mean_px, 1e-5);
  EXPECT_EQ(ComputeReprojectionStats(seed.reconstruction).num_behind_camera, 0u);

  SeedOptions options = AllPixels();
  options.min_track_length = 3;
  EXPECT_EQ(CountTrackLengths(Make(MakeWallPrediction(), options).reconstruction),
            (std::map<size_t, size_t>{{3, 24 * 78}}));
}

TEST_F(SeedTest, ConfidenceIsPooledOverAllViews) {
  Prediction prediction = MakeWallPrediction();
  for (size_t i = 0; i < 3; ++i) {
    prediction.views[i].depth_conf = ConfidenceMap(32, 24, 1.0f + static_cast<float>(i));
  }
  SeedOptions options = AllPixels();
  options.keep_percent = 33.0;  // the third view alone
  const Seed seed = Make(prediction, options);
  EXPECT_EQ(seed.summary.confidence_threshold, 3.0);
  EXPECT_EQ(seed.summary.num_points3D, 32u * 24u);
  options.keep_percent = 34.0;
  EXPECT_EQ(Make(prediction, options).summary.confidence_threshold, 2.0);
  EXPECT_EQ(Make(prediction, options).summary.num_points3D, 2u * 32u * 24u);
}

TEST_F(SeedTest, DistractorsNeitherGiveNorObservePoints) {
  Prediction prediction = MakeWallPrediction();
  ViewPrediction& middle = prediction.views[1];
  middle.distractor = DistractorMask(32, 24, 0.0f);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 16; ++x) {
      middle.distractor(x, y) = 0.9f;
      middle.depth(x, y) = 2.0f;
    }
  }
  const Seed seed = Make(prediction, AllPixels());
  for (const auto& [id, point] : seed.reconstruction.points3D) {
    ASSERT_NEAR(point.xyz.z(), kWallDepth, 1e-6);
  }
  for (const Point2D& point2D : seed.reconstruction.images.at(2).points2D) {
    ASSERT_GE(point2D.xy.x(), 32.0);
  }
  EXPECT_EQ(seed.summary.num_points3D, 24u * (32u + 16u + 32u));
}

TEST_F(SeedTest, VoxelsMergeThePointsOfAllViews) {
  SeedOptions options = AllPixels();
  // Edge 0.25 at a camera extent of 1; the middle of the cameras is the lattice's origin.
  options.voxel_size = 0.25;
  const Seed seed = Make(MakeWallPrediction(), options);
  std::set<std::tuple<double, double>> cubes;
  for (const auto& [id, point] : seed.reconstruction.points3D) {
    EXPECT_NEAR(point.xyz.z(), kWallDepth, 1e-5);
    cubes.insert({std::floor(point.xyz.x() / 0.25), std::floor(point.xyz.y() / 0.25)});
  }
  EXPECT_EQ(cubes.size(), seed.reconstruction.points3D.size());
  // Pixel centres reach from -31/12 - 0.5 to 31/12 + 0.5 and from -23/12 to 23/12, every 1/6: all
  // cubes from -13 to 12 and from -8 to 7.
  EXPECT_EQ(cubes.size(), 26u * 16u);
}

TEST_F(SeedTest, ResultDoesNotDependOnThreads) {
  SeedOptions options;
  options.voxel_size = 0.1;
  options.num_threads = 1;
  const Seed one = Make(MakeWallPrediction(), options);
  options.num_threads = 3;
  const Seed three = Make(MakeWallPrediction(), options);
  ASSERT_EQ(one.summary.num_points3D, three.summary.num_points3D);
  for (const auto& [id, point] : one.reconstruction.points3D) {
    ASSERT_EQ(point.xyz, three.reconstruction.points3D.at(id).xyz);
    ASSERT_EQ(point.track, three.reconstruction.points3D.at(id).track);
  }
}

TEST_F(SeedTest, PointsTakeTheColoursOfThePhotos) {
  RgbImage photo(64, 48, Rgb{200, 10, 10});
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 32; ++x) photo(x, y) = {10, 10, 200};
  }
  WriteImage(folder_ / "photos/a.png", photo);
  Prediction prediction = MakeWallPrediction();
  prediction.views.resize(1);
  SeedOptions options = AllPixels();
  EXPECT_EQ(Make(prediction, options).reconstruction.points3D.begin()->second.rgb,
            (Rgb{128, 128, 128}));
  options.image_folder = folder_ / "photos";
  const Seed seed = Make(prediction, options);
  ASSERT_EQ(seed.summary.num_points3D, 32u * 24u);
  for (const auto& [id, point] : seed.reconstruction.points3D) {
    const bool is_left = point.xyz.x() < -0.5;
    ASSERT_EQ(point.rgb, (is_left ? Rgb{10, 10, 200} : Rgb{200, 10, 10}));
  }
  WriteImage(folder_ / "photos/a.png", RgbImage(48, 64));
  EXPECT_THAT(MessageOf([&] { Make(prediction, options); }),
              HasSubstr("48 x 64 pixels, expected 64 x 48"));
}

TEST_F(SeedTest, SharedCameraIsTheMedian) {
  Prediction prediction = MakeWallPrediction();
  prediction.views.push_back(MakeWallView("d.png", 1.0));
  prediction.views[0].view.camera.params = {50.0, 52.0, 32.0, 24.0};
  prediction.views[1].view.camera.params = {51.0, 51.0, 33.0, 24.0};
  prediction.views[2].view.camera.params = {80.0, 56.0, 31.0, 25.0};
  prediction.views[3].view.camera = MakePinhole(48, 64, 51.0, 51.0);
  SeedOptions options;
  options.shared_camera = true;
  options.with_points = false;
  const Seed seed = Make(prediction, options);
  ASSERT_EQ(seed.reconstruction.cameras.size(), 2u);  // two sizes
  EXPECT_THAT(seed.reconstruction.cameras.at(1).params, ElementsAre(51.0, 52.0, 32.0, 24.0));
  EXPECT_EQ(seed.reconstruction.images.at(3).camera_id, 1u);
  EXPECT_EQ(seed.reconstruction.images.at(4).camera_id, 2u);
  // Mean focal lengths 51, 51 and 68.
  EXPECT_NEAR(seed.summary.focal_spread_percent, 100.0 * 17.0 / 51.0, 1e-12);
}

TEST_F(SeedTest, SamplesBecomePoints) {
  Prediction prediction = MakeWallPrediction();
  for (ViewPrediction& view : prediction.views) {
    view.depth = DepthMap();
    view.view.network_width = view.view.network_height = 0;
  }
  prediction.views[0].depth_samples = {{{40.0f, 20.0f}, 5.1f, 1.0f}, {{2.0f, 2.0f}, 5.1f, 1.0f}};
  prediction.views[1].depth_samples = {{{34.1f, 20.1f}, 5.1f, 1.0f}};  // 6 px: the same place
  const Seed seed = Make(prediction, AllPixels());
  EXPECT_EQ(CountTrackLengths(seed.reconstruction), (std::map<size_t, size_t>{{1, 1}, {2, 2}}));
  EXPECT_EQ(FindFault(seed.reconstruction), "");
}

// --- with a database ---

class SeedWithDatabaseTest : public SeedTest {
 protected:
  // Images c.png, a.png, x.png with ids 3, 7, 9; c and a share camera 5.
  ColmapDatabase MakeDatabase(const Camera& row) {
    ColmapDatabase database = ColmapDatabase::Create(folder_ / "database.db");
    ColmapDatabase::Transaction transaction(database);
    Camera camera = row;
    camera.camera_id = 5;
    database.WriteCamera(camera);
    camera.camera_id = 6;
    database.WriteCamera(camera);
    database.WriteImage({3, "c.png", 5});
    database.WriteImage({7, "a.png", 5});
    database.WriteImage({9, "x.png", 6});
    database.WriteTrivialRigsAndFrames();
    transaction.Commit();
    return database;
  }
};

TEST_F(SeedWithDatabaseTest, TakesItsIdsAndCameras) {
  Prediction prediction = MakeWallPrediction();
  prediction.views[0].view.camera.params = {51.0, 51.0, 32.0, 24.0};
  prediction.views[2].view.camera.params = {53.0, 53.0, 32.0, 24.0};
  const PredictionReader predictions = Store(prediction);
  const Seed seed =
      MakeSeed(predictions, MakeDatabase(MakePinhole(64, 48, 77.0, 77.0)), AllPixels());
  EXPECT_EQ(FindFault(seed.reconstruction), "");
  EXPECT_THAT(seed.missing, ElementsAre("b.png"));
  ASSERT_EQ(seed.reconstruction.images.size(), 2u);
  EXPECT_EQ(seed.reconstruction.images.at(3).name, "c.png");
  EXPECT_EQ(seed.reconstruction.images.at(7).name, "a.png");
  EXPECT_EQ(seed.reconstruction.images.at(3).cam_from_world.translation.x(), -0.5);
  ASSERT_EQ(seed.reconstruction.cameras.size(), 1u);
  EXPECT_THAT(seed.reconstruction.cameras.at(5).params, ElementsAre(52.0, 52.0, 32.0, 24.0));
  EXPECT_NEAR(seed.summary.focal_spread_percent, 100.0 * 2.0 / 52.0, 1e-12);
  EXPECT_GT(seed.summary.num_points3D, 0u);
  ASSERT_EQ(seed.reconstruction.rigs.size(), 1u);
  EXPECT_EQ(seed.reconstruction.rigs.at(5).reference.id, 5u);
  ASSERT_EQ(seed.reconstruction.frames.size(), 2u);
  EXPECT_EQ(seed.reconstruction.frames.at(7).rig_from_world.translation.x(), 0.5);
}

TEST_F(SeedWithDatabaseTest, ACameraKeepsItsModelAndDistortion) {
  Camera row = MakePinhole(64, 48, 77.0, 77.0);
  row.model = CameraModel::kSimpleRadial;
  row.params = {77.0, 30.0, 20.0, 0.07};
  const PredictionReader predictions = Store(MakeWallPrediction());
  SeedOptions options;
  options.with_points = false;
  const Seed seed = MakeSeed(predictions, MakeDatabase(row), options);
  EXPECT_EQ(seed.reconstruction.cameras.at(5).model, CameraModel::kSimpleRadial);
  EXPECT_THAT(seed.reconstruction.cameras.at(5).params, ElementsAre(61.2, 32.0, 24.0, 0.07));
}

TEST_F(SeedWithDatabaseTest, RefusesOtherSizesOtherDistortionsAndOtherNames) {
  SeedOptions options;
  options.with_points = false;
  const ColmapDatabase database = MakeDatabase(MakePinhole(640, 480, 500.0, 500.0));
  Prediction prediction = MakeWallPrediction();
  EXPECT_THAT(
      MessageOf([&] { MakeSeed(Store(prediction), database, options); }),
      HasSubstr("camera 5 of a.png is PINHOLE 640 x 480, expected PINHOLE 64 x 48; predict"));
  for (ViewPrediction& view : prediction.views) {
    view.view.camera = MakePinhole(640, 480, 500.0, 500.0);
    view.view.camera.model = CameraModel::kRadial;
    view.view.camera.params = {500.0, 320.0, 240.0, 0.1, 0.0};
  }
  EXPECT_THAT(MessageOf([&] { MakeSeed(Store(prediction), database, options); }),
              HasSubstr("camera 5 of a.png is PINHOLE 640 x 480, expected RADIAL 640 x 480; make"));
  for (ViewPrediction& view : prediction.views) view.view.name = "photos/" + view.view.name;
  EXPECT_THAT(MessageOf([&] { MakeSeed(Store(prediction), database, options); }),
              HasSubstr("none of the predicted images, expected names such as photos/a.png"));
}

TEST_F(SeedTest, WriteSeedCamerasFillsAnEmptyDatabase) {
  StorePhotos({"c.png", "a.png", "other.png"}, 64, 48);
  Prediction prediction = MakeWallPrediction();
  prediction.views[2].view.camera.params[0] = 60.0;
  const PredictionReader predictions = Store(prediction);
  ColmapDatabase database = ColmapDatabase::Create(folder_ / "database.db");
  SeedOptions options;
  options.with_points = false;
  WriteSeedCameras(predictions, folder_ / "photos", options, database);

  const std::vector<DatabaseImage> images = database.ReadImages();
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(std::tie(images[0].image_id, images[0].name, images[0].camera_id),
            std::make_tuple(1u, "a.png", 1u));
  EXPECT_EQ(std::tie(images[1].image_id, images[1].name, images[1].camera_id),
            std::make_tuple(2u, "c.png", 2u));
  const std::vector<Camera> cameras = database.ReadCameras();
  ASSERT_EQ(cameras.size(), 2u);
  EXPECT_EQ(cameras[1].params[0], 60.0);
  EXPECT_TRUE(cameras[1].has_prior_focal_length);
  EXPECT_EQ(database.ReadFrames().size(), database.schema().has_rigs ? 2u : 0u);

  const Seed seed = MakeSeed(predictions, database, options);
  EXPECT_EQ(seed.reconstruction.images.at(2).name, "c.png");
  EXPECT_EQ(seed.reconstruction.cameras.at(2), cameras[1]);
  EXPECT_THAT(seed.missing, ElementsAre("b.png"));

  EXPECT_THAT(
      MessageOf([&] { WriteSeedCameras(predictions, folder_ / "photos", options, database); }),
      HasSubstr("expected an empty database"));
}

TEST_F(SeedTest, WriteSeedCamerasRefusesPhotosThatWereNotPredicted) {
  const PredictionReader predictions = Store(MakeWallPrediction());
  ColmapDatabase database = ColmapDatabase::Create(folder_ / "database.db");
  StorePhotos({"other.png"}, 64, 48);
  const auto write = [&] { WriteSeedCameras(predictions, folder_ / "photos", {}, database); };
  EXPECT_THAT(MessageOf(write), HasSubstr("no image that was predicted, expected names such as a"));
  StorePhotos({"a.png"}, 48, 64);
  EXPECT_THAT(MessageOf(write), HasSubstr("48 x 64 pixels, expected 64 x 48"));
  EXPECT_TRUE(database.ReadImages().empty());
}

TEST_F(SeedTest, RefusesWrongOptions) {
  const PredictionReader predictions = Store(MakeWallPrediction());
  const auto refuses = [&](auto change) {
    SeedOptions options;
    change(options);
    EXPECT_THROW(MakeSeed(predictions, options), std::invalid_argument);
  };
  refuses([](SeedOptions& options) { options.keep_percent = 0.0; });
  refuses([](SeedOptions& options) { options.keep_percent = 100.1; });
  refuses([](SeedOptions& options) { options.distractor_threshold = 0.0; });
  refuses([](SeedOptions& options) { options.voxel_size = -1.0; });
  refuses([](SeedOptions& options) { options.max_relative_depth_difference = 0.0; });
  refuses([](SeedOptions& options) { options.min_track_length = 0; });
}

// --- on a rendered scene with distractors ---

TEST_F(SeedTest, PointsLieOnTheStaticScene) {
  SyntheticOptions scene_options;
  scene_options.num_views = 6;
  scene_options.width = 256;
  scene_options.height = 192;
  const SyntheticScene scene(scene_options);
  SeedOptions options;
  options.keep_percent = 100.0;
  const Seed seed = Make(MakeTruePrediction(scene, 252), options);
  EXPECT_EQ(FindFault(seed.reconstruction), "");
  ASSERT_GT(seed.summary.num_points3D, 1000u);
  EXPECT_GT(seed.summary.mean_track_length, 2.5);

  // The nearest static surface along the rays of a point's own observations. Merging moves a point
  // off a curved or folded surface by less than a voxel.
  const double voxel = options.voxel_size * scene.CameraExtent();
  size_t num_off = 0;
  for (const auto& [id, point] : seed.reconstruction.points3D) {
    double distance = std::numeric_limits<double>::infinity();
    for (const TrackElement& element : point.track) {
      const auto surface = scene.StaticPoint(
          element.image_id - 1,
          seed.reconstruction.images.at(element.image_id).points2D[element.point2D_idx].xy);
      if (surface) distance = std::min(distance, (*surface - point.xyz).norm());
    }
    num_off += distance > 2.0 * voxel;
  }
  // Rays of a merged point at a silhouette may all miss its surface: one in a thousand.
  EXPECT_LE(num_off, seed.summary.num_points3D / 1000);
  // No observation on a distractor.
  for (const auto& [image_id, image] : seed.reconstruction.images) {
    const SyntheticView view = scene.Render(image_id - 1);
    size_t num_on_distractor = 0;
    for (const Point2D& point2D : image.points2D) {
      num_on_distractor += view.distractor(static_cast<int>(point2D.xy.x()),
                                           static_cast<int>(point2D.xy.y())) > 0.5f;
    }
    // The network's pixels are coarser than the photo's (252 for 256): only at edges.
    EXPECT_LT(static_cast<double>(num_on_distractor),
              0.005 * static_cast<double>(image.points2D.size()));
  }
}

}  // namespace
}  // namespace vgtw
