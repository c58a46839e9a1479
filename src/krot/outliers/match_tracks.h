#pragma once

#include <cstdint>

#include "krot/base/context.h"
#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

// Points for a model whose poses are known, from the verified matches of a
// database.

struct MatchTracksOptions {
  double max_error_px = 4;  // of an observation; > 0
  double min_angle_deg =
      1.5;  // between two of a point's rays, the largest; >= 0
  // Whether the model's own tracks count as matches; else they are ignored.
  bool keeps_tracks = false;
};

struct MatchTracksSummary {
  int64_t num_pairs = 0;                // whose matches are used
  int64_t num_contradictory_pairs = 0;  // fewer than a quarter of matches agree
  int64_t num_matches = 0;              // of the pairs used
  int64_t num_disagreeing = 0;  // of these, no point is within max_error_px
  int64_t num_components = 0;   // of images and keypoints that matches join
  int64_t num_image_twice = 0;  // of these, with two keypoints of an image
  int64_t num_in_conflict = 0;  // of these, no point is within max_error_px
  int64_t num_two_views = 0;    // points left out, seen by one match alone
  int64_t num_narrow = 0;       // points left out, below min_angle_deg
  // Observations within max_error_px that noise does not explain, left out.
  int64_t num_more_than_noise = 0;
};

struct MatchTracksResult {
  Model model;
  MatchTracksSummary summary;
};

// As COLMAP's point_triangulator: images whose 2D points are not the database's
// keypoints get these. Pairs of images need 15 matches. A match whose pixels
// must move together by more than sqrt(2) max_error_px to lie on their epipolar
// lines has no point within max_error_px of both, and goes. What the others
// join is a track. Where its l-infinity intersection is within max_error_px of
// all, it is kept as a whole: there is no conflict. Else the point that most of
// it agrees with is found (PlacePointsRobustly); what is within max_error_px of
// that, of every image the nearest, is a track, and the rest is joined anew.
// Each point then moves to the least squares of its track; observations that
// are above max_error_px there, or that noise does not explain (SnoopNoise),
// go. Two keypoints that have no match but each other are left out, since
// nothing checks them.
//
// Throws std::invalid_argument for options out of range, ModelError for cameras
// without an image plane. Requires a valid model; ids of points are
// new, their colours black. The same bits at any number of threads.
// O(matches), some microseconds each.
MatchTracksResult TriangulateMatches(const Model& model,
                                     const Database& database,
                                     const MatchTracksOptions& options,
                                     const Context& context);

}  // namespace krot::internal
