// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_conventions.h"

#include "scene/error.h"

#include <algorithm>
#include <map>
#include <numeric>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr auto kExcluded = MaskPolarity::kMarkedIsExcluded;

constexpr MaskConvention kConventions[] = {
    {.id = "colmap",
     .tool = "COLMAP",
     .patterns = {"{name}.png", "{dir}{stem}.png"},
     .setting = "feature_extractor --ImageReader.mask_path FOLDER",
     .source =
         "colmap/colmap image_reader.cc, read and run; the name without the photo's extension "
         "from 3.13 on; from 3.12 on it drops photos without a mask"},
    {.id = "vggsfm",
     .tool = "VGGSfM",
     .patterns = {"{name}"},
     .polarity = kExcluded,
     .missing = MissingMask::kError,
     .setting =
         "name the folder SCENE_DIR/masks; its files are PNG whatever their extension, which "
         "VGGSfM reads by content",
     .source = "facebookresearch/vggsfm datasets/demo_loader.py, README; photos flat in images/"},
    {.id = "nerfstudio",
     .tool = "nerfstudio",
     .patterns = {"{dir}{stem}.png"},
     .missing = MissingMask::kError,
     .setting = "ns-train ... colmap --masks-path FOLDER, or \"mask_path\" in every frame of "
                "transforms.json",
     .source = "nerfstudio-project/nerfstudio colmap_dataparser.py, data_utils.py, "
               "docs/quickstart/data_conventions.md; size of the images trained on"},
    {.id = "3dgrut",
     .tool = "3DGRUT",
     .patterns = {"{dir}{stem}_mask.png"},
     .mark = MaskMark::kHalf,
     .beside_photos = true,
     .setting = "copy the files beside the photos",
     .source =
         "nv-tlabs/3dgrut datasets/dataset_colmap.py (value / 255 > 0.5; its README's masks of "
         "0 and 1 would exclude everything)"},
    {.id = "openmvs",
     .tool = "OpenMVS",
     .patterns = {"{dir}{stem}.mask.png", "{stem}.mask.png"},
     .size = MaskSize::kScaled,
     .beside_photos = true,
     .setting =
         "masks of the undistorted photos: copy the files beside them, then DensifyPointCloud "
         "and TextureMesh --ignore-mask-label 0",
     .source = "cdcseacave/openMVS libs/MVS/DepthMap.cpp, DensifyPointCloud.cpp; with --mask-path "
               "flat, and every photo needs one"},
    {.id = "realitycapture",
     .tool = "RealityCapture, RealityScan (files)",
     .patterns = {"{name}.mask.png"},
     .beside_photos = true,
     .setting = "copy the files beside the photos and add both together",
     .source = "RealityCapture help, imglayers.htm and mask.htm; threshold of gray values and EXIF "
               "rotation not verified"},
    {.id = "realitycapture_folder",
     .tool = "RealityCapture, RealityScan (layer folder)",
     .patterns = {"{dir}.mask/{stem}.png"},
     .beside_photos = true,
     .setting = "copy the .mask folders into the photos' folders and add them together",
     .source = "RealityCapture help, imglayers.htm (.mask/DSC_0001.png); threshold of gray values, "
               "EXIF rotation and photos outside a .geometry folder not verified"},
    {.id = "odm",
     .tool = "OpenDroneMap",
     .patterns = {"{stem}_mask.png", "{stem}_mask.jpg", "{stem}_mask.JPG", "{stem}_mask.tif"},
     .size = MaskSize::kScaled,
     .frame = MaskFrame::kUpright,
     .beside_photos = true,
     .allows_spaces = false,
     .setting = "copy the files into the project's images/, beside the photos (no sub-folders)",
     .source = "OpenDroneMap/ODM stages/dataset.py, opendm/osfm.py; pixels as for OpenSfM"},
    {.id = "instant-ngp",
     .tool = "instant-ngp",
     .patterns = {"{dir}dynamic_mask_{stem}.png"},
     .polarity = kExcluded,
     .mark = MaskMark::kNonZeroChannel,
     .beside_photos = true,
     .setting = "copy the files beside the photos",
     .source = "NVlabs/instant-ngp src/nerf_loader.cu, README"},
    {.id = "opensfm",
     .tool = "OpenSfM",
     .patterns = {"{base}.png"},
     .size = MaskSize::kScaled,
     .frame = MaskFrame::kUpright,
     .setting = "name the folder DATASET/masks; there must be no mask_list.txt",
     .source =
         "mapillary/OpenSfM dataset.py, masking.py, upright.py; mask_list.txt is not read here"},
    {.id = "openmvg",
     .tool = "openMVG",
     .patterns = {"{stem}_mask.png"},
     .beside_photos = true,
     .setting = "copy the files into the photos' root folder before openMVG_main_ComputeFeatures",
     .source =
         "openMVG/openMVG main_ComputeFeatures.cpp; a mask of another size is ignored without a "
         "word, mask.png for all photos is not read here"},
    {.id = "metashape",
     .tool = "Metashape",
     .patterns = {"{stem}_mask.png"},
     .setting = "Import Masks, From File, template FOLDER/{filename}_mask.png",
     .source =
         "agisoft-llc/metashape-scripts automatic_masking.py; threshold of gray values, other "
         "sizes and EXIF rotation not verified"},
    {.id = "meshroom",
     .tool = "Meshroom, AliceVision",
     .patterns = {"{stem}.png"},
     .setting = "Masks Folder of FeatureExtraction and PrepareDenseScene, extension png",
     .source =
         "alicevision/AliceVision FeatureExtractor.cpp, image/io.cpp; masks named by view id and "
         "EXR masks are not read here"},
    {.id = "sam2",
     .tool = "SAM 2 (label images)",
     .patterns = {"{dir}{stem}.png"},
     .polarity = kExcluded,
     .mark = MaskMark::kNonZeroChannel,
     .writable = false,
     .source = "facebookresearch/sam2 tools/vos_inference.py; every object is a distractor"},
    {.id = "sam2_objects",
     .tool = "SAM 2 (a folder per object)",
     .patterns = {"*/{stem}.png"},
     .polarity = kExcluded,
     .mark = MaskMark::kNonZeroChannel,
     .writable = false,
     .source = "facebookresearch/sam2 tools/vos_inference.py --per_obj_png_file; every object is a "
               "distractor"},
    {.id = "monst3r",
     .tool = "MonST3R",
     .patterns = {"dynamic_mask_{frame}.png"},
     .polarity = kExcluded,
     .size = MaskSize::kDust3r,
     .missing = MissingMask::kError,
     .frame = MaskFrame::kUpright,
     .writable = false,
     .source = "Junyi42/monst3r cloud_opt/base_opt.py, utils/image.py; --image_size 512"},
    {.id = "easi3r",
     .tool = "Easi3R",
     .patterns = {"dynamic_mask_{frame}.png"},
     .polarity = kExcluded,
     .size = MaskSize::kDust3r,
     .missing = MissingMask::kError,
     .frame = MaskFrame::kUpright,
     .writable = false,
     .source = "Inception3D/Easi3R cloud_opt/base_opt.py, utils/image.py; --image_size 512"},
};

