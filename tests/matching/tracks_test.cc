// SPDX-License-Identifier: BSD-3-Clause
#include "matching/tracks.h"

#include "scene/random.h"

#include <algorithm>
#include <limits>
#include <set>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Track = std::vector<TrackElement>;

TEST(BuildTracks, JoinsMatchesThatShareKeypoints) {
  const Tracks result = BuildTracks({{1, 2, {{5, 6}, {1, 1}}}, {3, 2, {{7, 6}}}, {8, 9, {{0, 0}}}});
  EXPECT_THAT(
      result.tracks,
      ElementsAre(Track{{1, 1}, {2, 1}}, Track{{1, 5}, {2, 6}, {3, 7}}, Track{{8, 0}, {9, 0}}));
  EXPECT_EQ(result.summary.num_matches, 4u);
  EXPECT_EQ(result.summary.num_observations, 7u);
  EXPECT_EQ(result.summary.num_refused_matches, 0u);
}

TEST(BuildTracks, LeavesOutShortTracks) {
  const std::vector<PairMatches> pairs = {{1, 2, {{5, 6}, {1, 1}}}, {3, 2, {{7, 6}}}};
  EXPECT_THAT(BuildTracks(pairs, {}, {.min_track_length = 3}).tracks,
              ElementsAre(Track{{1, 5}, {2, 6}, {3, 7}}));
}

TEST(BuildTracks, NothingInNothingOut) {
  EXPECT_THAT(BuildTracks({}).tracks, IsEmpty());
  EXPECT_THAT(BuildTracks({{1, 2, {}}}).tracks, IsEmpty());
}

// Two triangles over images 1, 2, 3 and a wrong match 1:0 - 2:1 between them. It is named first,
// and its pair has the most matches; what refuses it is that no third keypoint confirms it.
TEST(BuildTracks, TripletsOutweighAWrongMatch) {
  const Tracks result = BuildTracks({{1, 2, {{0, 1}, {0, 0}, {1, 1}, {8, 8}, {9, 9}}},
                                     {2, 3, {{0, 0}, {1, 1}}},
                                     {1, 3, {{0, 0}, {1, 1}}}},
                                    {},
                                    {.min_track_length = 3});
  EXPECT_THAT(result.tracks,
              ElementsAre(Track{{1, 0}, {2, 0}, {3, 0}}, Track{{1, 1}, {2, 1}, {3, 1}}));
  EXPECT_EQ(result.summary.num_refused_matches, 1u);
}

// A chain 1:0 - 2:0 - 3:0 - 1:1 without triplets: one of its matches is wrong. The pair (1, 3) has
// fewer matches than the others and loses.
TEST(BuildTracks, LargerPairsOutweighSmallerOnes) {
  const Tracks result =
      BuildTracks({{1, 3, {{1, 0}}}, {2, 3, {{0, 0}, {5, 5}}}, {1, 2, {{0, 0}, {6, 6}}}},
                  {},
                  {.min_track_length = 3});
  EXPECT_THAT(result.tracks, ElementsAre(Track{{1, 0}, {2, 0}, {3, 0}}));
  EXPECT_EQ(result.summary.num_refused_matches, 1u);
}

TEST(BuildTracks, ExcludedKeypointsTakeNoPart) {
  std::map<ImageId, TrackImage> images;
  images[2].is_excluded = {false, true};
  const Tracks result =
      BuildTracks({{1, 2, {{0, 0}, {1, 1}}}, {2, 3, {{1, 1}, {0, 0}}}, {1, 3, {{1, 1}}}}, images);
  EXPECT_THAT(result.tracks, ElementsAre(Track{{1, 0}, {2, 0}, {3, 0}}, Track{{1, 1}, {3, 1}}));
  EXPECT_EQ(result.summary.num_excluded_matches, 2u);
  EXPECT_EQ(result.summary.num_matches, 3u);
}

// Keypoints 0 and 2 of image 1 are one place in two orientations; 1 has the place, but another
// scale. Image 2 sees orientation 0, image 3 orientation 2.
TEST(BuildTracks, TwinsAreOneKeypoint) {
  const std::vector<PairMatches> pairs = {{1, 2, {{0, 0}, {1, 1}}}, {1, 3, {{2, 0}}}};
  const std::vector<Eigen::Vector2f> pixels = {{10, 20}, {10, 20}, {10, 20}, {50, 20}};
  const std::vector<float> scales = {2.0f, 3.0f, 2.0f, 2.0f};
  const std::map<ImageId, TrackImage> images = {{1, {{}, pixels, scales}}};
  const Tracks result = BuildTracks(pairs, images);
  EXPECT_THAT(result.tracks, ElementsAre(Track{{1, 0}, {2, 0}, {3, 0}}, Track{{1, 1}, {2, 1}}));
  EXPECT_EQ(result.summary.num_twins, 1u);
  EXPECT_EQ(BuildTracks(pairs).tracks.size(), 3u);
}

