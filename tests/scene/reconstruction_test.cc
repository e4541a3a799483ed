// SPDX-License-Identifier: BSD-3-Clause
#include "scene/reconstruction.h"

#include <cmath>
#include <functional>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Images 1, 2, 3 of camera 7. Point 10 is point2D 0 of all three, point 20 is point2D 2 of images
// 1 and 3; point2D 1 is free.
Reconstruction MakeModel() {
  Reconstruction model;
  model.cameras[7] = MakePinhole(100, 80, 90, 90);
  model.cameras[7].camera_id = 7;
  for (const ImageId image_id : {1u, 2u, 3u}) {
    Image& image = model.images[image_id];
    image.image_id = image_id;
    image.camera_id = 7;
    image.name = std::to_string(image_id) + ".jpg";
    image.cam_from_world.translation.x() = image_id;
    image.points2D.resize(3);
    image.points2D[0].point3D_id = 10;
  }
  model.images[1].points2D[2].point3D_id = 20;
  model.images[3].points2D[2].point3D_id = 20;
  model.points3D[10].track = {{1, 0}, {2, 0}, {3, 0}};
  model.points3D[20].track = {{1, 2}, {3, 2}};
  return model;
}

// The same with rig 7 of the one camera and frame 100 + i of image i.
Reconstruction MakeModelWithFrames() {
  Reconstruction model = MakeModel();
  model.rigs[7] = {7, {0, 7}, {}};
  for (const auto& [image_id, image] : model.images) {
    model.frames[100 + image_id] = {100 + image_id, 7, image.cam_from_world, {{{0, 7}, image_id}}};
  }
  return model;
}

std::string FaultAfter(const std::function<void(Reconstruction&)>& change) {
  Reconstruction model = MakeModelWithFrames();
  change(model);
  return FindFault(model);
}

TEST(Reconstruction, WithoutFaultHasNone) {
  EXPECT_EQ(FindFault(Reconstruction()), "");
  EXPECT_EQ(FindFault(MakeModel()), "");
  EXPECT_EQ(FindFault(MakeModelWithFrames()), "");
}

TEST(Reconstruction, FaultsOfCamerasAndImagesAreNamed) {
  EXPECT_EQ(FaultAfter([](auto& m) { m.cameras[7].camera_id = 8; }),
            "camera 7 is filed under another id");
  EXPECT_EQ(FaultAfter([](auto& m) { m.cameras[7].params[0] = 0.0; }),
            "camera 7: focal length is not positive");
  EXPECT_EQ(FaultAfter([](auto& m) { m.images[2].image_id = 1; }),
            "image 2 is filed under another id");
  EXPECT_EQ(FaultAfter([](auto& m) { m.images[2].camera_id = 6; }),
            "image 2 names the missing camera 6");
  EXPECT_EQ(FaultAfter([](auto& m) { m.images[2].cam_from_world.rotation.w() = 2.0; }),
            "image 2: the rotation is not a unit quaternion");
  EXPECT_EQ(FaultAfter([](auto& m) { m.images[2].points2D[1].xy.y() = std::nan(""); }),
            "image 2 has a point2D that is not finite");
}

TEST(Reconstruction, FaultsOfTracksAreNamed) {
  EXPECT_EQ(FaultAfter([](auto& m) { m.points3D[10].xyz.z() = std::nan(""); }),
            "point3D 10: the position is not finite");
  EXPECT_EQ(FaultAfter([](auto& m) { m.points3D[10].track[1].image_id = 4; }),
            "point3D 10: the track names the missing image 4");
  EXPECT_EQ(FaultAfter([](auto& m) { m.points3D[10].track[1].point2D_idx = 3; }),
            "point3D 10: the track names the missing point2D 3 of image 2");
  EXPECT_EQ(FaultAfter([](auto& m) { m.points3D[10].track[1].point2D_idx = 1; }),
            "point3D 10: the track names point2D 1 of image 2, which does not name the point");
  EXPECT_EQ(FaultAfter([](auto& m) {
              m.points3D[10].track[1] = {1, 0};
            }),
            "point3D 10: the track names point2D 0 of image 1 twice");
  EXPECT_EQ(FaultAfter([](auto& m) { m.points3D[10].track.pop_back(); }),
            "point2D 0 of image 3 names point3D 10, whose track does not name it");
  EXPECT_EQ(FaultAfter([](auto& m) { m.images[2].points2D[1].point3D_id = 30; }),
            "point2D 1 of image 2 names point3D 30, whose track does not name it");
  EXPECT_EQ(FaultAfter([](auto& m) { m.points3D[kInvalidPoint3DId]; }),
            "a point3D has the invalid id");
}