std::string BaseName(const std::string& name) { return name.substr(name.rfind('/') + 1); }

// `pattern` with its placeholders filled in.
std::string Expand(std::string_view pattern, const std::string& name, size_t frame) {
  const std::string base = BaseName(name);
  const std::map<std::string_view, std::string> values = {
      {"{name}", name},
      {"{dir}", name.substr(0, name.size() - base.size())},
      {"{base}", base},
      {"{stem}", base.substr(0, base.rfind('.'))},
      {"{frame}", std::to_string(frame)}};
  std::string text;
  while (!pattern.empty()) {
    const size_t open = std::min(pattern.find('{'), pattern.size());
    text += pattern.substr(0, open);
    pattern.remove_prefix(open);
    if (pattern.empty()) break;
    const size_t end = pattern.find('}') + 1;
    text += values.at(pattern.substr(0, end));
    pattern.remove_prefix(end);
  }
  return text;
}

// Rank of each photo by base name, which is the order of the frames in segmenters of videos.
std::vector<size_t> Frames(const std::vector<std::string>& names) {
  std::vector<size_t> order(names.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return BaseName(names[a]) < BaseName(names[b]);
  });
  std::vector<size_t> frames(names.size());
  for (size_t frame = 0; frame < order.size(); ++frame) frames[order[frame]] = frame;
  return frames;
}

