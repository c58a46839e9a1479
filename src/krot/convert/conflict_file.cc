#include "krot/convert/certificate_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "krot/convert/build_problem.h"
#include "krot/convert/certificate_json.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/problem/subset.h"

namespace krot::internal {

ConflictFile DescribeConflicts(
    const Model& model, const BuiltProblem& built, Norm norm, double max_error,
    const std::vector<PixelCertificate>& certificates) {
  ConflictFile file;
  file.norm = norm;
  file.max_error = max_error;
  file.model_sha256 = ModelSha256(model);
  if (!built.scales.empty()) file.version = kConflictFileVersion;
  for (const PixelCertificate& certificate : certificates) {
    ConflictFile::Conflict conflict;
    Describe(model, built, certificate, &conflict);
    if (!built.scales.empty()) {
      for (const CertifiedObservation& o : certificate.rows.observations) {
        conflict.max_errors.push_back(built.scales[o.observation] * max_error);
      }
    }
    file.conflicts.push_back(std::move(conflict));
  }
  return file;
}

std::string ConflictJson(const ConflictFile& file) {
  CertificateFileJson conflicts = CertificateFileJson::array();
  for (const ConflictFile::Conflict& conflict : file.conflicts) {
    conflicts.push_back({{"lower_bound", conflict.lower_bound},
                         {"rows_bound", conflict.rows_bound},
                         {"defect", conflict.defect},
                         {"observations", SupportJson(conflict.observations)}});
    if (file.version == kConflictFileVersion) {
      conflicts.back()["max_errors"] = conflict.max_errors;
    }
  }
  CertificateFileJson json = {{"version", file.version},
                              {"norm", NormJson(file.norm)},
                              {"max_error", file.max_error},
                              {"model_sha256", file.model_sha256}};
  json["conflicts"] = std::move(conflicts);
  return json.dump(1) + "\n";
}

bool HoldsConflicts(const std::string& json) {
  return HasMember(json, "conflicts");
}

ConflictFile ParseConflicts(const std::string& text,
                            const std::string& file_name) {
  return ParseFile(text, file_name, [](const PlacedJson& json) {
    ConflictFile file;
    file.version = ReadVersion(json, 1, kConflictFileVersion);
    file.norm = ReadNorm(json["norm"]);
    file.max_error = json["max_error"].Number();
    file.model_sha256 = json["model_sha256"].String();
    for (const PlacedJson& one : json["conflicts"].Elements()) {
      ConflictFile::Conflict& conflict = file.conflicts.emplace_back();
      ReadProof(one, &conflict);
      if (file.version != kConflictFileVersion) continue;
      for (const PlacedJson& bound : one["max_errors"].Elements()) {
        conflict.max_errors.push_back(bound.Number());
      }
    }
    return file;
  });
}

namespace {

using Support = CertificateFile::SupportObservation;

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
  if (file.model_sha256 != ModelSha256(model)) {
    return refused(
        "it belongs to another model: cameras, rotations or observations "
        "differ");
  }
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
    return refused(
        "observation " + std::to_string(missing->observation->point2D_idx) +
        " of image " + std::to_string(missing->observation->image_id) + " in " +
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
