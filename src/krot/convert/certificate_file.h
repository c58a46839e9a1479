#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/certificate.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/database.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/solve.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// For ranks that share a model's points: the points that certain observations
// see, gathered on the first rank with everything that proofs need. Numbers "in
// the whole" count the observations of all ranks, one rank after another.
struct GatheredSupport {
  Model model;         // without 2D points and tracks
  BuiltProblem built;  // all frames and views
  Estimate estimate;
  // Number of each observation in the whole, ascending.
  std::vector<int64_t> in_whole;
  // Indices here of those that were asked for, ascending.
  std::vector<int64_t> observations;

  // Index here of an observation of the whole.
  int64_t Find(int64_t number) const;
  // Renumber a certificate's observations from the whole to here, and back.
  Certificate FromWhole(Certificate certificate) const;
  Certificate ToWhole(Certificate certificate) const;
};

// Gathers `observations`, this rank's own, ascending, with those of all other
// ranks. All ranks must call it; on others than the first one the result has no
// points.
GatheredSupport GatherSupport(const Model& model, const BuiltProblem& built,
                              const Estimate& estimate,
                              const std::vector<int64_t>& observations,
                              Ranks* ranks);

// The first rank has a certificate whose observations are numbered in the
// whole. Returns on every rank which of its own `num_observations` observations
// the certificate names; ascending.
std::vector<int64_t> OwnSupport(const Certificate& certificate,
                                int64_t num_observations, Ranks* ranks);

// The known positions in the support of a certificate of built.problem, largest
// share first.
std::vector<SupportPosition> ListSupportPositions(
    const Model& model, const BuiltProblem& built, const Estimate& estimate,
    const PixelCertificate& certificate);

// The observations in the support of a certificate of built.problem, worst
// first.
std::vector<SupportObservation> ListSupport(const Model& model,
                                            const BuiltProblem& built,
                                            const Estimate& estimate, Norm norm,
                                            const Certificate& certificate);

// Those of PixelCertificate::at_folds.
std::vector<FoldObservation> ListFolds(const Model& model,
                                       const BuiltProblem& built,
                                       const std::vector<int64_t>& at_folds);

// What the files of certificates and of conflicts have in common: the proof of
// a bound in true pixels (pixel_certificate.h) in terms of the model's ids.
struct DescribedProof {
  struct SupportObservation {
    ImageId image_id = 0;
    uint32_t point2D_idx = 0;
    Point3DId point3D_id = 0;
    // The ray at which the row is taken, in the camera's frame.
    Eigen::Vector3d bearing = Eigen::Vector3d::Zero();
    double lambda = 0;
    Eigen::Vector2d y = Eigen::Vector2d::Zero();
  };

  double lower_bound = 0;  // true pixels
  double rows_bound = 0;   // delta of the rows, in pixels
  double defect = 0;  // by how much the rows' multipliers miss (1), relative
  std::vector<SupportObservation> observations;
};

// A certificate. This is what is written to a file; anyone who has the model
// can check it (docs/formats.md).
struct CertificateFile : DescribedProof {
  // Parts that must not move, and their positions, which the proof depends on.
  struct FixedImage {
    ImageId image_id = 0;
    Eigen::Vector3d translation;  // rig_from_world, of its frame
  };
  struct FixedPoint {
    Point3DId point3D_id = 0;
    Eigen::Vector3d xyz;
  };

  // The known position of a camera or a point, and those of its rows that are
  // in the support.
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
  std::string model_sha256;
  // The fixed parts in the support; of a frame its first image there.
  std::vector<FixedImage> fixed_images;
  std::vector<FixedPoint> fixed_points;
  std::vector<Position> positions;
};

// Describes a certificate of built.problem, without its rows of positions.
void Describe(const Model& model, const BuiltProblem& built,
              const PixelCertificate& certificate, DescribedProof* proof);
// The bounds of the inverse; its rows are still to be found in a problem.
PixelCertificate WithoutRows(const DescribedProof& proof);

// Which 2D point an observation is, and of which 3D point.
using ObservationKey = std::tuple<ImageId, uint32_t, Point3DId>;
ObservationKey KeyOf(const DescribedProof::SupportObservation& o);
ObservationKey KeyOf(const Model& model, const BuiltProblem& built,
                     int64_t observation);

// The whole certificate in terms of the model's ids.
CertificateFile DescribeCertificate(const Model& model,
                                    const BuiltProblem& built, Norm norm,
                                    const PixelCertificate& certificate);

// JSON. Doubles are restored with the same bits.
std::string CertificateJson(const CertificateFile& file);

// The inverse of CertificateJson. Throws ModelError, naming the file and the
// place in it, if a key is missing or a value has the wrong type. Does not
// check what the certificate proves.
CertificateFile ParseCertificate(const std::string& json,
                                 const std::string& file_name);
// Reads the text of such a file; throws ModelError if it cannot be read or is
// empty.
std::string ReadCertificateText(const std::filesystem::path& path);
CertificateFile ReadCertificateFile(const std::filesystem::path& path);

