// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"
#include "bridge/import_loaders.h"
#include "bridge/import_views.h"
#include "bridge/importer.h"
#include "bridge/npz.h"
#include "scene/error.h"
#include "scene/pinhole_fit.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// All views in one store, with poses as world_from_cam (OpenCV axes) and points in the world. Where
// there is no depth it is the points' z in their camera. Intrinsics are matrices, or focal lengths
// with a principal point (W/2, H/2 unless said), all in network pixels; without either they are
// fitted to the points. Half a pixel is settled as in import_arrays.h.
struct SceneFormat {
  ArrayKeys keys;
  const char* file_name;  // that the system writes, or "" if users choose it
  bool (*is_of)(const ArrayStore& store);
  std::vector<NetworkGeometry> (*resolve)(const ImportJob& job, const MapSize& map_size);
  ImportResize resize;  // what that loader comes to
};

std::vector<NetworkGeometry> ResolveDust3rMaps(const ImportJob& job, const MapSize& map_size) {
  return ResolveDust3r(job.input_path,
                       job.image_folder,
                       job.photos,
                       std::vector<MapSize>(job.photos.size(), map_size),
                       job.options.resize);
}

// --- DUSt3R and MASt3R ----------------------------------------------------------------------

// Their demos write nothing but a mesh; people save what the README's "Usage" retrieves from the
// scene, as one .npz or as a folder of .npy, under the names that it has there.
// Source of names and shapes: naver/dust3r: README.md, dust3r/cloud_opt/base_opt.py (get_*);
// naver/mast3r: mast3r/demo.py, mast3r/cloud_opt/sparse_ga.py (SparseGA).
const SceneFormat kDust3r = {
    {.extrinsic = {"poses", "im_poses", "cams2world", "cam2w", "camera_poses"},
     .intrinsic = {"intrinsics", "intrinsic", "K"},
     .focal = {"focals", "camera_focals"},
     .principal_point = {"principal_points", "pps", "pp"},
     .depth = {"depthmaps", "depths", "depth"},
     .depth_conf = {"confs", "conf", "im_conf"},
     .points = {"pts3d"},
     .distractor = {}},
    "",
    [](const ArrayStore& store) {
      const ArrayKeys& keys = kDust3r.keys;
      return FindKey(store, keys.extrinsic) && !FindKey(store, ArrayKeys().extrinsic) &&
             (FindKey(store, keys.intrinsic) || FindKey(store, keys.focal) ||
              FindKey(store, keys.points));
    },
    ResolveDust3rMaps,
    ImportResize::kCrop};

// --- Fast3R ---------------------------------------------------------------------------------

// Its points have two heads: the local ones, aligned to the world, are the sharper, and the scale
// of the poses is the world's. Source: facebookresearch/fast3r: notebooks/demo_multiview.ipynb
// (save_pointmaps_and_camera_parameters_to_folder); fast3r/dust3r/cloud_opt/init_im_poses.py
// (fast_pnp: principal point W/2, H/2).
const SceneFormat kFast3r = {
    {.extrinsic = {"estimated_poses_c2w"},
     .intrinsic = {},
     .focal = {"estimated_focals"},
     .depth = {},
     .depth_conf = {"local_confidence_maps", "global_confidence_maps"},
     .points = {"local_aligned_to_global_pointmaps", "global_pointmaps"},
     .distractor = {}},
    "pointmaps_and_camera_params.npz",
    [](const ArrayStore& store) { return store.Contains("estimated_poses_c2w"); },
    ResolveDust3rMaps,
    ImportResize::kCrop};

// --- pi3 ------------------------------------------------------------------------------------

// Its confidence is a probability, 0 at depth edges. Source: yyfz/Pi3: demo_gradio.py (run_model);
// pi3/models/pi3.py.
const SceneFormat kPi3 = {{.extrinsic = {"camera_poses"},
                           .intrinsic = {},
                           .depth = {},
                           .depth_conf = {"conf"},
                           .points = {"points"},
                           .distractor = {}},
                          "predictions.npz",
                          [](const ArrayStore& store) {
                            return store.Contains("camera_poses") && store.Contains("points");
                          },
                          [](const ImportJob& job, const MapSize& map_size) {
                            return ResolvePi3(job.input_path, job.photos, map_size);
                          },
                          ImportResize::kStretch};

// --- MapAnything ----------------------------------------------------------------------------

