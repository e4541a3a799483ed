// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"
#include "bridge/import_geometry.h"
#include "bridge/import_loaders.h"
#include "bridge/import_views.h"
#include "bridge/importer.h"
#include "bridge/npz.h"
#include "scene/error.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// Turns arrays into views of the photos.
class ArrayImport {
 public:
  ArrayImport(const ImportJob& job, const ViewSink& sink, ImportSummary& summary)
      : job_(job), summary_(summary), views_(job, sink, summary) {}

  // Must come before views with maps.
  void Use(ResolvedResize resolved) {
    summary_.resize = resolved.resize;
    if (!resolved.warning.empty()) summary_.warnings.push_back(resolved.warning);
    geometries_ = std::move(resolved.geometries);
  }

  // `geometry_idx` is an index into the geometries of Use(); nullopt if the view has no maps.
  void Add(const fs::path& path,
           size_t photo_idx,
           std::optional<size_t> geometry_idx,
           ViewArrays arrays) {
    if (!arrays.extrinsic.allFinite()) return views_.LeaveOut(photo_idx);
    NetworkView view;
    view.pose = PoseFromMatrix(
        path, job_.photos[photo_idx].name, arrays.extrinsic, /*is_world_from_cam=*/false);
    view.intrinsic = arrays.intrinsic;
    if (geometry_idx) view.geometry = geometries_[*geometry_idx];
    view.depth = std::move(arrays.depth);
    view.depth_conf = std::move(arrays.depth_conf);
    view.distractor = std::move(arrays.distractor);
    view.points = std::move(arrays.points);
    views_.Add(photo_idx, std::move(view));
  }

  void Finish() { views_.Finish(); }

  void NoteMask(const ArrayViews& views) {
    if (!views.has_mask_without_logits() || noted_mask_) return;
    noted_mask_ = true;
    summary_.notes.emplace_back(
        "depth_mask holds only 0 and 1, so it was read as a mask (1 = distractor), not as logits");
  }

 private:
  const ImportJob& job_;
  ImportSummary& summary_;
  ViewImport views_;
  std::vector<NetworkGeometry> geometries_;
  bool noted_mask_ = false;
};

void CheckMapSize(const ArrayViews& views, const fs::path& path) {
  if (views.has_intrinsic() && !views.map_size()) {
    Fail(path,
         "has intrinsics in network pixels but no map that tells the network's size",
         "one of depth, depth_conf, depth_mask, world_points");
  }
}

bool HasExtrinsic(const ArrayStore& store) {
  return store.Contains("extrinsic") || store.Contains("extrinsics");
}

bool HoldsArrays(const fs::path& path) {
  return (IsNpzFile(path) || fs::is_directory(path)) && HasExtrinsic(*OpenArrayStore(path));
}

// --- All views in one store -----------------------------------------------------------------

// Depth Anything 3 writes exports/npz/results.npz, or mini_npz without the images:
//   depth [S,H,W] z-depth, conf [S,H,W], extrinsics [S,3,4] or [S,4,4] cam_from_world (OpenCV
//   axes), intrinsics [S,3,3] in pixels of the maps, image [S,H,W,3]
// Source: ByteDance-Seed/Depth-Anything-3: src/depth_anything_3/utils/export/npz.py, README.md.
bool IsDepthAnything3(const ArrayStore& store) {
  return store.Contains("extrinsics") && store.Contains("intrinsics") && store.Contains("depth") &&
         !store.Contains("extrinsic") && !store.Contains("depth_conf") &&
         !store.Contains("world_points");
}

std::optional<fs::path> LocateDepthAnything3(const fs::path& input_path, const PhotoIndex&) {
  for (const char* inside : {"",
                             "results.npz",
                             "npz/results.npz",
                             "mini_npz/results.npz",
                             "exports/npz/results.npz",
                             "exports/mini_npz/results.npz"}) {
    const fs::path file = inside[0] == '\0' ? input_path : input_path / inside;
    if (IsNpzFile(file) && IsDepthAnything3(*OpenArrayStore(file))) return file;
  }
  return std::nullopt;
}

std::optional<fs::path> LocateStack(const fs::path& input_path, const PhotoIndex&) {
  const auto holds_stack = [](const fs::path& path) {
    return HoldsArrays(path) && !(IsNpzFile(path) && IsDepthAnything3(*OpenArrayStore(path)));
  };
  if (holds_stack(input_path)) return input_path;
  const fs::path inside = input_path / "predictions.npz";
  if (fs::is_directory(input_path) && IsNpzFile(inside) && holds_stack(inside)) return inside;
  return std::nullopt;
}

std::vector<ImageSize> SizesOf(const std::vector<Photo>& photos) {
  std::vector<ImageSize> sizes;
  for (const Photo& photo : photos) sizes.push_back(photo.size);
  return sizes;
}

// How the photos of a job became maps of one size.
using ResolveStack = ResolvedResize (*)(const ImportJob& job, const MapSize& map_size);

ResolvedResize ResolveVggt(const ImportJob& job, const MapSize& map_size) {
  return ResolveResize(job.input_path,
                       SizesOf(job.photos),
                       std::vector<MapSize>(job.photos.size(), map_size),
                       job.options.resize);
}

ResolvedResize ResolveDepthAnything3(const ImportJob& job, const MapSize& map_size) {
  if (job.options.resize != ImportResize::kAuto) return ResolveVggt(job, map_size);
  auto geometries = DepthAnything3Geometries(SizesOf(job.photos), map_size);
  if (!geometries) {
    Fail(job.input_path,
         "maps of " + std::to_string(map_size.width) + "x" + std::to_string(map_size.height) +
             " cannot come from these photos by Depth Anything 3's upper_bound_resize",
         "the photos that the network saw",
         "name those by --image_path, or say another way by --resize");
  }
  return {ImportResize::kStretch, *std::move(geometries), ""};
}

