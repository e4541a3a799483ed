// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"

#include "scene/error.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Arrays = std::map<std::string, std::string>;

const std::vector<float> kPose = {1, 0, 0, 4, 0, 1, 0, 5, 0, 0, 1, 6};

struct Store {
  TemporaryFolder folder;
  std::unique_ptr<ArrayStore> store;
  explicit Store(const Arrays& arrays) {
    WriteNpz(folder / "a.npz", arrays);
    store = OpenArrayStore(folder / "a.npz");
  }
};

TEST(ArrayViews, ASingleViewMayLeaveOutItsDimension) {
  Store single({{"extrinsic", NpyFloats("(3, 4)", kPose)},
                {"depth", NpyFloats("(2, 3)", {1, 2, 3, 4, 5, 6})},
                {"world_points", NpyFloats("(2, 3, 3)", std::vector<float>(18, 0.5f))}});
  ArrayViews views(*single.store);
  EXPECT_EQ(views.num_views(), 1u);
  EXPECT_EQ(*views.map_size(), (MapSize{3, 2}));
  EXPECT_FALSE(views.has_intrinsic());
  const ViewArrays view = views.Next();
  EXPECT_EQ(view.extrinsic.col(3), Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(view.depth(2, 0), 3.0f);
  EXPECT_EQ(view.depth(0, 1), 4.0f);
  EXPECT_EQ(view.points(1, 1), Eigen::Vector3f(0.5f, 0.5f, 0.5f));
  EXPECT_TRUE(view.depth_conf.empty());
  EXPECT_THROW(views.Next(), std::invalid_argument);
}

TEST(ArrayViews, FourByFourPosesAreUnderstood) {
  std::vector<float> poses = kPose;
  poses.insert(poses.end(), {0, 0, 0, 1, 0, 1, 0, 7, -1, 0, 0, 8, 0, 0, 1, 9, 0, 0, 0, 1});
  Store two({{"extrinsics", NpyFloats("(2, 4, 4)", poses)}});
  ArrayViews views(*two.store);
  EXPECT_EQ(views.Next().extrinsic.col(3), Eigen::Vector3d(4, 5, 6));
  const ViewArrays second = views.Next();
  EXPECT_EQ(second.extrinsic.col(3), Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(second.extrinsic(0, 1), 1.0);
  EXPECT_EQ(second.extrinsic(1, 0), -1.0);
}

TEST(ArrayViews, FortranOrderIsUnderstood) {
  // (1, 2, 3) column-major: with one view the rows still interleave.
  Store fortran(
      {{"extrinsic", NpyFloats("(1, 3, 4)", kPose)},
       {"depth", NpyBytes("<f4", "(1, 2, 3)", RawBytes<float>({1, 4, 2, 5, 3, 6}), true)}});
  const DepthMap depth = ArrayViews(*fortran.store).Next().depth;
  EXPECT_EQ(depth.data(), (std::vector<float>{1, 2, 3, 4, 5, 6}));
}

TEST(ArrayViews, LogitsAndProbabilities) {
  const auto mask_of = [](const Arrays& mask) {
    Arrays arrays = mask;
    arrays["extrinsic"] = NpyFloats("(3, 4)", kPose);
    Store store(arrays);
    return ArrayViews(*store.store).Next().distractor.data();
  };
  const float nan = std::nanf("");
  const auto logits = mask_of({{"depth_mask", NpyFloats("(2, 2)", {0, -1000, 1000, nan})}});
  EXPECT_EQ(logits[0], 0.5f);
  EXPECT_EQ(logits[1], 0.0f);
  EXPECT_EQ(logits[2], 1.0f);
  EXPECT_TRUE(std::isnan(logits[3]));
  EXPECT_EQ(mask_of({{"depth_mask_binary", NpyFloats("(2, 2)", {0, 1, 0.4f, 0.6f})}}),
            (std::vector<float>{0, 1, 0, 1}));
}

TEST(ArrayViews, ShapesMustAgree) {
  const auto fails = [](const std::string& key, const std::string& npy) {
    Arrays arrays = {{"extrinsic", NpyFloats("(3, 4)", kPose)},
                     {"depth", NpyFloats("(2, 3)", std::vector<float>(6, 1))}};
    arrays[key] = npy;
    Store store(arrays);
    EXPECT_THROW(ArrayViews{*store.store}, Error) << key;
  };
  fails("depth_conf", NpyFloats("(3, 2)", std::vector<float>(6, 1)));
  fails("depth_conf", NpyFloats("(2, 2, 3)", std::vector<float>(12, 1)));
  fails("intrinsic", NpyFloats("(3, 4)", kPose));
  fails("world_points", NpyFloats("(2, 3)", std::vector<float>(6, 1)));
  fails("depth", NpyFloats("(1, 70000)", std::vector<float>(70000, 1)));
  fails("extrinsic", NpyFloats("(12,)", kPose));
}

}  // namespace
}  // namespace vgtw
