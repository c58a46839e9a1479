#include "krot/outliers/outlier_filter.h"

#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <unordered_set>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// Counts observations, removals and conflicts of tracks, images or cameras.
class Counts {
 public:
  void Add(uint64_t id, bool is_removed, int64_t conflict) {
    Suspect& suspect = suspects_[id];
    suspect.id = id;
    ++suspect.num_observations;
    suspect.num_removed += is_removed;
    if (conflict >= 0) conflicts_[id].insert(conflict);
  }

  std::vector<Suspect> Ranked() {
    std::vector<Suspect> ranked;
    for (auto& [id, suspect] : suspects_) {
      suspect.num_conflicts = static_cast<int64_t>(conflicts_[id].size());
      if (suspect.num_removed > 0) ranked.push_back(std::move(suspect));
    }
    SortLargestFirst(&ranked, [](const Suspect& suspect) {
      return std::make_pair(suspect.num_removed, suspect.num_conflicts);
    });
    return ranked;
  }

 private:
  std::map<uint64_t, Suspect> suspects_;
  std::map<uint64_t, std::set<int64_t>> conflicts_;
};

// Fills in the tracks, images and cameras of a summary: which ones have removed
// observations, and how many.
void RankSuspects(const Model& model, const std::vector<char>& is_removed,
                  const std::vector<int64_t>& conflict_of,
                  OutlierFilterSummary* summary) {
  const auto image_of = ImageIndices(model);
  Counts tracks, images, cameras;
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const Image& image =
          model.images[image_of.at(model.track_elements[e].image_id)];
      const bool is_gone = is_removed[e] != 0;
      tracks.Add(point.id, is_gone, conflict_of[e]);
      images.Add(image.id, is_gone, conflict_of[e]);
      cameras.Add(image.camera_id, is_gone, conflict_of[e]);
    }
  }
  summary->tracks = tracks.Ranked();
  summary->images = images.Ranked();
  summary->cameras = cameras.Ranked();
  for (Suspect& suspect : summary->images) {
    suspect.name =
        model.images[image_of.at(static_cast<ImageId>(suspect.id))].name;
  }
}

// The errors of the input's track elements with the result's cameras and
// points; NaN where the point was removed.
std::vector<double> ErrorsAfter(const Model& input, const Model& kept,
                                const Context& context) {
  Model model = input;
  model.frames = kept.frames;
  for (size_t n = 0; n < model.images.size(); ++n) {
    model.images[n].cam_from_world = kept.images[n].cam_from_world;
  }
  const IdIndex<Point3DId> kept_points(kept.points3D);
  for (Point3D& point : model.points3D) {
    const std::optional<int32_t> k = kept_points.Find(point.id);
    point.xyz = k ? kept.points3D[*k].xyz : Eigen::Vector3d::Constant(kNaN);
  }
  return PixelErrors(model, context.num_threads);
}

// The removed observations of `model`, largest error first, with their errors
// in `model` and with the cameras and points of `kept`, what is left of it.
std::vector<RemovedObservation> ListRemoved(
    const Model& model, const Model& kept,
    const std::vector<double>& errors_before,
    const std::vector<char>& is_removed,
    const std::vector<int64_t>& conflict_of, const Context& context,
    const std::vector<double>& w) {
  std::vector<RemovedObservation> list;
  const std::vector<double> errors_after = ErrorsAfter(model, kept, context);
  const auto image_of = ImageIndices(model);
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!is_removed[e]) continue;
      const TrackElement& element = model.track_elements[e];
      RemovedObservation removed;
      removed.image_id = element.image_id;
      removed.image_name = model.images[image_of.at(element.image_id)].name;
      removed.point2D_idx = element.point2D_idx;
      removed.point3D_id = point.id;
      removed.error_before_px = errors_before[e];
      removed.error_after_px = errors_after[e];
      if (conflict_of[e] >= 0) removed.conflict = conflict_of[e];
      if (!w.empty()) removed.w = w[e];
      list.push_back(std::move(removed));
    }
  }
  const auto key = [](const RemovedObservation& o) {
    return std::isnan(o.error_before_px) ? kInfinity : o.error_before_px;
  };
  SortLargestFirst(&list, key);
  return list;
}

}  // namespace

void ColorSuspects(const OutlierFilterSummary& summary, Model* model) {
  std::unordered_set<Point3DId> removed, in_conflict;
  for (const RemovedObservation& o : summary.removed) {
    removed.insert(o.point3D_id);
  }
  if (summary.conflicts) {
    for (const ConflictFile::Conflict& conflict :
         summary.conflicts->conflicts) {
      for (const CertificateFile::SupportObservation& o :
           conflict.observations) {
        in_conflict.insert(o.point3D_id);
      }
    }
  }
  for (Point3D& point : model->points3D) {
    point.color = removed.count(point.id) > 0       ? kRemovedColor
                  : in_conflict.count(point.id) > 0 ? kConflictColor
                                                    : kUnsuspectedColor;
  }
}

Filtering::Filtering(const Model& model, const OutlierFilterOptions& options,
                     const Context& context)
    : model_(model),
      options_(options),
      context_(context),
      errors_before_(PixelErrors(model, context.num_threads)),
      is_removed_(model.track_elements.size(), 0),
      conflict_of_(model.track_elements.size(), -1) {
  summary_.method = options.method;
  summary_.norm = options.solve.norm;
  summary_.num_observations = static_cast<int64_t>(model.track_elements.size());
  summary_.num_points = static_cast<int64_t>(model.points3D.size());
  summary_.pixel_error_before = Summarize(errors_before_);
}

void Filtering::RemoveMore(const std::vector<char>& is_gone) {
  RemovedObservations rest = RemoveObservations(kept_.model, is_gone);
  for (uint64_t& e : rest.element_of) e = kept_.element_of[e];
  rest.num_left_alone += kept_.num_left_alone;
  rest.num_points += kept_.num_points;
  kept_ = std::move(rest);
}

void Filtering::TakeConflicts(const BuiltProblem& built,
                              const std::vector<uint64_t>& elements,
                              const ErrorBound& bound,
                              std::vector<Conflict> conflicts) {
  std::vector<PixelCertificate> proofs;
  for (Conflict& conflict : conflicts) {
    for (const int64_t i : conflict.observations) {
      conflict_of_[elements[i]] = summary_.num_proved;
    }
    ++summary_.num_proved;
    summary_.num_irreducible += conflict.is_irreducible;
    proofs.push_back(std::move(conflict.proof));
  }
  summary_.conflicts =
      DescribeConflicts(model_, built, bound.norm, bound.max_error, proofs);
}

std::vector<double> Filtering::Describe() {
  std::vector<double> errors = PixelErrors(kept_.model, context_.num_threads);
  summary_.pixel_error_after = Summarize(errors);
  summary_.num_left_alone = kept_.num_left_alone;
  summary_.num_points_removed = kept_.num_points;
  summary_.removed = ListRemoved(model_, kept_.model, errors_before_,
                                 is_removed_, conflict_of_, context_, w_);
  RankSuspects(model_, is_removed_, conflict_of_, &summary_);
  return errors;
}

}  // namespace krot::internal