// Accepts if the model's digest agrees, every observation is one of the problem
// that BuildProblem makes of the model, and CheckPixelCertificate accepts the
// multipliers and bearings. The model's translations and points do not matter:
// if they prevent BuildProblem from using an observation of the certificate, it
// is called without them. However, what the file takes as fixed must have the
// same position in the model, to the bit; positions within a radius are taken
// from the file. Requires a valid model; throws what BuildProblem does.
// O(observations), and the check.
CertificateVerdict VerifyCertificateFile(const Model& model,
                                         const CertificateFile& file);

// Version 2: observations have bounds of their own.
inline constexpr int kConflictFileVersion = 2;

// Conflicts without common observations, in terms of the model's ids. They
// prove that at least one observation per conflict must be removed before all
// others can be within a bound, or each within its own (docs/formats.md). Each
// conflict is a certificate whose lower bound is above that bound.
struct ConflictFile {
  struct Conflict : DescribedProof {
    // Version 2: the bound of each observation, true pixels; > 0. The bounds
    // above, lambda and y then refer to errors that are multiplied by the
    // file's max_error and divided by the observation's bound.
    std::vector<double> max_errors;
  };

  int version = 1;
  Norm norm;
  double max_error = 0;  // the bound, true pixels; version 2: the largest one
  std::string model_sha256;
  std::vector<Conflict> conflicts;
};

// `certificates` must be of built.problem. The result has version 2 if built
// has scales.
ConflictFile DescribeConflicts(
    const Model& model, const BuiltProblem& built, Norm norm, double max_error,
    const std::vector<PixelCertificate>& certificates);

// JSON. Doubles are restored with the same bits.
std::string ConflictJson(const ConflictFile& file);

// Whether a file holds conflicts, rather than a certificate.
bool HoldsConflicts(const std::string& json);

// The inverse of ConflictJson. Throws ModelError as ParseCertificate does. Does
// not check what is proved.
ConflictFile ParseConflicts(const std::string& json,
                            const std::string& file_name);

// Accepts if the model's digest agrees, no observation is in two conflicts, and
// CheckPixelCertificate accepts every conflict with a bound above max_error.
// Translations and points do not matter, as for VerifyCertificateFile. Requires
// a valid model; throws what BuildProblem does.
ConflictVerdict VerifyConflictFile(const Model& model,
                                   const ConflictFile& file);

// ---- The digest of a model ----

// SHA-256, as 64 lower-case hexadecimal digits, of everything that a
// certificate depends on: cameras, rotations, poses in rigs, and observations.
// It does not depend on translations of frames and points, which a solver
// changes, nor on the format or order of the files. docs/formats.md defines the
// bytes. Requires a valid model. O(2D points); keeps no copy of the bytes.
std::string ModelSha256(const Model& model);

// SHA-256 (FIPS 180-4) of any bytes, in the same digits; about 200 MB/s.
std::string Sha256(std::string_view bytes);

// ---- Baselines ----

inline constexpr int kBaselineCertificateVersion = 1;

// A proof of the largest number of verified matches that any baseline explains,
// pair by pair, with the model's rotations as they are (docs/formats.md). It
// contains neither pixels nor rotations: the checker takes them from a model
// and a database.
struct BaselineCertificate {
  struct Pair {
    ImageId image_id1 = 0;
    ImageId image_id2 = 0;
    int64_t num_matches = 0;     // matches whose pixels have rays
    int64_t num_explained = 0;   // matches that `baseline` explains
    int64_t most_explained = 0;  // no baseline explains more
    Eigen::Vector3d baseline = Eigen::Vector3d::Zero();  // world axes
    // How the directions of the baseline were divided. Directions are (1, s,
    // t), (t, 1, s) and (s, t, 1) with (s, t) in the square [-1, 1]^2; these
    // three squares follow one another. A square is '0', or '1' followed by its
    // four quarters: those with small s before those with large s and, for the
    // same s, small t before large t.
    std::string cells;
  };

  int version = kBaselineCertificateVersion;
  // A match is explained if Sampson's distance is at most this.
  double tolerance_px = 0;
  std::vector<Pair> pairs;
};

// The proofs of all contradictory pairs.
BaselineCertificate DescribeBaselines(const Model& model,
                                      const PairCheck& check);

// JSON. Doubles are restored with the same bits.
std::string BaselineJson(const BaselineCertificate& certificate);

// Whether a file holds baselines, rather than a proof of another kind.
bool HoldsBaselines(const std::string& json);

// The inverse of BaselineJson. Throws ModelError with the place in the text.
// Does not check what is proved.
BaselineCertificate ParseBaselines(const std::string& json,
                                   const std::string& file_name);

struct BaselineVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
};

// Accepts if for every pair the number of matches agrees, the baseline explains
// at least num_explained of them, and no cell has more than most_explained
// matches that some direction in it could explain, by interval arithmetic. The
// rays of pixels are taken as the lens gives them in doubles; every rounding
// after that is accounted for. Requires a valid model and a database read for
// it. O(cells * matches).
BaselineVerdict VerifyBaselines(const Model& model, const Database& database,
                                const BaselineCertificate& certificate);

}  // namespace krot::internal
