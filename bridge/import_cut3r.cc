// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"
#include "bridge/import_frames.h"
#include "bridge/import_loaders.h"
#include "bridge/import_views.h"
#include "bridge/npz.h"
#include "scene/error.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// A folder of CUT3R's demos, frame i = 0, 1, ...:
//   camera/%06d.npz   pose [4,4] world_from_cam, OpenCV axes; intrinsics [3,3] in pixels of the
//                     maps, principal point W/2, H/2
//   depth/%06d.npy    [H,W] z-depth; optional here
//   conf/%06d.npy     [H,W] confidence; optional here
//   color/%06d.png    the input image
// Names of photos are not kept: frames are the photos sorted by name, as the loader sorts them.
// Half a pixel is settled as in import_arrays.h.
// Source: CUT3R/CUT3R: demo.py and demo_ga.py (prepare_output).
struct Folder {
  explicit Folder(const fs::path& folder)
      : camera{folder / "camera", "", 6, ".npz"},
        depth{folder / "depth", "", 6, ".npy"},
        conf{folder / "conf", "", 6, ".npy"} {}
  FrameFiles camera;
  FrameFiles depth;
  FrameFiles conf;
};

const ArrayKeys kKeys = {.extrinsic = {"pose"}, .intrinsic = {"intrinsics"}};

std::optional<fs::path> Locate(const fs::path& input_path, const PhotoIndex&) {
  const fs::path first = Folder(input_path).camera.Path(0);
  if (!fs::is_regular_file(first)) return std::nullopt;
  const auto store = OpenArrayStore(first);
  if (!store->Contains("pose") || !store->Contains("intrinsics")) return std::nullopt;
  return input_path;
}

size_t CountCameras(const fs::path& folder) {
  std::error_code code;
  const auto entries = fs::directory_iterator(folder, code);
  return static_cast<size_t>(std::count_if(
      begin(entries), end(entries), [](const auto& e) { return e.path().extension() == ".npz"; }));
}

std::vector<ViewArrays> ReadCameras(const ImportJob& job, const Folder& folder) {
  const size_t num_frames = CountCameras(folder.camera.folder);
  CheckOnePerPhoto(job, num_frames, "cameras");
  folder.camera.HaveAll(num_frames);
  std::vector<ViewArrays> cameras;
  for (size_t i = 0; i < num_frames; ++i) {
    const auto store = OpenArrayStore(folder.camera.Path(i));
    ArrayViews views(*store, kKeys);
    if (views.num_views() != 1 || !views.has_intrinsic()) {
      Fail(store->path(), "holds no single camera", "pose (4, 4) and intrinsics (3, 3)");
    }
    cameras.push_back(views.Next());
  }
  return cameras;
}

std::vector<MapSize> ReadSizes(const Folder& folder, const std::vector<ViewArrays>& cameras) {
  if (folder.depth.HaveAll(cameras.size())) return FrameSizes(folder.depth, cameras.size());
  std::vector<MapSize> sizes;
  for (size_t i = 0; i < cameras.size(); ++i) {
    sizes.push_back(
        MapSizeFromMiddle(folder.camera.Path(i), i, cameras[i].intrinsic->topRightCorner<2, 1>()));
  }
  return sizes;
}

void Read(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  const Folder folder(job.input_path);
  std::vector<ViewArrays> cameras = ReadCameras(job, folder);
  const bool has_depth = folder.depth.HaveAll(cameras.size());
  const bool has_conf = folder.conf.HaveAll(cameras.size());
  const std::vector<MapSize> sizes = ReadSizes(folder, cameras);
  const std::vector<NetworkGeometry> geometries =
      ResolveDust3r(job.input_path, job.image_folder, job.photos, sizes, job.options.resize);
  summary.resize =
      job.options.resize == ImportResize::kAuto ? ImportResize::kCrop : job.options.resize;
  ViewImport views(job, sink, summary);
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (!cameras[i].extrinsic.allFinite()) {
      views.LeaveOut(i);
      continue;
    }
    NetworkView view;
    view.pose = PoseFromMatrix(folder.camera.Path(i),
                               job.photos[i].name,
                               cameras[i].extrinsic,
                               /*is_world_from_cam=*/true);
    view.intrinsic = cameras[i].intrinsic;
    view.geometry = geometries[i];
    if (has_depth) view.depth = ReadFrameMap(folder.depth.Path(i), sizes[i]);
    ForgetNonPositive(view.depth);
    if (has_conf) view.depth_conf = ReadFrameMap(folder.conf.Path(i), sizes[i]);
    views.Add(i, std::move(view));
  }
  views.Finish();
  summary.notes.emplace_back("the frames were taken for the photos in the order of their names");
}

}  // namespace

const Importer kCut3rImporter = {ImportFormat::kCut3r,
                                 "cut3r",
                                 "a folder of CUT3R's demo with camera/000000.npz, depth and conf",
                                 Locate,
                                 Read};

}  // namespace vgtw
