#include "krot/convert/certificate_file.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/model/derived_models.h"
#include "krot/model/model_io.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

// What an observation has beside the problem's own data.
struct Sighting {
  Eigen::Vector2d pixel;
  int32_t point2D;
};

}  // namespace

int64_t GatheredSupport::Find(int64_t number) const {
  return std::lower_bound(in_whole.begin(), in_whole.end(), number) -
         in_whole.begin();
}

Certificate GatheredSupport::FromWhole(Certificate certificate) const {
  for (CertifiedObservation& o : certificate.observations) {
    o.observation = Find(o.observation);
  }
  return certificate;
}

Certificate GatheredSupport::ToWhole(Certificate certificate) const {
  for (CertifiedObservation& o : certificate.observations) {
    o.observation = in_whole[o.observation];
  }
  return certificate;
}

GatheredSupport GatherSupport(const Model& model, const BuiltProblem& built,
                              const Estimate& estimate,
                              const std::vector<int64_t>& observations,
                              Ranks* ranks) {
  std::vector<int32_t> points;
  for (const int64_t i : observations) {
    const int32_t k = built.problem.observations[i].point;
    if (points.empty() || points.back() != k) points.push_back(k);
  }
  std::vector<Point3DId> ids;
  std::vector<Sighting> sightings;
  std::vector<int64_t> of_points;
  for (const int32_t k : points) {
    ids.push_back(model.points3D[built.point_of[k]].id);
    for (int64_t i = built.problem.point_begin[k];
         i < built.problem.point_begin[k + 1]; ++i) {
      sightings.push_back({built.pixels[i], built.point2D_of[i]});
      of_points.push_back(i);
    }
  }
  const GatheredPart part(built.problem, of_points, ranks);
  GatheredSupport support;
  support.model = WithoutPoints(model);
  support.built.problem = part.problem();
  support.built.frame_of = built.frame_of;
  support.built.image_of = built.image_of;
  support.estimate = part.Collect(estimate);
  support.in_whole = part.in_whole();
  for (const Point3DId id : ranks->GatherOnFirst(ids)) {
    support.built.point_of.push_back(
        static_cast<int32_t>(support.model.points3D.size()));
    support.model.points3D.emplace_back().id = id;
  }
  for (const Sighting& sighting : ranks->GatherOnFirst(sightings)) {
    support.built.pixels.push_back(sighting.pixel);
    support.built.point2D_of.push_back(sighting.point2D);
  }
  const int64_t first =
      ranks->SumBefore(static_cast<int64_t>(built.problem.observations.size()));
  std::vector<int64_t> numbers;
  for (const int64_t i : observations) numbers.push_back(first + i);
  for (const int64_t number : ranks->GatherOnFirst(numbers)) {
    support.observations.push_back(support.Find(number));
  }
  return support;
}

std::vector<int64_t> OwnSupport(const Certificate& certificate,
                                int64_t num_observations, Ranks* ranks) {
  std::vector<int64_t> numbers;
  for (const CertifiedObservation& o : certificate.observations) {
    numbers.push_back(o.observation);
  }
  ranks->Broadcast(&numbers);
  const int64_t first = ranks->SumBefore(num_observations);
  std::vector<int64_t> own;
  for (const int64_t number : numbers) {
    if (number >= first && number < first + num_observations) {
      own.push_back(number - first);
    }
  }
  return own;
}

namespace {

bool HasImageTwice(const KnownRotationProblem& problem, int32_t point) {
  const int64_t begin = problem.point_begin[point];
  return HasImageTwice(
      &problem.observations[begin],
      static_cast<int>(problem.point_begin[point + 1] - begin));
}

// Everything but the share.
SupportPosition Describe(const Model& model, const BuiltProblem& built,
                         const Estimate& estimate,
                         const BuiltPosition& position) {
  SupportPosition described;
  if (position.of == KnownPosition::Of::kImage) {
    const Image& image = model.images[built.image_of[position.index]];
    described.image_id = image.id;
    described.image_name = image.name;
  } else {
    described.point3D_id = model.points3D[built.point_of[position.index]].id;
  }
  const Eigen::Vector3d offset = OffsetOf(built, estimate, position);
  const double ratio = (position.unit_from_world * offset).norm();
  described.distance = offset.norm();
  described.radius = ratio > 0 ? described.distance / ratio
                               : position.region.semi_axes.minCoeff();
  return described;
}

}  // namespace

std::vector<SupportPosition> ListSupportPositions(
    const Model& model, const BuiltProblem& built, const Estimate& estimate,
    const PixelCertificate& certificate) {
  // By index of the position: the sum of its rows' gradients.
  std::map<int64_t, Eigen::Vector3d> pulls;
  const Certificate& rows = certificate.rows;
  KnownRotationProblem problem = built.problem;
  for (size_t n = 0; n < rows.observations.size(); ++n) {
    const CertifiedObservation& o = rows.observations[n];
    if (built.HasPixel(o.observation) ||
        !PutPositionRow(built, o.observation, certificate.bearings[n],
                        rows.lower_bound, &problem)) {
      continue;
    }
    const Observation& own = problem.observations[o.observation];
    pulls.emplace(PositionOf(built, o.observation), Eigen::Vector3d::Zero())
        .first->second +=
        own.E.transpose() *
        Eigen::Vector3d(rows.lower_bound * o.lambda, o.y[0], o.y[1]);
  }
  double sum = 0;
  for (const auto& [position, pull] : pulls) sum += pull.norm();
  std::vector<SupportPosition> support;
  for (const auto& [n, pull] : pulls) {
    SupportPosition position =
        Describe(model, built, estimate, built.positions[n]);
    position.share = pull.norm() / sum;
    support.push_back(std::move(position));
  }
  SortLargestFirst(&support, &SupportPosition::share);
  return support;
}