// Neighbours at 0, 0.08 and 0.16 px: the third is a twin of the second, not of the first, which the
// second stands with. Else a row of keypoints would shrink to one place.
TEST(BuildTracks, TwinsDoNotChain) {
  const std::vector<Eigen::Vector2f> pixels = {{10, 20}, {10.08f, 20}, {10.16f, 20}};
  const std::vector<float> scales = {2.0f, 2.0f, 2.0f};
  const std::map<ImageId, TrackImage> images = {{1, {{}, pixels, scales}}};
  const Tracks result = BuildTracks({{1, 2, {{0, 0}, {1, 1}, {2, 2}}}}, images);
  EXPECT_EQ(result.summary.num_twins, 1u);
  // The place of 0 and 1 cannot be at two places of image 2.
  EXPECT_EQ(result.summary.num_refused_matches, 1u);
  EXPECT_THAT(result.tracks, ElementsAre(Track{{1, 0}, {2, 0}}, Track{{1, 2}, {2, 2}}));
}

TEST(BuildTracks, IndicesMayBeAnything) {
  constexpr uint32_t kLast = std::numeric_limits<uint32_t>::max();
  EXPECT_THAT(BuildTracks({{kLast, 0, {{kLast, kLast}}}}).tracks,
              ElementsAre(Track{{0, kLast}, {kLast, kLast}}));
}

TEST(BuildTracks, RefusesWhatCannotBe) {
  EXPECT_THROW(BuildTracks({{4, 4, {{0, 1}}}}), std::invalid_argument);
  std::map<ImageId, TrackImage> images;
  images[2].is_excluded = {false, false};
  EXPECT_THROW(BuildTracks({{1, 2, {{0, 2}}}}, images), std::invalid_argument);
  EXPECT_THROW(BuildTracks({}, {}, {.min_track_length = 1}), std::invalid_argument);
  EXPECT_THROW(BuildTracks({}, {}, {.max_twin_scale_factor = 0.9}), std::invalid_argument);
  EXPECT_THROW(BuildTracks({}, {}, {.max_twin_distance_px = -1.0}), std::invalid_argument);
}

// Matches of random keypoints between random images, consistent with nothing.
std::vector<PairMatches> RandomPairs(uint64_t seed) {
  RandomStream random(HashKey({seed, 1}));
  const auto draw = [&](uint32_t end) { return static_cast<uint32_t>(random.Uniform() * end); };
  std::vector<PairMatches> pairs(1 + draw(30));
  for (PairMatches& pair : pairs) {
    pair.image_id1 = draw(10);
    pair.image_id2 = (pair.image_id1 + 1 + draw(9)) % 10;
    pair.matches.resize(draw(20));
    for (auto& match : pair.matches) {
      match[0] = draw(12);
      match[1] = draw(12);
    }
  }
  return pairs;
}

std::set<std::pair<TrackElement, TrackElement>> BothWays(const std::vector<PairMatches>& pairs) {
  std::set<std::pair<TrackElement, TrackElement>> edges;
  for (const PairMatches& pair : pairs) {
    for (const auto& [idx1, idx2] : pair.matches) {
      const TrackElement a{pair.image_id1, idx1};
      const TrackElement b{pair.image_id2, idx2};
      edges.insert({a, b});
      edges.insert({b, a});
    }
  }
  return edges;
}

// Elements of the track that its first one reaches over matches inside the track.
size_t NumReached(const Track& track,
                  const std::set<std::pair<TrackElement, TrackElement>>& edges) {
  std::vector<TrackElement> reached = {track.front()};
  std::set<TrackElement> open(track.begin() + 1, track.end());
  for (size_t i = 0; i < reached.size(); ++i) {
    for (auto next = open.begin(); next != open.end();) {
      if (edges.contains({reached[i], *next})) {
        reached.push_back(*next);
        next = open.erase(next);
      } else {
        ++next;
      }
    }
  }
  return reached.size();
}

TEST(BuildTracks, LawsHoldOnRandomGraphs) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    const std::vector<PairMatches> pairs = RandomPairs(seed);
    const auto edges = BothWays(pairs);
    const Tracks result = BuildTracks(pairs);
    std::set<TrackElement> seen;
    std::map<TrackElement, const Track*> track_of;
    for (const Track& track : result.tracks) {
      std::set<ImageId> image_ids;
      for (const TrackElement& element : track) {
        EXPECT_TRUE(seen.insert(element).second) << "in two tracks";
        EXPECT_TRUE(image_ids.insert(element.image_id).second) << "twice in one image";
        track_of[element] = &track;
      }
      EXPECT_TRUE(std::is_sorted(track.begin(), track.end()));
      EXPECT_EQ(NumReached(track, edges), track.size()) << "not connected";
    }
    EXPECT_TRUE(std::is_sorted(result.tracks.begin(), result.tracks.end()));
    EXPECT_EQ(result.summary.num_observations, seen.size());
    EXPECT_EQ(result.summary.num_matches, edges.size() / 2);
    // What is not joined could not be: no match is left between tracks that share no image.
    size_t num_open = 0;
    for (const auto& [a, b] : edges) {
      const Track track_a = track_of.contains(a) ? *track_of[a] : Track{a};
      const Track track_b = track_of.contains(b) ? *track_of[b] : Track{b};
      if (track_a == track_b) continue;
      ++num_open;
      std::set<ImageId> image_ids;
      for (const Track& track : {track_a, track_b}) {
        for (const TrackElement& element : track) image_ids.insert(element.image_id);
      }
      EXPECT_LT(image_ids.size(), track_a.size() + track_b.size());
    }
    EXPECT_EQ(result.summary.num_refused_matches, num_open / 2);
  }
}

