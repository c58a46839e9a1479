#include "tools/krot_mpi/shared_model.h"

#include <algorithm>
#include <optional>
#include <unordered_set>
#include <utility>
#include <vector>

#include "krot/convert/certificate_file.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// The fields of a point that a solve changes.
struct SolvedPoint {
  Eigen::Vector3d xyz;
  double error;
};

struct Named {
  Point3DId point3D_id;
  ImageId image_id;
  uint32_t point2D_idx;
};

}  // namespace

Model SharedModel::Read(bool first_needs_whole, const LogOptions& log,
                        RunRecord* run) {
  std::optional<Model> whole;
  std::optional<ModelShare> share;
  // Other rotations are compared with those of the whole model.
  const bool may_share = paths_.rotations_path.empty();
  if (may_share && first_needs_whole && ranks_.IsFirst()) {
    whole = ReadInput(paths_, log, run);
  } else if (may_share) {
    BeginPhase(log, "reading " + paths_.input_path);
    const Timer timer;
    share = ReadShare(paths_.input_path, ranks_.count(), ranks_.rank());
    run->seconds_read = timer.Seconds();
  }
  const bool agrees = share || (whole && !run->contradictions.Any());
  const std::vector<char> all_agree = ranks_.Gather(std::vector<char>{agrees});
  is_share_ = false;
  if (std::count(all_agree.begin(), all_agree.end(), 0) > 0) {
    share.reset();
    return whole ? *std::move(whole) : ReadInput(paths_, log, run);
  }
  if (whole) return *std::move(whole);
  is_share_ = true;
  point2D_of_ = std::move(share->point2D_of);
  run->poses = DescribeInput(paths_.input_path, share->model, log);
  return std::move(share->model);
}

Model SharedModel::Take(Model read) {
  if (is_share_) return read;
  ModelShare share =
      TakeShare(read, CutPoints(read, ranks_.count())[ranks_.rank()]);
  point2D_of_ = std::move(share.point2D_of);
  return std::move(share.model);
}

void SharedModel::NameInWhole(const Model& share, SolveSummary* summary) const {
  std::vector<Named> support;
  for (const SupportObservation& o : summary->support) {
    support.push_back({o.point3D_id, o.image_id, o.point2D_idx});
  }
  if (summary->certificate) {
    for (const auto& o : summary->certificate->observations) {
      support.push_back({o.point3D_id, o.image_id, o.point2D_idx});
    }
  }
  ranks_.Broadcast(&support);
  std::unordered_set<Point3DId> ids;
  for (const Point3D& point : share.points3D) ids.insert(point.id);
  const auto images = ImageIndices(share);
  std::vector<uint32_t> names(support.size(), 0);  // 0 if of another rank
  for (size_t n = 0; n < support.size(); ++n) {
    if (ids.count(support[n].point3D_id) == 0) continue;
    names[n] =
        point2D_of_[images.at(support[n].image_id)][support[n].point2D_idx];
  }
  ranks_.Reduce([](uint32_t a, uint32_t b) { return std::max(a, b); }, &names);
  auto name = names.begin();
  for (SupportObservation& o : summary->support) o.point2D_idx = *name++;
  if (!summary->certificate) return;
  for (auto& o : summary->certificate->observations) o.point2D_idx = *name++;
}

bool SharedModel::Join(Model* model, Model* solved,
                       SolveSummary* summary) const {
  NameInWhole(*model, summary);
  std::vector<SolvedPoint> points;
  for (const Point3D& point : solved->points3D) {
    points.push_back({point.xyz, point.error});
  }
  points = ranks_.GatherOnFirst(points);
  if (!ranks_.IsFirst()) return false;

  const Model share = std::exchange(*solved, Model());
  *model = Model();
  LogOptions quiet;
  quiet.level = 0;
  RunRecord again;
  *model = ReadInput(paths_, quiet, &again);
  summary->pixel_error_before = Summarize(PixelErrors(*model));
  if (summary->certificate) {
    summary->certificate->model_sha256 = ModelSha256(*model);
  }
  if (paths_.html_path.empty()) {  // only an HTML page needs the input
    *solved = std::move(*model);
  } else {
    *solved = *model;
  }
  solved->frames = share.frames;
  for (size_t n = 0; n < share.images.size(); ++n) {
    solved->images[n].cam_from_world = share.images[n].cam_from_world;
  }
  size_t next = 0;
  for (const std::vector<int32_t>& cut : CutPoints(*solved, ranks_.count())) {
    for (const int32_t k : cut) {
      solved->points3D[k].xyz = points[next].xyz;
      solved->points3D[k].error = points[next++].error;
    }
  }
  summary->pixel_error_after = Summarize(PixelErrors(*solved));
  return true;
}

}  // namespace krot::internal