void ReadStackBy(ResolveStack resolve,
                 const ImportJob& job,
                 const ViewSink& sink,
                 ImportSummary& summary) {
  const auto store = OpenArrayStore(job.input_path);
  ArrayViews views(*store);
  CheckOnePerPhoto(job, views.num_views(), "views");
  CheckMapSize(views, job.input_path);
  ArrayImport import(job, sink, summary);
  if (views.map_size()) import.Use(resolve(job, *views.map_size()));
  for (size_t i = 0; i < views.num_views(); ++i) {
    std::optional<size_t> geometry_idx;
    if (views.map_size()) geometry_idx = i;
    import.Add(job.input_path, i, geometry_idx, views.Next());
  }
  import.NoteMask(views);
  import.Finish();
}

void ReadStack(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  ReadStackBy(ResolveVggt, job, sink, summary);
}

void ReadDepthAnything3(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  ReadStackBy(ResolveDepthAnything3, job, sink, summary);
  summary.notes.emplace_back("the views were taken for the photos in the order of their names");
}

// --- One store per photo --------------------------------------------------------------------

struct StoreOfPhoto {
  fs::path path;
  size_t photo_idx = 0;
};

// Files <name>.npz and folders of .npy below `folder` that name a photo, by photo.
std::vector<StoreOfPhoto> FindStores(const fs::path& folder, const PhotoIndex& photos) {
  std::vector<StoreOfPhoto> stores;
  if (!fs::is_directory(folder)) return stores;
  for (const auto& entry :
       fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied)) {
    const fs::path relative = entry.path().lexically_relative(folder);
    const fs::path name =
        IsNpzFile(entry.path()) ? fs::path(relative).replace_extension() : relative;
    const bool may_hold = IsNpzFile(entry.path()) || entry.is_directory();
    const std::optional<size_t> photo_idx =
        may_hold ? photos.Find(name.generic_string(), true) : std::nullopt;
    if (photo_idx && HoldsArrays(entry.path())) stores.push_back({entry.path(), *photo_idx});
  }
  std::sort(stores.begin(), stores.end(), [](const StoreOfPhoto& a, const StoreOfPhoto& b) {
    return std::tie(a.photo_idx, a.path) < std::tie(b.photo_idx, b.path);
  });
  return stores;
}

std::optional<fs::path> LocateFolder(const fs::path& input_path, const PhotoIndex& photos) {
  if (FindStores(input_path, photos).empty()) return std::nullopt;
  return input_path;
}

void CheckStores(const ImportJob& job, const std::vector<StoreOfPhoto>& stores) {
  for (size_t i = 1; i < stores.size(); ++i) {
    if (stores[i].photo_idx != stores[i - 1].photo_idx) continue;
    Fail(stores[i].path,
         "and " + stores[i - 1].path.filename().string() + " name the same photo",
         "one set of arrays a photo");
  }
  if (stores.empty()) {
    Fail(job.input_path, "holds no arrays named like a photo", "<image name or stem>.npz files");
  }
}

ArrayViews OpenSingle(const ArrayStore& store) {
  ArrayViews views(store);
  if (views.num_views() != 1) {
    Fail(store.path(), "holds " + std::to_string(views.num_views()) + " views", "one");
  }
  CheckMapSize(views, store.path());
  return views;
}

void ReadFolder(const ImportJob& job, const ViewSink& sink, ImportSummary& summary) {
  const std::vector<StoreOfPhoto> stores = FindStores(job.input_path, PhotoIndex(job.photos));
  CheckStores(job, stores);
  std::vector<ImageSize> photo_sizes;
  std::vector<MapSize> map_sizes;
  std::vector<std::optional<size_t>> geometry_indices(stores.size());
  for (size_t i = 0; i < stores.size(); ++i) {
    const auto store = OpenArrayStore(stores[i].path);
    const ArrayViews views = OpenSingle(*store);
    if (!views.map_size()) continue;
    geometry_indices[i] = map_sizes.size();
    photo_sizes.push_back(job.photos[stores[i].photo_idx].size);
    map_sizes.push_back(*views.map_size());
  }
  ArrayImport import(job, sink, summary);
  if (!map_sizes.empty()) {
    import.Use(ResolveResize(job.input_path, photo_sizes, map_sizes, job.options.resize));
  }
  for (size_t i = 0; i < stores.size(); ++i) {
    const auto store = OpenArrayStore(stores[i].path);
    ArrayViews views = OpenSingle(*store);
    import.Add(stores[i].path, stores[i].photo_idx, geometry_indices[i], views.Next());
    import.NoteMask(views);
  }
  import.Finish();
  NotePhotosLeftOut(job, stores.size(), summary);
}

}  // namespace

const Importer kVggtNpzImporter = {ImportFormat::kVggtNpz,
                                   "vggt_npz",
                                   "predictions.npz of the demos of VGGT or VGTW",
                                   LocateStack,
                                   ReadStack};

const Importer kDa3NpzImporter = {ImportFormat::kDa3Npz,
                                  "da3_npz",
                                  "results.npz of Depth Anything 3",
                                  LocateDepthAnything3,
                                  ReadDepthAnything3};

const Importer kNpzFolderImporter = {ImportFormat::kNpzFolder,
                                     "npz_folder",
                                     "a folder with <image name or stem>.npz per photo",
                                     LocateFolder,
                                     ReadFolder};

}  // namespace vgtw