// The words are VGGT's, but `extrinsic` is world_from_cam and the loader another; `final_mask`
// tells them apart. Source: facebookresearch/map-anything: scripts/gradio_app.py (run_model).
const SceneFormat kMapAnything = {
    {.intrinsic = {"intrinsic"}, .valid = {"final_mask"}, .distractor = {}},
    "predictions.npz",
    [](const ArrayStore& store) {
      return store.Contains("extrinsic") && store.Contains("final_mask");
    },
    [](const ImportJob& job, const MapSize& map_size) {
      return ResolveMapAnything(job.input_path, job.image_folder, job.photos, map_size);
    },
    ImportResize::kCrop};

// --- Reading --------------------------------------------------------------------------------

std::optional<fs::path> Locate(const SceneFormat& format, const fs::path& input_path) {
  const auto holds = [&](const fs::path& path) {
    return (IsNpzFile(path) || fs::is_directory(path)) && format.is_of(*OpenArrayStore(path));
  };
  if (holds(input_path)) return input_path;
  const fs::path inside = input_path / format.file_name;
  if (format.file_name[0] != '\0' && IsNpzFile(inside) && holds(inside)) return inside;
  return std::nullopt;
}

template <const SceneFormat& format>
std::optional<fs::path> LocateScene(const fs::path& input_path, const PhotoIndex&) {
  return Locate(format, input_path);
}

Grid<Eigen::Vector3f> Transform(const Rigid3d& cam_from_world,
                                const Grid<Eigen::Vector3f>& points_in_world) {
  Grid<Eigen::Vector3f> points_in_cam = points_in_world;
  for (Eigen::Vector3f& point : points_in_cam.data()) {
    point = (cam_from_world * point.cast<double>()).cast<float>();
  }
  return points_in_cam;
}

class SceneImport {
 public:
  SceneImport(const SceneFormat& format,
              const ImportJob& job,
              const ViewSink& sink,
              ImportSummary& summary)
      : format_(format), job_(job), summary_(summary), views_(job, sink, summary) {}

  void Read() {
    const auto store = OpenArrayStore(job_.input_path);
    ArrayViews arrays(*store, format_.keys);
    CheckOnePerPhoto(job_, arrays.num_views(), "views");
    if (arrays.map_size()) geometries_ = Resolve(*arrays.map_size());
    for (size_t i = 0; i < arrays.num_views(); ++i) Add(i, arrays.Next());
    views_.Finish();
    summary_.notes.emplace_back("the views were taken for the photos in the order of their names");
    if (num_fitted_ > 0) {
      summary_.notes.push_back("the intrinsics of " + std::to_string(num_fitted_) +
                               " views were fitted to their points: the file brings none");
    }
  }

 private:
  std::vector<NetworkGeometry> Resolve(const MapSize& map_size) {
    const ImportResize requested = job_.options.resize;
    const bool is_loader = requested == ImportResize::kAuto || requested == format_.resize ||
                           format_.resolve == ResolveDust3rMaps;
    summary_.resize = requested == ImportResize::kAuto ? format_.resize : requested;
    if (is_loader) return format_.resolve(job_, map_size);
    std::vector<ImageSize> photo_sizes;
    for (const Photo& photo : job_.photos) photo_sizes.push_back(photo.size);
    return ResolveResize(job_.input_path,
                         photo_sizes,
                         std::vector<MapSize>(photo_sizes.size(), map_size),
                         requested)
        .geometries;
  }

  void Add(size_t photo_idx, ViewArrays arrays) {
    if (!arrays.extrinsic.allFinite()) return views_.LeaveOut(photo_idx);
    NetworkView view;
    view.pose = PoseFromMatrix(job_.input_path,
                               job_.photos[photo_idx].name,
                               arrays.extrinsic,
                               /*is_world_from_cam=*/true);
    view.depth = std::move(arrays.depth);
    view.depth_conf = std::move(arrays.depth_conf);
    view.points = std::move(arrays.points);
    if (view.depth.empty() && !view.points.empty()) {
      View placed;
      placed.cam_from_world = CamFromWorld(view.pose, job_.options.repair);
      view.depth = DepthFromPoints(placed, view.points);
    }
    const bool is_asked = !job_.options.camera_params.empty();
    if (arrays.intrinsic) {
      view.intrinsic = arrays.intrinsic;
    } else if (arrays.focal && !is_asked) {
      view.intrinsic = FromFocal(photo_idx, arrays);
    } else if (!view.points.empty() && !is_asked) {
      view.intrinsic = Fit(photo_idx, view);
      if (!view.intrinsic) return views_.LeaveOut(photo_idx);
    }
    if (view.intrinsic) CheckGeometries();
    if (!geometries_.empty()) view.geometry = geometries_[photo_idx];
    views_.Add(photo_idx, std::move(view));
  }

