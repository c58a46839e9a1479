#include "krot/bridge/certificate_verdict.h"

#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "krot/bridge/model_digest.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

// How far u and J of another implementation may be from ours, relative.
constexpr double kRayTolerance = 1e-9;

std::string NameOf(const CertificateFile::SupportObservation& o) {
  return "observation " + std::to_string(o.point2D_idx) + " of image " +
         std::to_string(o.image_id);
}

// Also false for NaN.
bool IsSameRay(const CertificateFile::SupportObservation& o,
               const Observation& own) {
  return (RowAtRay(o.u, o.J) - own.E).norm() <= kRayTolerance * own.E.norm();
}

// The certificate in terms of the problem, into which the file's u and J go.
struct Translation {
  std::string refusal;
  bool is_unseen = false;  // the problem has not all of its observations
  Certificate certificate;
};

Translation Translate(const Model& model, const CertificateFile& file,
                      BuiltProblem* built) {
  using Key = std::pair<ImageId, uint32_t>;
  std::map<Key, const CertificateFile::SupportObservation*> by_key;
  Translation translation;
  for (const CertificateFile::SupportObservation& o : file.observations) {
    if (!by_key.emplace(Key(o.image_id, o.point2D_idx), &o).second) {
      translation.refusal = NameOf(o) + " stands there twice";
      return translation;
    }
  }
  translation.certificate.lower_bound = file.lower_bound;
  translation.certificate.defect = file.defect;
  KnownRotationProblem& problem = built->problem;
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    Observation& own = problem.observations[i];
    const auto found =
        by_key.find({model.images[built->image_of[own.view]].id,
                     static_cast<uint32_t>(built->point2D_of[i])});
    if (found == by_key.end()) continue;
    const CertificateFile::SupportObservation& o = *found->second;
    by_key.erase(found);
    if (o.point3D_id != model.points3D[built->point_of[own.point]].id) {
      translation.refusal = NameOf(o) + " is not of point " +
                            std::to_string(o.point3D_id) + " in the model";
    } else if (!IsSameRay(o, own)) {
      translation.refusal = "u or J of " + NameOf(o) + " is not the model's";
    }
    if (!translation.refusal.empty()) return translation;
    own.E = RowAtRay(o.u, o.J);
    translation.certificate.observations.push_back(
        {static_cast<int64_t>(i), o.lambda, o.y});
  }
  if (!by_key.empty()) {
    translation.is_unseen = true;
    translation.refusal = NameOf(*by_key.begin()->second) +
                          " is not among those that can be used";
  }
  return translation;
}

}  // namespace

CertificateVerdict VerifyCertificateFile(const Model& model,
                                         const CertificateFile& file) {
  CertificateVerdict verdict;
  if (file.model_sha256 != ModelSha256(model)) {
    verdict.refusal =
        "it belongs to another model: cameras, rotations or observations "
        "differ";
    return verdict;
  }
  BuiltProblem built = BuildProblem(model, {});
  Translation translation = Translate(model, file, &built);
  if (translation.is_unseen) {
    BuildProblemOptions rays_alone;
    rays_alone.ignore_translations = true;
    built = BuildProblem(model, rays_alone);
    translation = Translate(model, file, &built);
  }
  verdict.refusal = translation.refusal;
  if (!verdict.refusal.empty()) return verdict;

  const CertificateCheck check =
      CheckCertificate(built.problem, file.norm, translation.certificate);
  verdict.refusal = check.refusal;
  if (!check.is_accepted) return verdict;

  verdict.is_accepted = true;
  verdict.lower_bound = check.proved_bound;
  verdict.defect = check.defect;
  const double cost = Cost(built.problem, built.start, file.norm, -1);
  if (std::isfinite(cost)) {
    verdict.cost = cost;
    verdict.relative_gap = (cost - verdict.lower_bound) / cost;
  }
  verdict.support = ListSupport(model, built, built.start, file.norm,
                                translation.certificate);
  return verdict;
}

}  // namespace krot
