#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/certificate.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/solve.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// Where ranks share a model's points: those that some observations see, with
// all that proofs need of them, on the first rank. Numbers "in the whole" count
// through the ranks' observations, one rank's after another's.
struct GatheredSupport {
  Model model;         // without 2D points and tracks
  BuiltProblem built;  // all frames and views
  Estimate estimate;
  std::vector<int64_t> in_whole;      // per observation, ascending
  std::vector<int64_t> observations;  // those that were asked for, likewise

  int64_t Find(int64_t number) const;  // of one in the whole
  // A certificate's observations by what they are called here, and back.
  Certificate FromWhole(Certificate certificate) const;
  Certificate ToWhole(Certificate certificate) const;
};

// Of `observations`, this rank's own, ascending. All ranks call it; on others
// than the first the result has no points.
GatheredSupport GatherSupport(const Model& model, const BuiltProblem& built,
                              const Estimate& estimate,
                              const std::vector<int64_t>& observations,
                              Ranks* ranks);

// Which of its `num_observations` the first rank's certificate names in the
// whole, on every rank; ascending.
std::vector<int64_t> OwnSupport(const Certificate& certificate,
                                int64_t num_observations, Ranks* ranks);

// Those of a certificate, whose rows those of built.problem are, with the
// largest share first.
std::vector<SupportPosition> ListSupportPositions(
    const Model& model, const BuiltProblem& built, const Estimate& estimate,
    const PixelCertificate& certificate);

// The observations in the support of a certificate of built.problem, worst
// first.
std::vector<SupportObservation> ListSupport(const Model& model,
                                            const BuiltProblem& built,
                                            const Estimate& estimate, Norm norm,
                                            const Certificate& certificate);

inline constexpr int kCertificateVersion = 2;

// A certificate of a bound in true pixels (pixel_certificate.h), in terms of
// the model's ids: what is written to a file, and can be checked by anyone who
// has the model (docs/formats.md).
struct CertificateFile {
  struct SupportObservation {
    ImageId image_id = 0;
    uint32_t point2D_idx = 0;
    Point3DId point3D_id = 0;
    // Where the row is taken, in the camera's frame.
    Eigen::Vector3d bearing = Eigen::Vector3d::Zero();
    double lambda = 0;
    Eigen::Vector2d y = Eigen::Vector2d::Zero();
  };

  // What must not move, and where it stands: its position is part of the proof.
  struct FixedImage {
    ImageId image_id = 0;
    Eigen::Vector3d translation;  // rig_from_world, of its frame
  };
  struct FixedPoint {
    Point3DId point3D_id = 0;
    Eigen::Vector3d xyz;
  };

  // Where a camera or a point is known to be, and the rows of that in the
  // support.
  struct Position {
    struct Row {
      Eigen::Vector3d apex;  // p of reprojection.h
      double lambda = 0;
      Eigen::Vector2d y = Eigen::Vector2d::Zero();
    };
    KnownPosition::Of of = KnownPosition::Of::kImage;
    uint64_t id = 0;  // the image's or the point's
    Ellipsoid region;
    std::vector<Row> rows;
  };

  Norm norm;
  double lower_bound = 0;  // true pixels
  double rows_bound = 0;   // delta of the rows, pixels
  double defect = 0;       // of the rows' identities, relative
  std::string model_sha256;
  std::vector<SupportObservation> observations;
  // Of the support; the first image of a frame.
  std::vector<FixedImage> fixed_images;
  std::vector<FixedPoint> fixed_points;
  std::vector<Position> positions;
};

// The observations in its support in terms of the model's ids; `certificate`
// must be one of built.problem.
std::vector<CertificateFile::SupportObservation> DescribeSupport(
    const Model& model, const BuiltProblem& built,
    const PixelCertificate& certificate);

// The same of all of it.
CertificateFile DescribeCertificate(const Model& model,
                                    const BuiltProblem& built, Norm norm,
                                    const PixelCertificate& certificate);

