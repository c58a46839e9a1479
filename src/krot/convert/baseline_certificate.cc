#include "krot/convert/certificate_file.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/camera/interval.h"
#include "krot/convert/certificate_json.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// An interval for each coordinate of a vector.
using Box = std::array<Interval, 3>;

Box Cross(const Vector3d& a, const Vector3d& b) {
  const auto difference = [&](int i, int j) {
    return Interval{a[i], a[i]} * Interval{b[j], b[j]} -
           Interval{a[j], a[j]} * Interval{b[i], b[i]};
  };
  return {difference(1, 2), difference(2, 0), difference(0, 1)};
}

Interval Dot(const Box& a, const Box& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Interval Square(const Interval& a) {
  const double most = std::max(-a.lo, a.hi);
  const double least = std::max({0.0, a.lo, -a.hi});
  return Interval{least, most} * Interval{least, most};
}

// The condition of a match. A baseline b explains the match if |b . (d1 x d2)|
// <= tolerance |gradient b|, where d1 and d2 are the rays of its pixels and the
// gradient is that of the left side by the four pixel coordinates.
struct Condition {
  Box normal;
  std::array<Box, 4> gradient;

  // The squares of both sides.
  std::pair<Interval, Interval> Sides(const Box& b, double tolerance) const {
    Interval sum{0, 0};
    for (const Box& row : gradient) sum = sum + Square(Dot(row, b));
    return {Square(Dot(normal, b)),
            Square(Interval{tolerance, tolerance}) * sum};
  }
};

std::vector<Condition> ConditionsOf(
    const Model& model, const std::vector<ImageGeometry>& geometries,
    const Database& database, const VerifiedPair& pair) {
  std::vector<Condition> conditions;
  const auto ray = [&](int32_t image, uint32_t keypoint) {
    const ImageGeometry& geometry = geometries[image];
    auto in_world = RayOf(model.cameras[geometry.camera],
                          database.keypoints[image][keypoint]);
    if (in_world) {
      const Eigen::Matrix3d world_from_cam =
          geometry.cam_from_world.rotation.transpose();
      in_world = world_from_cam * *in_world;
    }
    return in_world;
  };
  for (const auto& [keypoint1, keypoint2] : pair.matches) {
    const auto ray1 = ray(pair.image1, keypoint1);
    const auto ray2 = ray(pair.image2, keypoint2);
    if (!ray1 || !ray2) continue;
    Condition& condition = conditions.emplace_back();
    condition.normal = Cross(ray1->ray, ray2->ray);
    for (int i = 0; i < 2; ++i) {
      condition.gradient[i] = Cross(ray1->by_pixel.col(i), ray2->ray);
      condition.gradient[2 + i] = Cross(ray1->ray, ray2->by_pixel.col(i));
    }
  }
  return conditions;
}

// Reads the cells of one pair and checks each of them.
class CellChecker {
 public:
  CellChecker(const std::vector<Condition>& conditions, double tolerance,
              const BaselineCertificate::Pair& pair)
      : conditions_(conditions), tolerance_(tolerance), pair_(pair) {}

  // Why the cells prove nothing; empty if they prove most_explained.
  std::string Run() {
    std::vector<int32_t> all(conditions_.size());
    std::iota(all.begin(), all.end(), 0);
    for (int face = 0; face < 3 && refusal_.empty(); ++face) {
      Check(face, 0, 0, 1, 0, all);
    }
    if (refusal_.empty() && next_ != pair_.cells.size()) {
      refusal_ = "its cells go on after the last";
    }
    return refusal_;
  }

 private:
  void Check(int face, double s, double t, double half_width, int depth,
             const std::vector<int32_t>& above) {
    if (!refusal_.empty()) return;
    // The corners of cells that were halved so often are exact numbers.
    if (next_ == pair_.cells.size() || depth > 50) {
      refusal_ = "its cells do not cover all directions";
      return;
    }
    Box b;
    b[face] = {1, 1};
    b[(face + 1) % 3] = {s - half_width, s + half_width};
    b[(face + 2) % 3] = {t - half_width, t + half_width};
    std::vector<int32_t> open;
    for (const int32_t k : above) {
      const auto [distance, allowed] = conditions_[k].Sides(b, tolerance_);
      if (!(distance.lo > allowed.hi)) open.push_back(k);
    }
    const char kind = pair_.cells[next_++];
    if (kind == '1') {
      const double half = half_width / 2;
      for (const double ds : {-half, half}) {
        for (const double dt : {-half, half}) {
          Check(face, s + ds, t + dt, half, depth + 1, open);
        }
      }
    } else if (kind != '0') {
      refusal_ = "its cells hold something else than 0 and 1";
    } else if (static_cast<int64_t>(open.size()) > pair_.most_explained) {
      refusal_ = "in one of its cells " + std::to_string(open.size()) +
                 " matches may be explained, and not " +
                 std::to_string(pair_.most_explained) + " at most";
    }
  }

  const std::vector<Condition>& conditions_;
  const double tolerance_;
  const BaselineCertificate::Pair& pair_;
  size_t next_ = 0;
  std::string refusal_;
};

std::string RefusePair(const std::vector<Condition>& conditions,
                       double tolerance,
                       const BaselineCertificate::Pair& pair) {
  if (static_cast<int64_t>(conditions.size()) != pair.num_matches) {
    return "the database has " + std::to_string(conditions.size()) +
           " matches of it, and not " + std::to_string(pair.num_matches);
  }
  Box b;
  for (int i = 0; i < 3; ++i) b[i] = {pair.baseline[i], pair.baseline[i]};
  int64_t num_explained = 0;
  for (const Condition& condition : conditions) {
    const auto [distance, allowed] = condition.Sides(b, tolerance);
    num_explained += distance.hi <= allowed.lo;
  }
  if (pair.baseline.isZero(0) || num_explained < pair.num_explained) {
    return "its baseline explains " + std::to_string(num_explained) +
           " matches, and not " + std::to_string(pair.num_explained);
  }
  return CellChecker(conditions, tolerance, pair).Run();
}

}  // namespace

