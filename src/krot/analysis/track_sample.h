// A sample of what cameras see, to ask in which conventions they are written.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "krot/check.h"
#include "krot/geometry/transform.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// What is asked of images of reference sensors (which are all, but for rigs
// with several sensors) and of others; none: to be left out.
struct Roles {
  struct Role {
    bool is_anchor = false, is_asked = false;
  };
  std::optional<Role> of_references, of_others;
};
inline constexpr Roles kReferencesAlone = {{{true, true}}, {}};
inline constexpr Roles kOthersAtReferences = {{{true, false}}, {{false, true}}};
inline constexpr Roles kOthers = {{{true, false}}, {{true, true}}};

// A sample of a model's tracks, or of a database's matches, seen by cameras in
// other conventions than the model's.
class TrackSample {
 public:
  // Takes matches if there are no tracks. Keeps references.
  TrackSample(const Model& model, const std::vector<ImageGeometry>& geometries,
              const Roles& roles, const Database* database);

  bool has_points() const { return !places_.empty(); }
  bool HasEnough() const;                            // tracks to tell anything
  double largest_px() const { return largest_px_; }  // coordinate of a pixel

  // The median error of the sensor that has the largest; reference sensors are
  // taken together. No error counts more than the largest coordinate of a
  // pixel, and that of a point that is not in front of its camera as much.
  double MedianErrorWhereSeen(const Conventions& from) const {
    return MedianErrorWhereSeen(from, LensesIn(from));
  }
  // With the model's points; where there are none, where they are seen.
  double MedianErrorWithPoints(const Conventions& from) const;

  // How far the 2D points are from the upper left corner, in the median, where
  // the principal points are 1: a geometric mean of both axes.
  double MedianPlace(const Conventions& from) const;

  // Sets the median errors of all, which have the same lenses and pixels.
  void Measure(std::vector<Conventions>* all, const Context& context) const;

  // Adds to `all`, which have the same lenses, each with other translations of
  // its sensors: so much longer that, in the median, rays of other sensors pass
  // their points where references see them.
  void AddWithRigFactors(std::vector<Conventions>* all) const;

 private:
  struct Sight {
    int32_t image = -1;
    Eigen::Vector2d pixel;
    bool is_anchor = true;  // takes part in where its track's point is
    bool is_asked = true;   // its error counts
  };
  struct Lenses {
    std::vector<Camera> cameras;
    // Of all tracks' pixels, in camera axes; none where the lens has none.
    std::vector<std::vector<std::optional<Eigen::Vector3d>>> bearings;
  };

  void TakeTracks();
  void TakeMatches(const Database& database);
  std::optional<Roles::Role> RoleOf(int32_t image) const;
  bool TakeIfTells(std::vector<Sight> track);
  void AddSight(int32_t image, const Eigen::Vector2d& pixel,
                std::vector<Sight>* track) const;

  // 1 if nothing tells it.
  double RigFactor(const Conventions& from, const Lenses& lenses) const;
  // Of a sensor that is not its rig's reference.
  RigidTransform SensorOf(int32_t image, const Conventions& from) const;
  // Of the images that see tracks; all others are left at the identity.
  std::vector<RigidTransform> Poses(const Conventions& from) const;
  std::vector<Camera> Cameras(const Conventions& from) const;
  Lenses LensesIn(const Conventions& from) const;
  std::optional<Eigen::Vector3d> PlaceOf(
      size_t k, const std::vector<RigidTransform>& poses,
      const Lenses& lenses) const;
  double MedianErrorWhereSeen(const Conventions& from,
                              const Lenses& lenses) const;
  template <typename PlaceOfTrack>
  double MedianError(const Conventions& from,
                     const std::vector<Camera>& cameras,
                     const std::vector<RigidTransform>& poses,
                     const PlaceOfTrack& place_of) const;

  const Model& model_;
  const std::vector<ImageGeometry>& geometries_;
  const Roles roles_;
  std::vector<std::vector<Sight>> tracks_;
  std::set<int32_t> images_;  // that see them
  double largest_px_ = 0;
  std::vector<Eigen::Vector3d> places_;  // the model's points; none for matches
};

struct PixelMaps {
  std::optional<Conventions> conventions;  // none without maps
  // Another size or axes of all photos, or the poses of sensors in rigs, may
  // explain them as well.
  bool may_be_other = false;
};
// The maps that explain where images have the model's points, better than any
// one move of their cameras does. O(observations).
PixelMaps FindPixelMaps(
    const Model& model, const std::vector<ImageGeometry>& geometries,
    const Context& context);

}  // namespace krot::internal
