// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import_geometry.h"
#include "bridge/importer.h"
#include "bridge/npz.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Arrays of feed-forward networks for S views, as the demos of VGGT and VGTW save them:
//   extrinsic (or extrinsics)    [S,3,4] or [S,4,4]  cam_from_world, OpenCV axes
//   intrinsic (or intrinsics)    [S,3,3]             network pixels; optional
//   depth                        [S,H,W] or [S,H,W,1]  z-depth; optional
//   depth_conf (or conf)         [S,H,W] or [S,H,W,1]  optional
//   world_points                 [S,H,W,3]           optional
//   depth_mask                   [S,H,W] or [S,H,W,1]  logit of the distractor probability
//   depth_mask_binary            the same            1 = distractor; used without depth_mask
// A leading batch dimension of 1 is allowed everywhere, and S may be left out where it is 1. Other
// keys are ignored. Values that are not finite, and depths <= 0, mean unknown (NaN).
//
// Half a pixel: VGGT unprojects at integer positions u = 0..W-1 with cx = W/2, although its fields
// of view span the whole image, from corner 0 to corner W. Here value [v,u] belongs to the centre
// (u + 0.5, v + 0.5) and K is taken as it is, so that K, depth and COLMAP's pixels agree; points
// then differ from the demo's world_points_from_depth by half a network pixel, on purpose.
//
// Other systems have other words, and may say focals and principal points instead of matrices.
//
// Facts from github facebookresearch/vggt: demo_gradio.py (numpy.savez of all predictions),
// vggt/utils/{pose_enc,geometry}.py; Tianbo-Pan/VGTW: demo_gradio.py, vgtw/models/vgtw.py (masks);
// extrinsics, intrinsics and conf are the words of ByteDance-Seed/Depth-Anything-3.
struct ViewArrays {
  Eigen::Matrix<double, 3, 4> extrinsic;  // as the file says it: cam_from_world or its inverse
  std::optional<Eigen::Matrix3d> intrinsic;
  std::optional<Eigen::Vector2d> focal;
  std::optional<Eigen::Vector2d> principal_point;
  DepthMap depth;
  ConfidenceMap depth_conf;
  DistractorMask distractor;
  Grid<Eigen::Vector3f> points;
};

// A system's words for its arrays; of several the first that a store has is read.
struct ArrayKeys {
  using Words = std::vector<std::string>;
  Words extrinsic = {"extrinsic", "extrinsics"};
  Words intrinsic = {"intrinsic", "intrinsics"};
  Words focal = {};            // [S], [S,1] or [S,2], network pixels
  Words principal_point = {};  // [S,2], network pixels
  Words depth = {"depth"};
  Words depth_conf = {"depth_conf", "conf"};
  Words points = {"world_points"};
  Words valid = {};  // [S,H,W]: depth and points are unknown where it is 0
  Words distractor = {"depth_mask", "depth_mask_binary"};
};

// The first of these words that the store has.
std::optional<std::string> FindKey(const ArrayStore& store, const ArrayKeys::Words& words);

// Size of the single map [H,W] in a file of its own, which may also be [1,H,W] or [H,W,1]. Throws
// Error for other shapes or absurd sizes.
MapSize SingleMapSize(const NpyReader& reader);

// Its values, once; those that are not finite are NaN. Throws Error as above, or if it ends early.
Grid<float> ReadSingleMap(NpyReader& reader);

// Depths <= 0 mean unknown.
void ForgetNonPositive(DepthMap& depth);

// Reads the views of a store in their order, one at a time.
class ArrayViews {
 public:
  // Throws Error if the extrinsic is missing, a shape is wrong, shapes disagree or maps are absurd.
  explicit ArrayViews(const ArrayStore& store, const ArrayKeys& keys = {});

  size_t num_views() const { return num_views_; }
  // Size of the maps; nullopt if there is none.
  const std::optional<MapSize>& map_size() const { return map_size_; }
  bool has_intrinsic() const { return intrinsic_.has_value(); }

  // Throws Error if an array ends early, std::invalid_argument after the last view.
  ViewArrays Next();

  // Whether depth_mask held only 0 and 1 in a view, which logits never do: then they are
  // probabilities.
  bool has_mask_without_logits() const { return has_mask_without_logits_; }

 private:
  struct Stack {
    NpyReader reader;
    uint64_t num_views = 0;
    std::vector<uint64_t> view_shape;
  };
  std::optional<Stack> OpenMatrices(const ArrayStore& store,
                                    const std::string& key,
                                    size_t num_rows);
  std::optional<Stack> OpenVectors(const ArrayStore& store, const std::string& key);
  std::optional<Stack> OpenMaps(const ArrayStore& store,
                                const std::string& key,
                                uint64_t num_channels);
  void Agree(const Stack& stack);
  std::optional<Eigen::Vector2d> NextVector(std::optional<Stack>& stack);
  Grid<Eigen::Vector3f> NextPoints();
  DistractorMask NextDistractor();
  void ForgetInvalid(ViewArrays& view);

  size_t num_views_ = 0;
  std::optional<MapSize> map_size_;
  std::optional<Stack> extrinsic_;
  std::optional<Stack> intrinsic_;
  std::optional<Stack> focal_;
  std::optional<Stack> principal_point_;
  std::optional<Stack> depth_;
  std::optional<Stack> depth_conf_;
  std::optional<Stack> points_;
  std::optional<Stack> valid_;
  std::optional<Stack> distractor_;
  bool is_logit_ = false;
  bool has_mask_without_logits_ = false;
};

}  // namespace vgtw