BaselineCertificate DescribeBaselines(const Model& model,
                                      const PairCheck& check) {
  BaselineCertificate certificate;
  certificate.tolerance_px = check.tolerance_px;
  for (const CheckedPair& pair : check.pairs) {
    if (pair.state != PairState::kContradictory) continue;
    certificate.pairs.push_back({model.images[pair.image1].id,
                                 model.images[pair.image2].id, pair.num_matches,
                                 pair.num_explained, pair.most_explained,
                                 pair.best_baseline, pair.cells});
  }
  return certificate;
}

std::string BaselineJson(const BaselineCertificate& certificate) {
  CertificateFileJson pairs =
      ListJson(certificate.pairs, [&](const auto& pair) -> CertificateFileJson {
        return {{"image_id1", pair.image_id1},
                {"image_id2", pair.image_id2},
                {"num_matches", pair.num_matches},
                {"num_explained", pair.num_explained},
                {"most_explained", pair.most_explained},
                {"baseline", VectorJson(pair.baseline)},
                {"cells", pair.cells}};
      });
  CertificateFileJson json = {{"version", certificate.version},
                              {"tolerance_px", certificate.tolerance_px}};
  json["baselines"] = std::move(pairs);
  return json.dump(1) + "\n";
}

bool HoldsBaselines(const std::string& json) {
  return HasMember(json, "baselines");
}

BaselineCertificate ParseBaselines(const std::string& text,
                                   const std::string& file_name) {
  return ParseFile(text, file_name, [](const PlacedJson& json) {
    BaselineCertificate certificate;
    certificate.version = ReadVersion(json, kBaselineCertificateVersion,
                                      kBaselineCertificateVersion);
    certificate.tolerance_px = json["tolerance_px"].Number();
    for (const PlacedJson& pair : json["baselines"].Elements()) {
      certificate.pairs.push_back({pair["image_id1"].Integer<ImageId>(),
                                   pair["image_id2"].Integer<ImageId>(),
                                   pair["num_matches"].Integer<uint32_t>(),
                                   pair["num_explained"].Integer<uint32_t>(),
                                   pair["most_explained"].Integer<uint32_t>(),
                                   pair["baseline"].Triple(),
                                   pair["cells"].String()});
    }
    return certificate;
  });
}

BaselineVerdict VerifyBaselines(const Model& model, const Database& database,
                                const BaselineCertificate& certificate) {
  const auto refused = [](const std::string& refusal) {
    return BaselineVerdict{false, refusal};
  };
  if (!(certificate.tolerance_px > 0)) {
    return refused("its tolerance_px is no positive number");
  }
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  std::map<std::pair<ImageId, ImageId>, const VerifiedPair*> pairs;
  for (const VerifiedPair& pair : database.pairs) {
    if (!geometries[pair.image1].has_pose ||
        !geometries[pair.image2].has_pose) {
      continue;
    }
    pairs[{model.images[pair.image1].id, model.images[pair.image2].id}] = &pair;
  }
  for (const BaselineCertificate::Pair& pair : certificate.pairs) {
    const std::string name = "the pair of images " +
                             std::to_string(pair.image_id1) + " and " +
                             std::to_string(pair.image_id2);
    const auto found = pairs.find({pair.image_id1, pair.image_id2});
    if (found == pairs.end()) {
      return refused("model and database have not " + name +
                     ", or it is there twice");
    }
    const std::string refusal =
        RefusePair(ConditionsOf(model, geometries, database, *found->second),
                   certificate.tolerance_px, pair);
    if (!refusal.empty()) return refused(name + ": " + refusal);
    pairs.erase(found);
  }
  return {true, ""};
}

}  // namespace krot::internal
