#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/analysis/model_input.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/report/reports.h"
#include "tools/krot/log.h"
#include "tools/krot/model_files.h"

namespace krot::internal {

// What is known about a model in metres: positions in a frame of their own, and
// distances.

// Measures the distances in the file `path` in these models of the same images;
// none if the path is empty. Throws ModelError.
std::optional<DistanceReport> MeasureFile(
    const std::string& path, const std::vector<const Model*>& models,
    const LogOptions& log, bool may_lack_metres = true);

// Measures the known distances in the input of a command that solves; none
// without a path. Throws ModelError, also if they are to set the scale,
// contradict each other, and several sets of them are the largest.
std::optional<DistanceReport> ReadKnownDistances(const ModelPaths& paths,
                                                 const Model& model,
                                                 const LogOptions& log);

// Measures the report's distances in the solved model, and warns of
// contradictions. The distances set the scale unless something else holds it.
void MeasureSolved(const Model& solved, const LogOptions& log,
                   SolveReport* report);

// The solved model in the positions' frame, or with the scale of the distances,
// and its errors in the report; none if it stays as it was solved.
std::optional<Model> InOutputFrame(const ModelPaths& paths, const Model& solved,
                                   SolveReport* report);

// Reads the known positions of paths.*positions_path. If they are in their own
// frame, says on stderr how it was found, and which positions are wrong. Throws
// ModelError.
KnownPositions ReadKnownPositions(const ModelPaths& paths, const Model& model,
                                  const LogOptions& log);

}  // namespace krot::internal
