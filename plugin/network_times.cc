// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/network_times.h"

#include "plugin/network_program.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/statistics.h"

#include <algorithm>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// A folder of links to `num_views` photos, evenly spaced.
fs::path LinkPhotos(const NetworkTimesOptions& options,
                    const std::vector<std::string>& names,
                    size_t num_views) {
  const fs::path folder = options.scratch / ("photos_" + std::to_string(num_views));
  std::error_code error;
  fs::remove_all(folder, error);
  for (size_t i = 0; i < num_views; ++i) {
    const std::string& name = names[i * names.size() / num_views];
    fs::create_directories((folder / name).parent_path(), error);
    if (!error) fs::create_symlink(fs::absolute(options.image_path / name), folder / name, error);
    if (error) Fail(folder / name, "cannot be made: " + error.message(), "a link to a photo");
  }
  return folder;
}

double SecondsOf(const json& result, const char* key, const fs::path& path) {
  const auto found = result.find(key);
  if (found == result.end() || !found->is_number()) {
    Fail(
        path, std::string("has no ") + key, "the --json of vgtw predict", "reinstall vgtw-network");
  }
  return found->get<double>();
}

json Predict(const NetworkTimesOptions& options, const fs::path& photos) {
  const fs::path json_path = options.scratch / "predict.json";
  std::vector<std::string> arguments = {"predict",
                                        "--image_path",
                                        photos.string(),
                                        "--output_path",
                                        (options.scratch / "predictions").string(),
                                        "--overwrite",
                                        "--progress",
                                        "none",
                                        "--json",
                                        json_path.string()};
  arguments.insert(arguments.end(), options.flags.begin(), options.flags.end());
  RunNetworkProgram(options.program, arguments);
  json result = json::parse(ReadFile(json_path), nullptr, /*allow_exceptions=*/false);
  if (!result.is_object()) Fail(json_path, "is no JSON object", "the --json of vgtw predict");
  result.erase("views");
  result.erase("output_path");
  return result;
}

}  // namespace

void NetworkTimesOptions::Check() const {
  VGTW_CHECK(num_repeats >= 1, "num_repeats = " + std::to_string(num_repeats));
  for (const int64_t count : num_views) {
    VGTW_CHECK(count >= 2, "num_views = " + std::to_string(count));
  }
}

std::vector<NetworkTime> MeasureNetwork(const NetworkTimesOptions& options,
                                        const ProgressCallback& progress) {
  options.Check();
  const std::vector<std::string> names = ListImages(options.image_path);
  std::vector<NetworkTime> times;
  int64_t num_done = 0;
  const auto num_all = static_cast<int64_t>(options.num_views.size()) * options.num_repeats;
  for (const int64_t num_views : options.num_views) {
    if (static_cast<size_t>(num_views) > names.size()) {
      num_done += options.num_repeats;
      continue;
    }
    const fs::path photos = LinkPhotos(options, names, static_cast<size_t>(num_views));
    NetworkTime time;
    time.num_views = num_views;
    for (int i = 0; i < options.num_repeats; ++i) {
      time.summary = Predict(options, photos);
      time.seconds.push_back(SecondsOf(time.summary, "encode_sec", options.scratch) +
                             SecondsOf(time.summary, "heads_sec", options.scratch));
      if (progress) progress(++num_done, num_all);
    }
    time.median_sec = Median(time.seconds);
    times.push_back(std::move(time));
  }
  return times;
}

}  // namespace vgtw