  // Intrinsics mean network pixels; without maps the loader's default size has to be supposed.
  void CheckGeometries() {
    if (!geometries_.empty()) return;
    if (format_.resolve != ResolveDust3rMaps) {
      Fail(job_.input_path,
           "has intrinsics in network pixels but no map",
           "maps, which tell the size");
    }
    geometries_ = ResolveDust3r(job_.input_path,
                                job_.image_folder,
                                job_.photos,
                                DefaultDust3rSizes(job_, summary_),
                                job_.options.resize);
    summary_.resize = format_.resize;
  }

  Eigen::Matrix3d FromFocal(size_t photo_idx, const ViewArrays& arrays) {
    CheckGeometries();
    const NetworkGeometry& geometry = geometries_[photo_idx];
    Eigen::Matrix3d intrinsic =
        MiddleIntrinsics(*arrays.focal, {geometry.network_width, geometry.network_height});
    if (arrays.principal_point) intrinsic.topRightCorner<2, 1>() = *arrays.principal_point;
    return intrinsic;
  }

  // Points of a network lie some pixels off a pinhole; those of a mistaken pose a good part of the
  // image.
  bool Explains(const std::optional<PinholeFit>& fit, const NetworkView& view) const {
    constexpr double kMaxRelativeError = 0.03;
    const int side = std::max(view.points.width(), view.points.height());
    return fit && fit->median_error_px <= kMaxRelativeError * side;
  }

  std::optional<PinholeFit> FitUnder(const ConventionRepair& repair,
                                     const NetworkView& view) const {
    return FitPinhole(Transform(CamFromWorld(view.pose, repair), view.points), view.depth_conf);
  }

  // nullopt if the points fit no camera under any reading of the pose. Throws Error if they fit
  // under another one than was asked for.
  std::optional<Eigen::Matrix3d> Fit(size_t photo_idx, const NetworkView& view) {
    const std::optional<PinholeFit> fit = FitUnder(job_.options.repair, view);
    if (Explains(fit, view)) {
      ++num_fitted_;
      return fit->intrinsics;
    }
    for (const auto& [invert, opengl] : std::array<std::pair<bool, bool>, 4>{
             {{false, false}, {true, false}, {false, true}, {true, true}}}) {
      const ConventionRepair other = {invert, opengl, false};
      if (!Explains(FitUnder(other, view), view)) continue;
      const std::string options = OptionsText(other);
      Fail(job_.input_path,
           "the points of " + Printable(job_.photos[photo_idx].name) + " fit no camera at its pose",
           "points in the world and poses as world_from_cam",
           options.empty() ? "import without the repairs asked for" : "import with " + options);
    }
    return std::nullopt;
  }

  const SceneFormat& format_;
  const ImportJob& job_;
  ImportSummary& summary_;
  ViewImport views_;
  std::vector<NetworkGeometry> geometries_;
  size_t num_fitted_ = 0;
};

template <const SceneFormat& format>
void ReadScene(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  SceneImport(format, job, sink, summary).Read();
}

}  // namespace

const Importer kDust3rImporter = {
    ImportFormat::kDust3r,
    "dust3r",
    "an .npz or a folder of .npy with the scene of DUSt3R or MASt3R: poses (camera to world), "
    "focals or intrinsics, depthmaps, confs, pts3d",
    LocateScene<kDust3r>,
    ReadScene<kDust3r>};

const Importer kFast3rImporter = {ImportFormat::kFast3r,
                                  "fast3r",
                                  "pointmaps_and_camera_params.npz of Fast3R",
                                  LocateScene<kFast3r>,
                                  ReadScene<kFast3r>};

const Importer kPi3Importer = {ImportFormat::kPi3,
                               "pi3",
                               "predictions.npz of pi3's demo: points, conf, camera_poses",
                               LocateScene<kPi3>,
                               ReadScene<kPi3>};

const Importer kMapAnythingImporter = {ImportFormat::kMapAnything,
                                       "mapanything",
                                       "predictions.npz of MapAnything's demo",
                                       LocateScene<kMapAnything>,
                                       ReadScene<kMapAnything>,
                                       &kVggtNpzImporter};

}  // namespace vgtw
