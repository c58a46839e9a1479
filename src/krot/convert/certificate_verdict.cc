#include "krot/convert/certificate_file.h"

#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Of = KnownPosition::Of;
using OfAndId = std::pair<Of, uint64_t>;

// Why the file's positions cannot be used; empty if they can.
std::string RefusalOfPositions(const Model& model,
                               const CertificateFile& file) {
  const IdIndex<ImageId> image_index(model.images);
  const IdIndex<Point3DId> point_index(model.points3D);
  std::set<OfAndId> seen;
  for (const CertificateFile::Position& position : file.positions) {
    const bool is_images = position.of == Of::kImage;
    const std::string what = is_images ? "image" : "3D point";
    const std::string name =
        "the position of " + what + " " + std::to_string(position.id);
    if (is_images ? !image_index.Find(static_cast<ImageId>(position.id))
                  : !point_index.Find(position.id)) {
      return name + " is of no " + what + " of the model";
    }
    if (!seen.emplace(position.of, position.id).second) {
      return name + " stands twice";
    }
    if (!IsFit(position.region)) {
      return name + " has no radius above zero, or is not finite";
    }
    if (position.rows.size() > kRowsPerPosition) {
      return name + " has more than " + std::to_string(kRowsPerPosition) +
             " rows";
    }
  }
  return "";
}

// The file's positions in terms of the model; requires that they are not
// refused.
std::vector<KnownPosition> KnownPositionsOf(const Model& model,
                                            const CertificateFile& file) {
  const IdIndex<ImageId> image_index(model.images);
  const IdIndex<Point3DId> point_index(model.points3D);
  std::vector<KnownPosition> positions;
  for (const CertificateFile::Position& position : file.positions) {
    const std::optional<int32_t> index =
        position.of == Of::kImage
            ? image_index.Find(static_cast<ImageId>(position.id))
            : point_index.Find(position.id);
    positions.push_back({position.of, *index, position.region});
  }
  return positions;
}

// Finds the file's rows of known positions for the observations of a problem
// that was built with these positions. The problem has no rows for an image or
// point without observations; if the proof needs them, (1) does not hold and
// the checker refuses it.
class CertificatePositions {
 public:
  // Keeps references.
  CertificatePositions(const Model& model, const CertificateFile& file,
                       const BuiltProblem& built)
      : built_(built) {
    std::map<OfAndId, const CertificateFile::Position*> by_key;
    for (const CertificateFile::Position& position : file.positions) {
      by_key.emplace(OfAndId(position.of, position.id), &position);
    }
    for (const BuiltPosition& position : built.positions) {
      positions_.push_back(
          by_key.at({position.of, IdOf(model, built, position)}));
    }
  }

  // The row of a position's observation; null if the file has fewer rows.
  const CertificateFile::Position::Row* RowOf(int64_t observation) const {
    const CertificateFile::Position& position =
        *positions_[PositionOf(built_, observation)];
    const size_t n = RowIndex(built_, observation) % kRowsPerPosition;
    return n < position.rows.size() ? &position.rows[n] : nullptr;
  }

 private:
  const BuiltProblem& built_;
  std::vector<const CertificateFile::Position*> positions_;
};

std::string NameOf(const CertificateFile::SupportObservation& o) {
  return "observation " + std::to_string(o.point2D_idx) + " of image " +
         std::to_string(o.image_id);
}

// Says why no observation of the problem is left for an entry of the file.
// Several tracks may hold the same 2D point, and a track may hold it twice.
std::string RefusalOfUnused(const CertificateFile::SupportObservation& o,
                            const Model& model, const BuiltProblem& built) {
  bool is_of_another_point = false;
  for (size_t i = 0; i < built.pixels.size(); ++i) {
    const Observation& own = built.problem.observations[i];
    if (!built.HasPixel(static_cast<int64_t>(i)) ||
        static_cast<uint32_t>(built.point2D_of[i]) != o.point2D_idx ||
        model.images[built.image_of[own.view]].id != o.image_id) {
      continue;
    }
    if (model.points3D[built.point_of[own.point]].id == o.point3D_id) {
      return NameOf(o) + " stands there twice";
    }
    is_of_another_point = true;
  }
  return is_of_another_point
             ? NameOf(o) + " is not of point " + std::to_string(o.point3D_id) +
                   " in the model"
             : NameOf(o) + " is not among those that can be used";
}

// The parts of the model that the certificate takes as fixed; refused if they
// have another position in the model.
struct FixedClaim {
  FixedParts parts;
  std::string refusal;
};

