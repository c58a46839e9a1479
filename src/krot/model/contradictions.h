#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "krot/model.h"

namespace krot::internal {

// A COLMAP model says twice which 2D points see a 3D point: in the tracks and
// in the images. Scripts write models where the two differ. COLMAP reads them:
// its bundle adjustment takes the images' side, its filters take the tracks'.

struct Contradictions {
  // Whose 2D point names another 3D point or none, does not exist, or is in
  // this track already.
  int64_t num_track_elements = 0;
  // That name a 3D point whose track does not name them, or that there is not.
  int64_t num_points2D = 0;
  std::string first;  // the first of them, as one sentence; "" if none

  // How a side fits the model's own positions: errors of its observations whose
  // images have a pose, pixels; infinite where the point does not project.
  struct Fit {
    double median = 0;
    double max = 0;
  };
  // Set by SettleContradictions, as is `followed`: "tracks", "images", "both"
  // or "neither", "" if not settled. No fit: nothing can be measured.
  std::optional<Fit> of_tracks;
  std::optional<Fit> of_images;
  std::string followed;

  bool Any() const { return num_track_elements > 0 || num_points2D > 0; }
};

// Requires consecutive tracks, as ReadModel leaves them.
// O(size of the model), a few ns per 2D point.
Contradictions FindContradictions(const Model& model);

// Whether a track has two elements. Where none has there is nothing to solve,
// and no side to choose.
bool HasTrack(const Model& model);

// Which of the two says what a 2D point sees.
enum class Reading {
  kTracks,  // the track that names it; of several, the one that it names
            // itself, or else the first
  kImages,  // the 3D point that it names
  kBoth,    // the 3D point that it names or, if it names none, the first whose
            // track names it
};

// Makes a model that does not contradict itself: every 2D point sees at most
// one 3D point, and names it; tracks hold what names them and nothing else. Of
// a track, the elements that stay keep their order; those that it lacked are
// appended in the order of the images. A model without contradictions stays as
// it is. Requires consecutive tracks. O(size of the model).
void Follow(Reading reading, Model* model);

// 2D points name none where their 3D point does not exist.
void DropUnknownPoints3D(Model* model);

// Track elements of images or 2D points that do not exist go; returns their
// number. Requires consecutive tracks.
int64_t DropUnknownPoints2D(Model* model);

}  // namespace krot::internal
