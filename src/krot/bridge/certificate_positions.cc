#include "krot/bridge/certificate_positions.h"

#include <map>
#include <optional>
#include <set>
#include <utility>

#include "krot/bridge/position_rows.h"
#include "krot/model/id_index.h"

namespace krot::internal {
namespace {

using Of = KnownPosition::Of;
using OfAndId = std::pair<Of, uint64_t>;

}  // namespace

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

CertificatePositions::CertificatePositions(const Model& model,
                                           const CertificateFile& file,
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

const CertificateFile::Position::Row* CertificatePositions::RowOf(
    int64_t observation) const {
  const CertificateFile::Position& position =
      *positions_[PositionOf(built_, observation)];
  const size_t n = RowIndex(built_, observation) % kRowsPerPosition;
  return n < position.rows.size() ? &position.rows[n] : nullptr;
}

}  // namespace krot::internal
