#include "krot/convert/certificate_file.h"

#include <algorithm>
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
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

using Of = KnownPosition::Of;
using OfAndId = std::pair<Of, uint64_t>;
using Support = CertificateFile::SupportObservation;

constexpr char kOtherModel[] =
    "it belongs to another model: cameras, rotations or observations differ";

// The file's positions in terms of the model. If they cannot be used, `refusal`
// says why.
std::vector<KnownPosition> FindPositions(const Model& model,
                                         const CertificateFile& file,
                                         std::string* refusal) {
  const IdIndex<ImageId> image_index(model.images);
  const IdIndex<Point3DId> point_index(model.points3D);
  std::set<OfAndId> seen;
  std::vector<KnownPosition> positions;
  for (const CertificateFile::Position& position : file.positions) {
    const bool is_images = position.of == Of::kImage;
    const std::string what = is_images ? "image" : "3D point";
    const std::string name =
        "the position of " + what + " " + std::to_string(position.id);
    const std::optional<int32_t> index =
        is_images ? image_index.Find(static_cast<ImageId>(position.id))
                  : point_index.Find(position.id);
    if (!index) {
      *refusal = name + " is of no " + what + " of the model";
    } else if (!seen.emplace(position.of, position.id).second) {
      *refusal = name + " stands twice";
    } else if (!IsFit(position.region)) {
      *refusal = name + " has no radius above zero, or is not finite";
    } else if (position.rows.size() > kRowsPerPosition) {
      *refusal =
          name + " has more than " + std::to_string(kRowsPerPosition) + " rows";
    }
    if (!refusal->empty()) break;
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

std::string NameOf(const Support& o) {
  return "observation " + std::to_string(o.point2D_idx) + " of image " +
         std::to_string(o.image_id);
}

// Says why no observation of the problem is left for an entry of the file.
// Several tracks may hold the same 2D point, and a track may hold it twice.
std::string RefusalOfUnused(const Support& o, const Model& model,
                            const BuiltProblem& built) {
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
  std::multimap<ObservationKey, const Support*> by_key;
  for (const Support& o : file.observations) {
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
    const Support& o = *found->second;
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
  if (file.model_sha256 != ModelSha256(original)) verdict.refusal = kOtherModel;
  if (!verdict.refusal.empty()) return verdict;
  FixedClaim fixed = FindFixed(original, file);
  verdict.refusal = fixed.refusal;
  if (!verdict.refusal.empty()) return verdict;
  const std::vector<KnownPosition> positions =
      FindPositions(original, file, &verdict.refusal);
  if (!verdict.refusal.empty()) return verdict;
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

namespace {

// An observation in the file.
struct Entry {
  size_t conflict = 0;  // the conflict that it is in
  size_t place = 0;     // its index in the conflict
  const Support* observation = nullptr;
  int64_t index = -1;  // its index in the problem; -1: not found
};

// Finds the observation of each entry; each observation of the problem is used
// once.
std::vector<Entry> FindEntries(const Model& model, const BuiltProblem& built,
                               const ConflictFile& file) {
  std::vector<Entry> entries;
  std::multimap<ObservationKey, size_t> by_key;
  for (size_t n = 0; n < file.conflicts.size(); ++n) {
    const std::vector<Support>& observations = file.conflicts[n].observations;
    for (size_t place = 0; place < observations.size(); ++place) {
      const Support& o = observations[place];
      by_key.emplace(KeyOf(o), entries.size());
      entries.push_back({n, place, &o});
    }
  }
  const auto count = static_cast<int64_t>(built.problem.observations.size());
  for (int64_t i = 0; i < count; ++i) {
    const auto found = by_key.find(KeyOf(model, built, i));
    if (found == by_key.end()) continue;
    entries[found->second].index = i;
    by_key.erase(found);
  }
  return entries;
}

const Entry* FirstMissing(const std::vector<Entry>& entries) {
  for (const Entry& entry : entries) {
    if (entry.index < 0) return &entry;
  }
  return nullptr;
}

std::string NameOfConflict(size_t n) {
  return "conflict " + std::to_string(n + 1);
}

bool AreBounds(const ConflictFile::Conflict& conflict, double largest) {
  return conflict.max_errors.size() == conflict.observations.size() &&
         std::all_of(conflict.max_errors.begin(), conflict.max_errors.end(),
                     [&](double bound) {
                       return bound > 0 && bound <= (1 + 1e-12) * largest;
                     });
}

// Says why one conflict is refused; none if it is accepted.
std::optional<std::string> RefuseConflict(const Model& model,
                                          const BuiltProblem& built,
                                          const ConflictFile& file, size_t n,
                                          std::vector<Entry> entries) {
  const ConflictFile::Conflict& conflict = file.conflicts[n];
  if (!(conflict.lower_bound > file.max_error)) {
    return NameOfConflict(n) + " has a bound that is not above max_error";
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return a.index < b.index; });
  const bool has_own = file.version == kConflictFileVersion;
  if (has_own && !AreBounds(conflict, file.max_error)) {
    return NameOfConflict(n) +
           " has not one bound per observation, above 0 and at most max_error";
  }
  std::vector<int64_t> observations;
  std::vector<double> scales;
  PixelCertificate certificate = WithoutRows(conflict);
  for (const Entry& entry : entries) {
    certificate.rows.observations.push_back(
        {static_cast<int64_t>(observations.size()), entry.observation->lambda,
         entry.observation->y});
    certificate.bearings.push_back(entry.observation->bearing);
    observations.push_back(entry.index);
    if (has_own) {
      scales.push_back(conflict.max_errors[entry.place] / file.max_error);
    }
  }
  if (observations.empty()) return NameOfConflict(n) + " is empty";
  const ProblemSubset subset(built.problem, std::move(observations));
  BuiltProblem part = BuiltPart(built, subset, built.start);
  ScaleObservations(std::move(scales), &part);
  const PixelCertificateCheck check =
      CheckPixelCertificate(model, part, file.norm, certificate, {});
  if (check.is_accepted) return std::nullopt;
  return NameOfConflict(n) + ": " + check.refusal;
}

}  // namespace

ConflictVerdict VerifyConflictFile(const Model& model,
                                   const ConflictFile& file) {
  ConflictVerdict verdict;
  const auto refused = [&](const std::string& refusal) {
    verdict.refusal = refusal;
    return verdict;
  };
  if (file.model_sha256 != ModelSha256(model)) return refused(kOtherModel);
  if (!(file.max_error > 0) || !std::isfinite(file.max_error)) {
    return refused("its max_error is no positive number");
  }
  BuiltProblem built = BuildProblem(model, {});
  std::vector<Entry> entries = FindEntries(model, built, file);
  if (FirstMissing(entries) != nullptr) {
    BuildProblemOptions rays_alone;
    rays_alone.ignore_translations = true;
    built = BuildProblem(model, rays_alone);
    entries = FindEntries(model, built, file);
  }
  if (const Entry* missing = FirstMissing(entries)) {
    return refused(NameOf(*missing->observation) + " in " +
                   NameOfConflict(missing->conflict) +
                   " is not among those that can be used, or is there twice");
  }
  std::vector<std::vector<Entry>> of_conflict(file.conflicts.size());
  for (const Entry& entry : entries) {
    of_conflict[entry.conflict].push_back(entry);
  }
  for (size_t n = 0; n < of_conflict.size(); ++n) {
    const std::optional<std::string> refusal =
        RefuseConflict(model, built, file, n, std::move(of_conflict[n]));
    if (refusal) return refused(*refusal);
  }
  verdict.is_accepted = true;
  verdict.num_conflicts = static_cast<int64_t>(file.conflicts.size());
  verdict.num_observations = static_cast<int64_t>(entries.size());
  verdict.max_error = file.max_error;
  verdict.has_own_bounds = file.version == kConflictFileVersion;
  return verdict;
}

}  // namespace krot::internal