void Shuffle(RandomStream& random, auto& list) {
  for (size_t i = list.size(); i > 1; --i) {
    std::swap(list[i - 1], list[static_cast<size_t>(random.Uniform() * static_cast<double>(i))]);
  }
}

TEST(BuildTracks, OrderAndRepetitionDoNotMatter) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    std::vector<PairMatches> pairs = RandomPairs(seed);
    const auto tracks = BuildTracks(pairs).tracks;
    RandomStream random(HashKey({seed, 2}));
    for (PairMatches& pair : pairs) {
      Shuffle(random, pair.matches);
      if (!pair.matches.empty()) pair.matches.push_back(pair.matches.front());
      if (random.Uniform() < 0.5) continue;
      std::swap(pair.image_id1, pair.image_id2);
      for (auto& match : pair.matches) std::swap(match[0], match[1]);
    }
    pairs.push_back(pairs.front());
    Shuffle(random, pairs);
    EXPECT_EQ(BuildTracks(pairs).tracks, tracks) << seed;
  }
}

struct World {
  std::vector<PairMatches> pairs;
  std::vector<Track> tracks;
};

// 200 tracks: keypoint t of images that are drawn for it, each pair matched with probability 0.7,
// kept if every match lies in a triplet. `num_wrong` wrong matches are added.
World MakeWorld(uint64_t seed, int num_wrong) {
  constexpr uint32_t kNumImages = 12;
  constexpr uint32_t kNumTracks = 200;
  RandomStream random(HashKey({seed, 3}));
  World world;
  std::map<std::pair<ImageId, ImageId>, FeatureMatches> matches;
  for (uint32_t t = 0; t < kNumTracks; ++t) {
    Track track;
    for (ImageId image_id = 0; image_id < kNumImages; ++image_id) {
      if (random.Uniform() < 0.6) track.push_back({image_id, t});
    }
    std::vector<PairMatches> pairs;
    for (size_t i = 0; i < track.size(); ++i) {
      for (size_t k = i + 1; k < track.size(); ++k) {
        if (random.Uniform() < 0.7)
          pairs.push_back({track[i].image_id, track[k].image_id, {{t, t}}});
      }
    }
    const auto edges = BothWays(pairs);
    const bool in_triplets = std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
      return std::any_of(track.begin(), track.end(), [&](const TrackElement& third) {
        return edges.contains({edge.first, third}) && edges.contains({third, edge.second});
      });
    });
    if (track.size() < 4 || !in_triplets || NumReached(track, edges) < track.size()) continue;
    world.tracks.push_back(track);
    for (const PairMatches& pair : pairs) {
      matches[{pair.image_id1, pair.image_id2}].push_back({t, t});
    }
  }
  for (int w = 0; w < num_wrong; ++w) {
    const auto draw_track = [&]() -> const Track& {
      return world
          .tracks[static_cast<size_t>(random.Uniform() * static_cast<double>(world.tracks.size()))];
    };
    const Track& track1 = draw_track();
    const Track& track2 = draw_track();
    const TrackElement a = track1.front();
    const TrackElement b = track2.back();
    if (a.image_id >= b.image_id || a.point2D_idx == b.point2D_idx) continue;
    matches[{a.image_id, b.image_id}].push_back({a.point2D_idx, b.point2D_idx});
  }
  for (const auto& [ids, of_pair] : matches)
    world.pairs.push_back({ids.first, ids.second, of_pair});
  std::sort(world.tracks.begin(), world.tracks.end());
  return world;
}

// Tracks of 4 to 12 of 12 images share one nearly always, so that joining two is refused, provided
// that the right matches come first. Plain union-find would put most of the 142 tracks into one.
TEST(BuildTracks, ConfirmedTracksSurviveWrongMatches) {
  size_t num_tracks = 0;
  size_t num_surviving = 0;
  size_t num_refused = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    EXPECT_EQ(BuildTracks(MakeWorld(seed, 0).pairs).tracks, MakeWorld(seed, 0).tracks);
    const World world = MakeWorld(seed, 60);
    const Tracks built = BuildTracks(world.pairs);
    num_refused += built.summary.num_refused_matches;
    for (const Track& track : world.tracks) {
      ++num_tracks;
      num_surviving += std::binary_search(built.tracks.begin(), built.tracks.end(), track);
    }
  }
  EXPECT_GT(num_refused, 300u);
  // Lost are only pairs of tracks that share no image, which nothing in the matches tells apart.
  EXPECT_GE(num_surviving, num_tracks * 99 / 100);
}

}  // namespace
}  // namespace vgtw
