// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/static_views.h"

#include "scene/confidence_histogram.h"
#include "scene/statistics.h"

#include <algorithm>
#include <utility>

namespace vgtw {

std::map<std::string, size_t> IndexByName(const PredictionReader& predictions) {
  std::map<std::string, size_t> idx_by_name;
  for (size_t i = 0; i < predictions.views().size(); ++i) {
    idx_by_name[predictions.views()[i].name] = i;
  }
  return idx_by_name;
}

double ConfidenceThreshold(const StaticView& view, double keep_percent) {
  ConfidenceHistogram histogram;
  view.AddConfidencesTo(histogram);
  return histogram.ThresholdKeeping(keep_percent);
}

double ErrorUnit(const std::vector<Eigen::Vector3d>& centres, std::vector<double> middle_depths) {
  const double extent = Diameter(centres);
  return middle_depths.empty() ? extent : std::min(extent, Median(std::move(middle_depths)));
}

}  // namespace vgtw