std::vector<SupportObservation> ListSupport(const Model& model,
                                            const BuiltProblem& built,
                                            const Estimate& estimate, Norm norm,
                                            const Certificate& certificate) {
  double sum = 0;
  for (const CertifiedObservation& o : certificate.observations) {
    sum += o.lambda;
  }
  std::vector<SupportObservation> support;
  for (const CertifiedObservation& o : certificate.observations) {
    if (!built.HasPixel(o.observation)) continue;
    const Observation& observation = built.problem.observations[o.observation];
    const auto [image_id, point2D_idx, point3D_id] =
        KeyOf(model, built, o.observation);
    support.push_back(
        {image_id, model.images[built.image_of[observation.view]].name,
         point2D_idx, point3D_id, o.lambda / sum,
         ResidualOf(ViewPoint(built.problem, observation, estimate), norm),
         HasImageTwice(built.problem, observation.point)});
  }
  SortLargestFirst(&support, &SupportObservation::error_px);
  return support;
}

std::vector<FoldObservation> ListFolds(const Model& model,
                                       const BuiltProblem& built,
                                       const std::vector<int64_t>& at_folds) {
  std::vector<FoldObservation> folds;
  for (const int64_t i : at_folds) {
    const Image& image =
        model.images[built.image_of[built.problem.observations[i].view]];
    folds.push_back({image.id, image.name,
                     static_cast<uint32_t>(built.point2D_of[i]),
                     image.camera_id});
  }
  return folds;
}

void Describe(const Model& model, const BuiltProblem& built,
              const PixelCertificate& certificate, DescribedProof* proof) {
  proof->lower_bound = certificate.lower_bound;
  proof->rows_bound = certificate.rows.lower_bound;
  proof->defect = certificate.rows.defect;
  for (size_t n = 0; n < certificate.bearings.size(); ++n) {
    const CertifiedObservation& o = certificate.rows.observations[n];
    if (!built.HasPixel(o.observation)) continue;
    const auto [image_id, point2D_idx, point3D_id] =
        KeyOf(model, built, o.observation);
    proof->observations.push_back({image_id, point2D_idx, point3D_id,
                                   certificate.bearings[n], o.lambda, o.y});
  }
}

PixelCertificate WithoutRows(const DescribedProof& proof) {
  PixelCertificate certificate;
  certificate.lower_bound = proof.lower_bound;
  certificate.rows.lower_bound = proof.rows_bound;
  certificate.rows.defect = proof.defect;
  return certificate;
}

ObservationKey KeyOf(const DescribedProof::SupportObservation& o) {
  return {o.image_id, o.point2D_idx, o.point3D_id};
}

ObservationKey KeyOf(const Model& model, const BuiltProblem& built,
                     int64_t observation) {
  const Observation& own = built.problem.observations[observation];
  return {model.images[built.image_of[own.view]].id,
          static_cast<uint32_t>(built.point2D_of[observation]),
          model.points3D[built.point_of[own.point]].id};
}

namespace {

// Lists the fixed images and points in the support.
void DescribeFixed(const Model& model, const BuiltProblem& built,
                   const PixelCertificate& certificate, CertificateFile* file) {
  const KnownRotationProblem& problem = built.problem;
  std::set<int32_t> frames;
  std::set<int32_t> points;
  for (const CertifiedObservation& certified : certificate.rows.observations) {
    if (!built.HasPixel(certified.observation)) continue;
    const Observation& observation =
        problem.observations[certified.observation];
    const int32_t frame = problem.views[observation.view].frame;
    if (problem.IsFixedFrame(frame) && frames.insert(frame).second) {
      file->fixed_images.push_back(
          {model.images[built.image_of[observation.view]].id,
           *problem.fixed_translations[frame]});
    }
    if (problem.IsFixedPoint(observation.point) &&
        points.insert(observation.point).second) {
      file->fixed_points.push_back(
          {model.points3D[built.point_of[observation.point]].id,
           *problem.fixed_points[observation.point]});
    }
  }
}

// Lists the positions in the support. Rows are in ascending order, so the rows
// of one position are next to each other.
void DescribePositions(const Model& model, const BuiltProblem& built,
                       const PixelCertificate& certificate,
                       CertificateFile* file) {
  int64_t last = -1;
  for (size_t n = 0; n < certificate.bearings.size(); ++n) {
    const CertifiedObservation& certified = certificate.rows.observations[n];
    if (built.HasPixel(certified.observation)) continue;
    const int64_t index = PositionOf(built, certified.observation);
    if (index != std::exchange(last, index)) {
      const BuiltPosition& position = built.positions[index];
      file->positions.push_back(
          {position.of, IdOf(model, built, position), position.region, {}});
    }
    file->positions.back().rows.push_back(
        {certificate.bearings[n], certified.lambda, certified.y});
  }
}

}  // namespace

CertificateFile DescribeCertificate(const Model& model,
                                    const BuiltProblem& built, Norm norm,
                                    const PixelCertificate& certificate) {
  CertificateFile file;
  file.norm = norm;
  file.model_sha256 = ModelSha256(model);
  Describe(model, built, certificate, &file);
  DescribeFixed(model, built, certificate, &file);
  DescribePositions(model, built, certificate, &file);
  return file;
}

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

std::string ReadCertificateText(const std::filesystem::path& path) {
  return ReadFileBytes(path).bytes;
}

CertificateFile ReadCertificateFile(const std::filesystem::path& path) {
  return ParseCertificate(ReadCertificateText(path), path.string());
}

}  // namespace krot::internal
