// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/photo_order.h"

#include "scene/error.h"
#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>
#include <utility>

namespace vgtw {
namespace {

constexpr size_t kMinFlowLength = 60;     // pixels, for a pair of views to count
constexpr size_t kMinTotalLength = 1500;  // pixels of all pairs
constexpr size_t kNumRandomStarts = 40;
// An order is far better if the photos correlate at least so much under it, and by so much more
// than as read, in proportion, absolutely and against chance (a correlation of n unrelated pixels
// is of the size 1 / sqrt(n)). Measured on rendered scenes with VGGT's errors: 0.18 to 0.59 in the
// right order, 1.5 times less with two photos exchanged, nothing gained by any exchange where
// right.
constexpr double kMinCorrelation = 0.12;
constexpr double kMinRatio = 1.25;
constexpr double kMinGain = 0.05;
constexpr double kMinGainOverChance = 8.0;

// Values of every photo at the positions, as columns of mean 0 and length 1.
Eigen::MatrixXf NormalisedValues(const std::vector<Eigen::Vector2d>& positions,
                                 const std::vector<const PhotoDetail*>& details) {
  Eigen::MatrixXf values(positions.size(), details.size());
  for (Eigen::Index photo = 0; photo < values.cols(); ++photo) {
    const PhotoDetail& detail = *details[static_cast<size_t>(photo)];
    for (Eigen::Index k = 0; k < values.rows(); ++k) {
      values(k, photo) = DetailAt(detail, positions[static_cast<size_t>(k)]);
    }
    values.col(photo).array() -= values.col(photo).mean();
    const float norm = values.col(photo).norm();
    if (norm > 0.0f) values.col(photo) /= norm;
  }
  return values;
}

// Correlation of each pair of views under each pair of photos.
class OrderScore {
 public:
  OrderScore(const std::vector<ViewFlow>& flows, const std::vector<const PhotoDetail*>& details) {
    for (const ViewFlow& flow : flows) {
      if (flow.positions_a.size() < kMinFlowLength) continue;
      pairs_.push_back({flow.view_a,
                        flow.view_b,
                        static_cast<double>(flow.positions_a.size()),
                        NormalisedValues(flow.positions_a, details).transpose() *
                            NormalisedValues(flow.positions_b, details)});
      total_length_ += flow.positions_a.size();
    }
  }

  size_t total_length() const { return total_length_; }

  double operator()(const std::vector<size_t>& photo_of_view) const {
    double sum = 0.0;
    for (const Pair& pair : pairs_) {
      sum += pair.weight * pair.correlation(static_cast<Eigen::Index>(photo_of_view[pair.view_a]),
                                            static_cast<Eigen::Index>(photo_of_view[pair.view_b]));
    }
    return sum / static_cast<double>(total_length_);
  }

 private:
  struct Pair {
    size_t view_a;
    size_t view_b;
    double weight;
    Eigen::MatrixXf correlation;  // [photos of view_a, photos of view_b]
  };
  std::vector<Pair> pairs_;
  size_t total_length_ = 0;
};

// Exchanges two photos as long as that helps most.
double Climb(const OrderScore& score, std::vector<size_t>& order) {
  double current = score(order);
  while (true) {
    double best = current;
    std::pair<size_t, size_t> exchange;
    for (size_t i = 0; i < order.size(); ++i) {
      for (size_t j = i + 1; j < order.size(); ++j) {
        std::swap(order[i], order[j]);
        const double changed = score(order);
        std::swap(order[i], order[j]);
        if (changed > best + 1e-9) {
          best = changed;
          exchange = {i, j};
        }
      }
    }
    if (best == current) return current;
    std::swap(order[exchange.first], order[exchange.second]);
    current = best;
  }
}

void Shuffle(RandomStream& random, std::vector<size_t>& order) {
  for (size_t i = order.size(); i > 1; --i) {
    std::swap(order[i - 1], order[static_cast<size_t>(random.Uniform() * static_cast<double>(i))]);
  }
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The run of digits or of other characters at the front.
std::string_view FrontRun(std::string_view text) {
  size_t length = 0;
  while (length < text.size() && IsDigit(text[length]) == IsDigit(text[0])) ++length;
  return text.substr(0, length);
}

bool NaturalLess(std::string_view a, std::string_view b) {
  while (!a.empty() && !b.empty()) {
    std::string_view run_a = FrontRun(a);
    std::string_view run_b = FrontRun(b);
    a.remove_prefix(run_a.size());
    b.remove_prefix(run_b.size());
    if (IsDigit(run_a[0]) && IsDigit(run_b[0])) {
      run_a.remove_prefix(std::min(run_a.find_first_not_of('0'), run_a.size()));
      run_b.remove_prefix(std::min(run_b.find_first_not_of('0'), run_b.size()));
      if (run_a.size() != run_b.size()) return run_a.size() < run_b.size();
    }
    if (run_a != run_b) return run_a < run_b;
  }
  return a.size() < b.size();
}

}  // namespace

std::optional<PhotoOrder> FindBetterPhotoOrder(const std::vector<ViewFlow>& flows,
                                               size_t num_views,
                                               const std::vector<const PhotoDetail*>& details,
                                               const std::vector<std::vector<size_t>>& candidates) {
  VGTW_CHECK(details.size() >= num_views, "one photo per view");
  const OrderScore score(flows, details);
  if (score.total_length() < kMinTotalLength) return std::nullopt;
  std::vector<size_t> as_read(num_views);
  std::iota(as_read.begin(), as_read.end(), size_t{0});
  std::vector<std::vector<size_t>> starts = candidates;
  starts.push_back(as_read);
  RandomStream random(HashKey({num_views}));
  for (size_t i = 0; i < kNumRandomStarts; ++i) {
    starts.push_back(as_read);
    Shuffle(random, starts.back());
  }
  PhotoOrder best = {as_read, score(as_read), score(as_read)};
  for (std::vector<size_t>& order : starts) {
    const double correlation = Climb(score, order);
    if (correlation > best.correlation) {
      best.correlation = correlation;
      best.photo_of_view = std::move(order);
    }
  }
  const double chance = 1.0 / std::sqrt(static_cast<double>(score.total_length()));
  const double gain = best.correlation - best.correlation_as_read;
  const bool is_far_better = best.correlation >= kMinCorrelation &&
                             best.correlation >= best.correlation_as_read * kMinRatio &&
                             gain >= std::max(kMinGain, kMinGainOverChance * chance);
  if (!is_far_better) return std::nullopt;
  return best;
}

std::vector<size_t> NaturalOrder(const std::vector<std::string>& names) {
  std::vector<size_t> order(names.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return NaturalLess(names[a], names[b]);
  });
  return order;
}

}  // namespace vgtw
