#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/analysis/position_frame.h"
#include "krot/model.h"
#include "krot/model/known_distances.h"
#include "krot/report/reports.h"
#include "tools/krot/log.h"
#include "tools/krot/model_files.h"

namespace krot::internal {

// What is known in metres of a model: positions in a frame of their own, and
// distances.

// The distances of `path` in these models of the same images; none if there is
// no path. Throws ModelError.
std::optional<DistanceReport> MeasureFile(
    const std::string& path, const std::vector<const Model*>& models,
    const LogOptions& log, bool may_lack_metres = true);

// The distances of a command that solves, in its input; none without a path.
// Throws ModelError, too, where they are to set the scale, contradict each
// other, and several sets of them are the largest.
std::optional<DistanceReport> ReadKnownDistances(const ModelPaths& paths,
                                                 const Model& model,
                                                 const LogOptions& log);

// Measures the report's distances in what was solved, and tells of
// contradictions. They set the scale unless something else holds it.
void MeasureSolved(const Model& solved, const LogOptions& log,
                   SolveReport* report);

// The model in the positions' frame, or by the scale of distances, measured
// anew there; none if it stays as it was solved.
std::optional<Model> InOutputFrame(const ModelPaths& paths, const Model& solved,
                                   SolveReport* report);

struct KnownPositions {
  std::vector<KnownPosition> positions;  // in the model's frame
  std::optional<PositionFrame> frame;    // that the files have of their own
};

// What paths.*positions_path know of the model; tells on stderr of a frame that
// was found, and of wrong positions. Throws ModelError.
KnownPositions ReadKnownPositions(const ModelPaths& paths, const Model& model,
                                  const LogOptions& log);

}  // namespace krot::internal