TEST(Reconstruction, FaultsOfRigsAndFramesAreNamed) {
  EXPECT_EQ(FaultAfter([](auto& m) { m.rigs[7].rig_id = 8; }), "rig 7 is filed under another id");
  EXPECT_EQ(FaultAfter([](auto& m) {
              m.rigs[7].sensor_from_rig[{0, 7}];
            }),
            "rig 7 names its reference sensor twice");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames[102].frame_id = 1; }),
            "frame 102 is filed under another id");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames[102].rig_id = 8; }),
            "frame 102: names the missing rig 8");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames[102].rig_from_world.translation.x() = HUGE_VAL; }),
            "frame 102: the translation is not finite");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames[102].data[0].sensor.id = 8; }),
            "frame 102: names a sensor that its rig lacks");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames[102].data[0].data_id = 9; }),
            "frame 102: names the missing image 9");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames[102].data[0].data_id = (uint64_t{1} << 32) + 2; }),
            "frame 102: names the missing image 4294967298");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames[102].data[0].data_id = 1; }),
            "frame 102: image 1 belongs to two frames");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames.erase(102); }), "image 2 belongs to no frame");
  EXPECT_EQ(FaultAfter([](auto& m) { m.frames.clear(); }), "image 1 belongs to no frame");
}

TEST(UpdateFrames, TakesThePosesOfImages) {
  Reconstruction model = MakeModelWithFrames();
  model.images[2].cam_from_world = {RotationAboutAxis(Eigen::Vector3d::UnitX(), 20.0), {4, 5, 6}};
  UpdateFrames(model);
  EXPECT_EQ(model.frames[102].rig_from_world.translation, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(model.frames[102].rig_from_world.rotation.coeffs(),
            model.images[2].cam_from_world.rotation.coeffs());
  EXPECT_EQ(model.frames[103].rig_from_world.translation, Eigen::Vector3d(3, 0, 0));
  EXPECT_EQ(FindFault(model), "");
}

TEST(UpdateFrames, ForgetsFramesOfRemovedImages) {
  Reconstruction model = MakeModelWithFrames();
  RemoveObservation(model, {2, 0});
  model.images.erase(2);
  UpdateFrames(model);
  EXPECT_FALSE(model.frames.contains(102));
  EXPECT_EQ(FindFault(model), "");
}

TEST(UpdateFrames, DropsRigsOfManySensors) {
  Reconstruction model = MakeModelWithFrames();
  model.rigs[7].sensor_from_rig[{0, 8}] = Rigid3d{};
  UpdateFrames(model);
  EXPECT_TRUE(model.rigs.empty());
  EXPECT_TRUE(model.frames.empty());
  EXPECT_EQ(FindFault(model), "");
}

TEST(UpdateFrames, LeavesModelsWithoutFramesAlone) {
  Reconstruction model = MakeModel();
  UpdateFrames(model);
  EXPECT_EQ(FindFault(model), "");
  EXPECT_TRUE(model.frames.empty());
}

TEST(RemovePoint3D, FreesItsObservations) {
  Reconstruction model = MakeModel();
  RemovePoint3D(model, 10);
  EXPECT_EQ(model.points3D.size(), 1u);
  EXPECT_FALSE(model.images[1].points2D[0].HasPoint3D());
  EXPECT_TRUE(model.images[1].points2D[2].HasPoint3D());
  EXPECT_EQ(FindFault(model), "");
  EXPECT_THROW(RemovePoint3D(model, 10), std::invalid_argument);
}

TEST(RemoveObservation, KeepsThePointWhileTwoRemain) {
  Reconstruction model = MakeModel();
  RemoveObservation(model, {2, 0});
  EXPECT_EQ(model.points3D[10].track, (std::vector<TrackElement>{{1, 0}, {3, 0}}));
  EXPECT_FALSE(model.images[2].points2D[0].HasPoint3D());
  EXPECT_EQ(FindFault(model), "");
  RemoveObservation(model, {1, 0});
  EXPECT_FALSE(model.points3D.contains(10));
  EXPECT_EQ(FindFault(model), "");
}

TEST(RemoveObservation, RefusesWhatIsNoObservation) {
  Reconstruction model = MakeModel();
  EXPECT_THROW(RemoveObservation(model, {4, 0}), std::invalid_argument);
  EXPECT_THROW(RemoveObservation(model, {1, 3}), std::invalid_argument);
  EXPECT_THROW(RemoveObservation(model, {1, 1}), std::invalid_argument);
  EXPECT_EQ(FindFault(model), "");
}

TEST(CamFromWorldByName, HoldsEveryImage) {
  const auto cam_from_world_by_name = CamFromWorldByName(MakeModel());
  ASSERT_EQ(cam_from_world_by_name.size(), 3u);
  EXPECT_EQ(cam_from_world_by_name.at("2.jpg").translation.x(), 2.0);
}

}  // namespace
}  // namespace vgtw
