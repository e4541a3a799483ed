// SPDX-License-Identifier: BSD-3-Clause
#include "matching/tracks.h"

#include "scene/disjoint_sets.h"
#include "scene/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <string>
#include <tuple>
#include <utility>

namespace vgtw {
namespace {

constexpr uint32_t kEnoughConfirmations = 8;

// A matched keypoint: its position in the ascending list of all of them.
using Node = uint32_t;

struct Edge {
  Node a = 0;
  Node b = 0;
  uint32_t num_confirmations = 0;
  uint32_t num_matches_of_pair = 0;
};

bool IsExcluded(const TrackImage* image, uint32_t keypoint_idx) {
  return image != nullptr && !image->is_excluded.empty() && image->is_excluded[keypoint_idx];
}

// The matched keypoints that take part, ascending by image and index.
class Nodes {
 public:
  Nodes(const std::vector<PairMatches>& pairs, const std::map<ImageId, TrackImage>& images) {
    for (const PairMatches& pair : pairs) {
      VGTW_CHECK(pair.image_id1 != pair.image_id2, "image " + std::to_string(pair.image_id1));
      image_ids_.push_back(pair.image_id1);
      image_ids_.push_back(pair.image_id2);
    }
    std::sort(image_ids_.begin(), image_ids_.end());
    image_ids_.erase(std::unique(image_ids_.begin(), image_ids_.end()), image_ids_.end());
    for (const ImageId image_id : image_ids_) {
      const auto image = images.find(image_id);
      images_.push_back(image == images.end() ? nullptr : &image->second);
      CheckSizes(images_.back());
    }
    keypoint_idxs_.resize(image_ids_.size());
    for (const PairMatches& pair : pairs) AddKeypointsOf(pair);
    begins_.push_back(0);
    for (std::vector<uint32_t>& idxs : keypoint_idxs_) {
      std::sort(idxs.begin(), idxs.end());
      idxs.erase(std::unique(idxs.begin(), idxs.end()), idxs.end());
      begins_.push_back(begins_.back() + idxs.size());
    }
    VGTW_CHECK(size() <= std::numeric_limits<Node>::max(), "too many keypoints");
  }

  size_t size() const { return begins_.back(); }
  size_t NumImages() const { return image_ids_.size(); }
  ImageId IdOf(size_t image_idx) const { return image_ids_[image_idx]; }
  const TrackImage* ImageOf(size_t image_idx) const { return images_[image_idx]; }
  const std::vector<uint32_t>& KeypointsOf(size_t image_idx) const {
    return keypoint_idxs_[image_idx];
  }
  Node FirstOf(size_t image_idx) const { return static_cast<Node>(begins_[image_idx]); }

  // Of each node.
  std::vector<uint32_t> ImageIdxs() const {
    std::vector<uint32_t> image_idxs;
    image_idxs.reserve(size());
    for (size_t i = 0; i < NumImages(); ++i) {
      image_idxs.insert(image_idxs.end(), KeypointsOf(i).size(), static_cast<uint32_t>(i));
    }
    return image_idxs;
  }

  size_t ImageIdx(ImageId image_id) const {
    const auto found = std::lower_bound(image_ids_.begin(), image_ids_.end(), image_id);
    return static_cast<size_t>(found - image_ids_.begin());
  }

  Node Find(size_t image_idx, uint32_t keypoint_idx) const {
    const std::vector<uint32_t>& idxs = keypoint_idxs_[image_idx];
    const auto found = std::lower_bound(idxs.begin(), idxs.end(), keypoint_idx);
    return static_cast<Node>(begins_[image_idx] + static_cast<size_t>(found - idxs.begin()));
  }

 private:
  static void CheckSizes(const TrackImage* image) {
    if (image == nullptr) return;
    VGTW_CHECK(image->pixels.size() == image->scales.size(), "a scale per pixel");
    VGTW_CHECK(image->is_excluded.empty() || image->pixels.empty() ||
                   image->is_excluded.size() == image->pixels.size(),
               "an entry per keypoint");
  }

