#include "krot/pipeline/solve_model.h"

#include <vector>

#include "krot/model/id_index.h"
#include "krot/model/image_geometry.h"
#include "krot/model/local_frame.h"
#include "krot/pipeline/inflate_positions.h"
#include "krot/pipeline/solve_in_frame.h"

namespace krot::internal {
namespace {

// Of a certificate's fixed positions, those that the model has.
void PlaceFixed(const Model& model, CertificateFile* certificate) {
  if (!certificate->fixed_images.empty()) {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model);
    const IdIndex<ImageId> images(model.images);
    for (CertificateFile::FixedImage& fixed : certificate->fixed_images) {
      const int32_t frame = geometries[*images.Find(fixed.image_id)].frame;
      fixed.translation = model.frames[frame].rig_from_world.translation;
    }
  }
  const IdIndex<Point3DId> points(model.points3D);
  for (CertificateFile::FixedPoint& fixed : certificate->fixed_points) {
    fixed.xyz = model.points3D[*points.Find(fixed.point3D_id)].xyz;
  }
}

// Likewise, in the model's frame.
void PlaceKnown(const Model& model, const std::vector<KnownPosition>& known,
                CertificateFile* certificate) {
  for (CertificateFile::Position& position : certificate->positions) {
    for (const KnownPosition& k : known) {
      const bool is_images = k.of == KnownPosition::Of::kImage;
      const uint64_t id =
          is_images ? model.images[k.index].id : model.points3D[k.index].id;
      if (k.of == position.of && id == position.id) position.region = k.region;
    }
  }
}

}  // namespace

SolveMethod EffectiveMethod(const SolveModelOptions& options) {
  if (options.method != SolveMethod::kAuto) return options.method;
  const bool as_in_paper =
      options.res_int.fast_descent.settings == FastDescentSettings::kPaper;
  return as_in_paper || !HasJointSolver(options.norm) ? SolveMethod::kResInt
                                                      : SolveMethod::kAuto;
}

SolveModelResult SolveModel(const Model& model,
                            const SolveModelOptions& options,
                            const Context& context) {
  if (options.inflate_positions_to) {
    return SolveWithInflatedPositions(model, options, context);
  }
  const BuildProblemOptions& known = options.problem;
  const LocalFrame frame(model, known.fixed, known.positions);
  SolveModelOptions local_options = options;
  local_options.problem.positions = frame.ToLocal(known.positions);
  SolveModelResult result = InLocalFrame(frame, model, [&](const Model& local) {
    return SolveInFrame(local, local_options, context);
  });
  if (result.summary.certificate) {
    PlaceFixed(model, &*result.summary.certificate);
    PlaceKnown(model, known.positions, &*result.summary.certificate);
  }
  return result;
}

SolveModelResult TriangulateModel(const Model& model,
                                  const SolveModelOptions& options,
                                  const Context& context) {
  return SolveModel(model, PointsOnly(options), context);
}

SolveModelOptions PointsOnly(SolveModelOptions options) {
  options.method = SolveMethod::kResInt;
  options.init = SolveInit::kModel;
  options.polish = Polish::kNone;
  options.res_int.update_frames = false;
  options.res_int.max_sweeps = 1;
  return options;
}

}  // namespace krot::internal