FixedClaim FindFixed(const Model& model, const CertificateFile& file) {
  FixedClaim claim;
  if (!file.fixed_images.empty()) {
    claim.parts.frames.assign(model.frames.size(), 0);
  }
  if (!file.fixed_points.empty()) {
    claim.parts.points3D.assign(model.points3D.size(), 0);
  }
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const IdIndex<ImageId> image_index(model.images);
  for (const CertificateFile::FixedImage& fixed : file.fixed_images) {
    const std::optional<int32_t> image = image_index.Find(fixed.image_id);
    const int32_t frame = image ? geometries[*image].frame : -1;
    if (frame < 0 ||
        model.frames[frame].rig_from_world.translation != fixed.translation) {
      claim.refusal = "image " + std::to_string(fixed.image_id) +
                      " is not where the certificate takes it to be fixed";
      return claim;
    }
    claim.parts.frames[frame] = 1;
  }
  const IdIndex<Point3DId> point_index(model.points3D);
  for (const CertificateFile::FixedPoint& fixed : file.fixed_points) {
    const std::optional<int32_t> point = point_index.Find(fixed.point3D_id);
    if (!point || model.points3D[*point].xyz != fixed.xyz) {
      claim.refusal = "point " + std::to_string(fixed.point3D_id) +
                      " is not where the certificate takes it to be fixed";
      return claim;
    }
    claim.parts.points3D[*point] = 1;
  }
  return claim;
}

// The certificate, with the observations of the problem.
struct Translation {
  std::string refusal;
  bool is_unseen = false;  // the problem lacks some of its observations
  PixelCertificate certificate;
};

Translation Translate(const Model& model, const CertificateFile& file,
                      const BuiltProblem& built) {
  std::multimap<ObservationKey, const CertificateFile::SupportObservation*>
      by_key;
  for (const CertificateFile::SupportObservation& o : file.observations) {
    by_key.emplace(KeyOf(o), &o);
  }
  Translation translation;
  translation.certificate = WithoutRows(file);
  Certificate& rows = translation.certificate.rows;
  const CertificatePositions positions(model, file, built);
  const auto count = static_cast<int64_t>(built.problem.observations.size());
  for (int64_t i = 0; i < count; ++i) {
    if (!built.HasPixel(i)) {
      const auto* row = positions.RowOf(i);
      if (row == nullptr) continue;
      translation.certificate.bearings.push_back(row->apex);
      rows.observations.push_back({i, row->lambda, row->y});
      continue;
    }
    const auto found = by_key.find(KeyOf(model, built, i));
    if (found == by_key.end()) continue;
    const CertificateFile::SupportObservation& o = *found->second;
    by_key.erase(found);
    translation.certificate.bearings.push_back(o.bearing);
    rows.observations.push_back({i, o.lambda, o.y});
  }
  if (!by_key.empty()) {
    translation.is_unseen = true;
    translation.refusal =
        RefusalOfUnused(*by_key.begin()->second, model, built);
  }
  return translation;
}

}  // namespace

CertificateVerdict VerifyCertificateFile(const Model& original,
                                         const CertificateFile& file) {
  CertificateVerdict verdict;
  if (file.model_sha256 != ModelSha256(original)) {
    verdict.refusal =
        "it belongs to another model: cameras, rotations or observations "
        "differ";
    return verdict;
  }
  FixedClaim fixed = FindFixed(original, file);
  verdict.refusal = fixed.refusal;
  if (verdict.refusal.empty()) {
    verdict.refusal = RefusalOfPositions(original, file);
  }
  if (!verdict.refusal.empty()) return verdict;
  const std::vector<KnownPosition> positions = KnownPositionsOf(original, file);
  const LocalFrame frame(original, fixed.parts, positions);
  std::optional<Model> local;
  if (!frame.IsModels()) local = frame.ToLocal(original);
  const Model& model = local ? *local : original;
  verdict.num_fixed_images = static_cast<int64_t>(file.fixed_images.size());
  verdict.num_fixed_points = static_cast<int64_t>(file.fixed_points.size());
  BuildProblemOptions build;
  build.fixed = std::move(fixed.parts);
  build.positions = frame.ToLocal(positions);
  BuiltProblem built = BuildProblem(model, build);
  Translation translation = Translate(model, file, built);
  if (translation.is_unseen) {
    build.ignore_translations = true;
    built = BuildProblem(model, build);
    translation = Translate(model, file, built);
  }
  verdict.refusal = translation.refusal;
  if (!verdict.refusal.empty()) return verdict;

  const PixelCertificateCheck check = CheckPixelCertificate(
      model, built, file.norm, translation.certificate, {});
  verdict.is_accepted = check.is_accepted;
  verdict.lower_bound = check.lower_bound;
  verdict.defect = check.defect;
  verdict.refusal = check.refusal;
  if (!verdict.is_accepted) return verdict;

  const double cost =
      Reprojection(model, built).TrueCost(built.start, file.norm, -1);
  if (std::isfinite(cost)) {
    verdict.cost = cost;
    verdict.relative_gap = (cost - verdict.lower_bound) / cost;
  }
  verdict.support = ListSupport(model, built, built.start, file.norm,
                                translation.certificate.rows);
  verdict.positions =
      ListSupportPositions(model, built, built.start, translation.certificate);
  return verdict;
}

}  // namespace krot::internal