  void CheckIdx(size_t image_idx, uint32_t keypoint_idx) const {
    const TrackImage* image = images_[image_idx];
    if (image == nullptr) return;
    for (const size_t size : {image->is_excluded.size(), image->pixels.size()}) {
      VGTW_CHECK(size == 0 || keypoint_idx < size,
                 "a match names keypoint " + std::to_string(keypoint_idx) + " of image " +
                     std::to_string(image_ids_[image_idx]) + ", which has " + std::to_string(size));
    }
  }

  void AddKeypointsOf(const PairMatches& pair) {
    const std::array<size_t, 2> image_idxs = {ImageIdx(pair.image_id1), ImageIdx(pair.image_id2)};
    for (const auto& match : pair.matches) {
      for (const size_t k : {0, 1}) CheckIdx(image_idxs[k], match[k]);
      if (IsExcluded(images_[image_idxs[0]], match[0])) continue;
      if (IsExcluded(images_[image_idxs[1]], match[1])) continue;
      for (const size_t k : {0, 1}) keypoint_idxs_[image_idxs[k]].push_back(match[k]);
    }
  }

  std::vector<ImageId> image_ids_;
  std::vector<const TrackImage*> images_;  // nullptr where nothing is known
  std::vector<std::vector<uint32_t>> keypoint_idxs_;
  std::vector<size_t> begins_;
};

// For each keypoint in `idxs` the position in it of the one that stands for it.
std::vector<size_t> FindTwins(const TrackImage& image,
                              const std::vector<uint32_t>& idxs,
                              const TrackOptions& options) {
  std::vector<size_t> standing_for(idxs.size());
  std::iota(standing_for.begin(), standing_for.end(), 0);
  std::vector<size_t> by_x = standing_for;
  const auto pixel = [&](size_t k) { return image.pixels[idxs[k]]; };
  std::erase_if(by_x, [&](size_t k) { return !pixel(k).allFinite(); });
  std::sort(by_x.begin(), by_x.end(), [&](size_t a, size_t b) {
    return std::pair(pixel(a).x(), a) < std::pair(pixel(b).x(), b);
  });
  const auto are_twins = [&](size_t a, size_t b) {
    const double scale_a = image.scales[idxs[a]];
    const double scale_b = image.scales[idxs[b]];
    return (pixel(a) - pixel(b)).norm() <= options.max_twin_distance_px &&
           std::max(scale_a, scale_b) <= options.max_twin_scale_factor * std::min(scale_a, scale_b);
  };
  std::vector<std::pair<size_t, size_t>> twins;  // (first, second), first < second
  size_t begin = 0;
  for (size_t i = 0; i < by_x.size(); ++i) {
    while (pixel(by_x[i]).x() - pixel(by_x[begin]).x() > options.max_twin_distance_px) ++begin;
    for (size_t k = begin; k < i; ++k) {
      if (are_twins(by_x[k], by_x[i])) twins.push_back(std::minmax(by_x[k], by_x[i]));
    }
  }
  // Ascending, so that a keypoint that already has a representative never becomes one: chains of
  // near neighbours would otherwise collapse into one place.
  std::sort(twins.begin(), twins.end());
  for (const auto& [first, second] : twins) {
    if (standing_for[first] == first && standing_for[second] == second) {
      standing_for[second] = first;
    }
  }
  return standing_for;
}

std::vector<Node> FindTwins(const Nodes& nodes, const TrackOptions& options, size_t& num_twins) {
  std::vector<Node> standing_for(nodes.size());
  std::iota(standing_for.begin(), standing_for.end(), 0);
  for (size_t i = 0; i < nodes.NumImages(); ++i) {
    const TrackImage* image = nodes.ImageOf(i);
    if (image == nullptr || image->pixels.empty()) continue;
    const std::vector<size_t> twins = FindTwins(*image, nodes.KeypointsOf(i), options);
    for (size_t k = 0; k < twins.size(); ++k) {
      standing_for[nodes.FirstOf(i) + k] = nodes.FirstOf(i) + static_cast<Node>(twins[k]);
      num_twins += twins[k] != k;
    }
  }
  return standing_for;
}

// Distinct edges, ascending by their nodes.
std::vector<Edge> MakeEdges(const std::vector<PairMatches>& pairs,
                            const Nodes& nodes,
                            const std::vector<Node>& standing_for,
                            size_t& num_excluded_matches) {
  size_t num_matches = 0;
  for (const PairMatches& pair : pairs) num_matches += pair.matches.size();
  std::vector<Edge> edges;
  edges.reserve(num_matches);
  for (const PairMatches& pair : pairs) {
    const size_t image_idx1 = nodes.ImageIdx(pair.image_id1);
    const size_t image_idx2 = nodes.ImageIdx(pair.image_id2);
    for (const auto& [idx1, idx2] : pair.matches) {
      if (IsExcluded(nodes.ImageOf(image_idx1), idx1) ||
          IsExcluded(nodes.ImageOf(image_idx2), idx2)) {
        ++num_excluded_matches;
        continue;
      }
      const auto [a, b] = std::minmax(
          {standing_for[nodes.Find(image_idx1, idx1)], standing_for[nodes.Find(image_idx2, idx2)]});
      edges.push_back({a, b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::pair(x.a, x.b) < std::pair(y.a, y.b);
  });
  const auto same_nodes = [](const Edge& x, const Edge& y) { return x.a == y.a && x.b == y.b; };
  edges.erase(std::unique(edges.begin(), edges.end(), same_nodes), edges.end());
  return edges;
}

void CountMatchesOfPairs(const Nodes& nodes, std::vector<Edge>& edges) {
  const std::vector<uint32_t> image_idxs = nodes.ImageIdxs();
  std::vector<uint32_t> nums(nodes.NumImages(), 0);  // by the image of b
  for (auto begin = edges.begin(); begin != edges.end();) {
    const auto end = std::find_if(begin, edges.end(), [&](const Edge& edge) {
      return image_idxs[edge.a] != image_idxs[begin->a];
    });
    std::for_each(begin, end, [&](const Edge& edge) { ++nums[image_idxs[edge.b]]; });
    std::for_each(
        begin, end, [&](Edge& edge) { edge.num_matches_of_pair = nums[image_idxs[edge.b]]; });
    std::for_each(begin, end, [&](const Edge& edge) { nums[image_idxs[edge.b]] = 0; });
    begin = end;
  }
}

// Up to kEnoughConfirmations: more make no match more certain, and long tracks have many.
uint32_t CountCommon(std::span<const Node> x, std::span<const Node> y) {
  uint32_t num_common = 0;
  for (size_t i = 0, j = 0; i < x.size() && j < y.size() && num_common < kEnoughConfirmations;) {
    num_common += x[i] == y[j];
    const bool advance_x = x[i] <= y[j];
    j += y[j] <= x[i];
    i += advance_x;
  }
  return num_common;
}

// Neighbours of node n lie, ascending, in [begins[n], begins[n + 1]) of one list.
void CountConfirmations(size_t num_nodes, std::vector<Edge>& edges) {
  std::vector<size_t> begins(num_nodes + 2, 0);
  for (const Edge& edge : edges) {
    ++begins[edge.a + 2];
    ++begins[edge.b + 2];
  }
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  std::vector<Node> neighbours(2 * edges.size());
  // Edges ascend, so that each node first meets the smaller of its neighbours, then the larger.
  for (const Edge& edge : edges) neighbours[begins[edge.b + 1]++] = edge.a;
  for (const Edge& edge : edges) neighbours[begins[edge.a + 1]++] = edge.b;
  const auto neighbours_of = [&](Node node) {
    return std::span(neighbours).subspan(begins[node], begins[node + 1] - begins[node]);
  };
  for (Edge& edge : edges) {
    edge.num_confirmations = CountCommon(neighbours_of(edge.a), neighbours_of(edge.b));
  }
}

// Disjoint sets of nodes, none with two nodes of one image.
class Components {
 public:
  explicit Components(const Nodes& nodes)
      : sets_(nodes.size()),
        next_(nodes.size()),
        image_idxs_(nodes.ImageIdxs()),
        visit_of_image_(nodes.NumImages(), 0) {
    std::iota(next_.begin(), next_.end(), 0);
  }

  Node RootOf(Node node) { return sets_.Find(node); }

  // False if the two sets hold keypoints of one image.
  bool Join(Node a, Node b) {
    const auto [first, second] = std::minmax({RootOf(a), RootOf(b)});
    if (first == second) return true;
    ++visit_;
    bool shares_image = false;
    ForEach(first, [&](Node node) { visit_of_image_[image_idxs_[node]] = visit_; });
    ForEach(second,
            [&](Node node) { shares_image |= visit_of_image_[image_idxs_[node]] == visit_; });
    if (shares_image) return false;
    sets_.Join(first, second);
    std::swap(next_[first], next_[second]);  // two rings become one
    return true;
  }

 private:
  template <typename Visit>
  void ForEach(Node root, const Visit& visit) const {
    Node node = root;
    do {
      visit(node);
      node = next_[node];
    } while (node != root);
  }

  DisjointSets<Node> sets_;
  std::vector<Node> next_;  // each set is a ring
  std::vector<uint32_t> image_idxs_;
  std::vector<uint64_t> visit_of_image_;
  uint64_t visit_ = 0;
};

std::vector<std::vector<TrackElement>> ListTracks(const Nodes& nodes,
                                                  const std::vector<Node>& standing_for,
                                                  Components& components,
                                                  size_t min_track_length) {
  std::vector<uint32_t> lengths(nodes.size(), 0);
  for (Node node = 0; node < nodes.size(); ++node) {
    lengths[components.RootOf(node)] += standing_for[node] == node;
  }
  constexpr auto kNone = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> track_of_root(nodes.size(), kNone);
  std::vector<std::vector<TrackElement>> tracks;
  for (size_t i = 0; i < nodes.NumImages(); ++i) {
    for (size_t k = 0; k < nodes.KeypointsOf(i).size(); ++k) {
      const Node node = nodes.FirstOf(i) + static_cast<Node>(k);
      if (standing_for[node] != node) continue;
      const Node root = components.RootOf(node);
      if (lengths[root] < min_track_length) continue;
      if (track_of_root[root] == kNone) {
        track_of_root[root] = static_cast<uint32_t>(tracks.size());
        tracks.emplace_back().reserve(lengths[root]);
      }
      tracks[track_of_root[root]].push_back({nodes.IdOf(i), nodes.KeypointsOf(i)[k]});
    }
  }
  return tracks;
}

}  // namespace

void TrackOptions::Check() const {
  VGTW_CHECK(
      min_track_length >= 2,
      "TrackOptions::min_track_length = " + std::to_string(min_track_length) + ", must be >= 2");
  VGTW_CHECK(max_twin_distance_px >= 0.0 && max_twin_distance_px <= 10.0,
             "TrackOptions::max_twin_distance_px = " + std::to_string(max_twin_distance_px) +
                 ", must be in [0, 10]");
  VGTW_CHECK(max_twin_scale_factor >= 1.0 && max_twin_scale_factor <= 2.0,
             "TrackOptions::max_twin_scale_factor = " + std::to_string(max_twin_scale_factor) +
                 ", must be in [1, 2]");
}

Tracks BuildTracks(const std::vector<PairMatches>& pairs,
                   const std::map<ImageId, TrackImage>& images,
                   const TrackOptions& options) {
  options.Check();
  Tracks result;
  TrackSummary& summary = result.summary;
  const Nodes nodes(pairs, images);
  const std::vector<Node> standing_for = FindTwins(nodes, options, summary.num_twins);
  std::vector<Edge> edges = MakeEdges(pairs, nodes, standing_for, summary.num_excluded_matches);
  summary.num_matches = edges.size();
  CountMatchesOfPairs(nodes, edges);
  CountConfirmations(nodes.size(), edges);
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::tuple(y.num_confirmations, y.num_matches_of_pair, x.a, x.b) <
           std::tuple(x.num_confirmations, x.num_matches_of_pair, y.a, y.b);
  });
  Components components(nodes);
  for (const Edge& edge : edges) summary.num_refused_matches += !components.Join(edge.a, edge.b);
  result.tracks =
      ListTracks(nodes, standing_for, components, static_cast<size_t>(options.min_track_length));
  for (const auto& track : result.tracks) summary.num_observations += track.size();
  return result;
}

}  // namespace vgtw