// JSON. Doubles come back with the same bits.
std::string CertificateJson(const CertificateFile& file);

// The inverse. Throws ModelError, naming the file and the place in it, where a
// key is missing or a value is not of its type; says nothing about what the
// certificate proves.
CertificateFile ParseCertificate(const std::string& json,
                                 const std::string& file_name);
// The text of such a file; throws ModelError if it cannot be read or is empty.
std::string ReadCertificateText(const std::filesystem::path& path);
CertificateFile ReadCertificateFile(const std::filesystem::path& path);

// Positions within a radius as the file of a certificate has them.

// Why they are none; empty if they are.
std::string RefusalOfPositions(const Model& model, const CertificateFile& file);

// The same in terms of the model; requires that there is no refusal.
std::vector<KnownPosition> KnownPositionsOf(const Model& model,
                                            const CertificateFile& file);

// Their rows, by what the problem calls them that was built with these. One
// that it does not have, of an image or point without observations in the
// problem, is missed by the proof's balance.
class CertificatePositions {
 public:
  // Keeps references.
  CertificatePositions(const Model& model, const CertificateFile& file,
                       const BuiltProblem& built);

  // That of a position's observation; none if the file has less rows.
  const CertificateFile::Position::Row* RowOf(int64_t observation) const;

 private:
  const BuiltProblem& built_;
  std::vector<const CertificateFile::Position*> positions_;
};

// Accepts if the digest of the model agrees, every observation is one of the
// problem that BuildProblem makes of the model, and CheckPixelCertificate
// accepts the multipliers and bearings. Translations and points do not enter
// into that: where they keep BuildProblem from using an observation of the
// certificate, it ignores them. But what the file takes as fixed has to stand
// where it says, to the bit; and of positions within a radius it speaks as the
// file has them. Requires a valid model; throws what BuildProblem does.
// O(observations), and the check.
CertificateVerdict VerifyCertificateFile(const Model& model,
                                         const CertificateFile& file);

// Version 2: observations have bounds of their own.
inline constexpr int kConflictFileVersion = 2;

// Conflicts without a common observation, in terms of the model's ids: a proof
// that as many observations at least must go for all others to be within a
// bound, or each within its own (docs/formats.md). Each is a certificate
// whose lower bound is above it.
struct ConflictFile {
  struct Conflict {
    double lower_bound = 0;  // true pixels; > max_error
    double rows_bound = 0;   // delta of the rows, pixels
    double defect = 0;       // of the rows' identities, relative
    std::vector<CertificateFile::SupportObservation> observations;
    // Version 2: the bounds of the observations, true pixels; > 0. Those above,
    // and lambda and y, are of errors times the file's max_error over these.
    std::vector<double> max_errors;
  };

  int version = 1;
  Norm norm;
  double max_error = 0;  // the bound, true pixels; version 2: the largest
  std::string model_sha256;
  std::vector<Conflict> conflicts;
};

// `certificates` must be of built.problem. Version 2 if that has scales.
ConflictFile DescribeConflicts(
    const Model& model, const BuiltProblem& built, Norm norm, double max_error,
    const std::vector<PixelCertificate>& certificates);

// JSON. Doubles come back with the same bits.
std::string ConflictJson(const ConflictFile& file);

// Whether a file is one of conflicts, rather than one of a certificate.
bool HoldsConflicts(const std::string& json);

// The inverse of ConflictJson. Throws ModelError as ParseCertificate does, and
// says nothing about what is proved.
ConflictFile ParseConflicts(const std::string& json,
                            const std::string& file_name);

// Accepts if the digest of the model agrees, no observation is in two
// conflicts, and CheckPixelCertificate accepts every one of them with a bound
// above max_error. Translations and points do not enter, as with
// VerifyCertificateFile. Requires a valid model; throws what BuildProblem does.
ConflictVerdict VerifyConflictFile(const Model& model,
                                   const ConflictFile& file);

}  // namespace krot::internal
