// SPDX-License-Identifier: BSD-3-Clause
// Takes distractors out of a COLMAP database that some other pipeline filled.
//
// Two images with three keypoints each, all three matched. In b.png the second keypoint stands on a
// person, whom the mask blacks out: its match goes. Keypoints stay, so that every index in the
// database and in models made from it remains valid. `vgtw mask apply` does the same.
//   usage: mask_database EMPTY_FOLDER
#include "bridge/colmap_database.h"
#include "bridge/mask_apply.h"
#include "bridge/mask_files.h"
#include "scene/error.h"
#include "scene/image_io.h"

#include <cstdio>

namespace {

constexpr int kSize = 100;  // pixels, both sides

void MakeDatabase(const std::filesystem::path& path) {
  vgtw::ColmapDatabase database = vgtw::ColmapDatabase::Create(path);
  vgtw::ColmapDatabase::Transaction transaction(database);
  vgtw::Camera camera;
  camera.camera_id = 1;
  camera.model = vgtw::CameraModel::kPinhole;
  camera.width = kSize;
  camera.height = kSize;
  camera.params = {100.0, 100.0, 50.0, 50.0};
  database.WriteCamera(camera);
  vgtw::Keypoints keypoints{3, 2, {10.5f, 20.5f, 50.5f, 60.5f, 80.5f, 30.5f}};
  for (const vgtw::ImageId image_id : {1, 2}) {
    database.WriteImage({image_id, image_id == 1 ? "a.png" : "b.png", camera.camera_id});
    database.WriteKeypoints(image_id, keypoints);
  }
  database.WriteMatches(1, 2, {{0, 0}, {1, 1}, {2, 2}});
  transaction.Commit();
}

void MakeMasks(const std::filesystem::path& folder) {
  vgtw::StaticMask static_mask(kSize, kSize, 255);
  vgtw::WriteImage(vgtw::MaskPath(folder, "a.png"), static_mask);
  for (int y = 40; y < 80; ++y) {
    for (int x = 40; x < 60; ++x) static_mask(x, y) = 0;
  }
  vgtw::WriteImage(vgtw::MaskPath(folder, "b.png"), static_mask);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  try {
    MakeDatabase(folder / "all.db");
    MakeMasks(folder / "masks");
    const vgtw::ApplyMasksSummary summary =
        vgtw::ApplyMasks(folder / "all.db", folder / "masks", folder / "static.db", {});
    for (const vgtw::ApplyMasksImageSummary& image : summary.images) {
      std::printf("%s: %zu of %zu keypoints excluded\n",
                  image.image_name.c_str(),
                  static_cast<size_t>(image.num_excluded_keypoints),
                  static_cast<size_t>(image.num_keypoints));
    }
    const vgtw::ColmapDatabase database(folder / "static.db",
                                        vgtw::ColmapDatabase::Mode::kReadOnly);
    std::printf("matches left:");
    for (const auto& [a, b] : database.ReadMatches(1, 2)) std::printf(" %u-%u", a, b);
    std::printf("\nkeypoints left in b.png: %u\n", database.ReadKeypoints(2)->rows);
    return 0;
  } catch (const vgtw::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
