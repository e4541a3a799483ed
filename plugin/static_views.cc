// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/static_views.h"

#include "scene/confidence_histogram.h"

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

}  // namespace vgtw