std::vector<fs::path> SubFolders(const fs::path& folder) {
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

// The files of the first pattern that finds any, of each photo.
std::vector<std::vector<fs::path>> FindFiles(const MaskConvention& convention,
                                             const fs::path& mask_folder,
                                             const std::vector<std::string>& image_names) {
  if (!fs::is_directory(mask_folder)) Fail(mask_folder, "is not a folder", "a folder of masks");
  constexpr std::string_view kEverySubFolder = "*/";
  const std::vector<size_t> frames = Frames(image_names);
  std::vector<std::vector<fs::path>> files(image_names.size());
  for (std::string_view pattern : convention.patterns) {
    if (pattern.empty()) break;
    std::vector<fs::path> folders = {mask_folder};
    if (pattern.starts_with(kEverySubFolder)) {
      folders = SubFolders(mask_folder);
      pattern.remove_prefix(kEverySubFolder.size());
    }
    for (size_t i = 0; i < image_names.size(); ++i) {
      if (!files[i].empty()) continue;
      const std::string name = Expand(pattern, image_names[i], frames[i]);
      for (const fs::path& folder : folders) {
        if (fs::is_regular_file(folder / name)) files[i].push_back(folder / name);
      }
    }
  }
  return files;
}

}  // namespace

std::span<const MaskConvention> MaskConventions() { return kConventions; }

const MaskConvention& GetMaskConvention(std::string_view id) {
  std::string known;
  for (const MaskConvention& convention : kConventions) {
    if (convention.id == id) return convention;
    known += (known.empty() ? "" : ", ") + std::string(convention.id);
  }
  throw Error("unknown mask convention '" + Printable(id) + "', expected one of " + known);
}

std::vector<std::string> MaskNames(const MaskConvention& convention,
                                   const std::vector<std::string>& image_names) {
  const std::vector<size_t> frames = Frames(image_names);
  std::vector<std::string> names;
  for (size_t i = 0; i < image_names.size(); ++i) {
    names.push_back(Expand(convention.patterns[0], image_names[i], frames[i]));
  }
  return names;
}

std::vector<std::vector<fs::path>> FindMasks(const MaskConvention& convention,
                                             const fs::path& mask_folder,
                                             const std::vector<std::string>& image_names) {
  std::vector<std::vector<fs::path>> files = FindFiles(convention, mask_folder, image_names);
  std::map<fs::path, size_t> owners;
  for (size_t i = 0; i < files.size(); ++i) {
    for (const fs::path& file : files[i]) {
      const auto [owner, is_new] = owners.emplace(file, i);
      if (is_new) continue;
      Fail(file,
           "is the mask of two photos, " + Printable(image_names[owner->second]) + " and " +
               Printable(image_names[i]) + ", in the convention " + std::string(convention.id),
           "one photo per mask",
           "rename one of the photos");
    }
  }
  return files;
}

std::vector<MaskCount> CountMasks(const fs::path& mask_folder,
                                  const std::vector<std::string>& image_names) {
  std::vector<MaskCount> counts;
  for (const MaskConvention& convention : kConventions) {
    const auto files = FindFiles(convention, mask_folder, image_names);
    const auto num_found = std::count_if(
        files.begin(), files.end(), [](const auto& of_photo) { return !of_photo.empty(); });
    counts.push_back({&convention, static_cast<size_t>(num_found)});
  }
  return counts;
}

std::optional<MaskCount> GuessConvention(const fs::path& mask_folder,
                                         const std::vector<std::string>& image_names) {
  const std::vector<MaskCount> counts = CountMasks(mask_folder, image_names);
  const auto most =
      std::max_element(counts.begin(), counts.end(), [](const MaskCount& a, const MaskCount& b) {
        return a.num_found < b.num_found;
      });
  if (most->num_found == 0) return std::nullopt;
  return *most;
}

}  // namespace vgtw
