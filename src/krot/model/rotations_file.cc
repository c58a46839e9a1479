#include "krot/model/rotations_file.h"

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "krot/model/image_geometry.h"
#include "krot/model/image_names.h"
#include "krot/model/model_error.h"
#include "krot/model/text_reader.h"

namespace krot {
namespace {

// What rounding to six digits makes of one rotation, twice, radians.
constexpr double kSameRotation = 1e-5;

std::string Quoted(std::string_view text) {
  return "\"" + std::string(text) + "\"";
}

// Takes the last four words of the line.
QuaternionWxyz ReadQuaternion(TextReader* reader) {
  constexpr char kExpected[] = "a finite number: QW, QX, QY, QZ of a rotation";
  QuaternionWxyz wxyz;
  double squared_norm = 0;
  for (int k = 3; k >= 0; --k) {
    const std::string_view word = reader->LastWord(kExpected);
    const auto value = TextReader::ParseNumber<double>(word);
    if (!value || !std::isfinite(*value)) reader->Fail(Quoted(word), kExpected);
    wxyz[k] = *value;
    squared_norm += *value * *value;
  }
  if (!(squared_norm > 0) || !std::isfinite(squared_norm)) {
    reader->Fail(
        "a quaternion of length " + std::to_string(std::sqrt(squared_norm)),
        "one that can be normalised");
  }
  return wxyz;
}

// Takes the rest of the line.
int32_t ReadImage(const ImageNames& names, TextReader* reader) {
  const std::string_view name = reader->Rest();
  if (name.empty()) {
    reader->Fail("no name", "an image's name in front of QW QX QY QZ");
  }
  return names.Find(name, *reader);
}

// What the lines so far say of a frame.
struct NamedFrame {
  size_t line = 0;  // the first that does; 0: none
  QuaternionWxyz rig_from_world;
};

// The model's rotations as the lines replace them.
class Replacement {
 public:
  explicit Replacement(Model* model)
      : model_(*model),
        geometries_(ImageGeometries(*model)),
        named_(model->frames.size()),
        line_of_image_(model->images.size(), 0) {}

  void Read(const FileBytes& file);
  ReplacedRotations Apply();

 private:
  void Add(int32_t image, const QuaternionWxyz& cam_from_world,
           const TextReader& reader);
  // False if the frame has this rotation already.
  bool Turn(const QuaternionWxyz& rig_from_world, Pose* frame) const;

  Model& model_;
  const std::vector<ImageGeometry> geometries_;
  std::vector<NamedFrame> named_;
  std::vector<size_t> line_of_image_;  // 0: none
};

void Replacement::Read(const FileBytes& file) {
  const ImageNames names(model_);
  TextReader reader(file);
  while (reader.NextRecord()) {
    const QuaternionWxyz cam_from_world = ReadQuaternion(&reader);
    Add(ReadImage(names, &reader), cam_from_world, reader);
  }
}

void Replacement::Add(int32_t image, const QuaternionWxyz& cam_from_world,
                      const TextReader& reader) {
  if (line_of_image_[image] > 0) {
    reader.Fail(Quoted(model_.images[image].name) + " again",
                "each image once; line " +
                    std::to_string(line_of_image_[image]) + " names it");
  }
  line_of_image_[image] = reader.line_number();
  const ImageGeometry& geometry = geometries_[image];
  const bool is_reference = geometry.sensor < 0;
  const QuaternionWxyz rig_from_world =
      is_reference
          ? cam_from_world
          : ToWxyz(
                Eigen::Quaterniond(geometry.cam_from_rig.rotation).conjugate() *
                NormalizedQuaternion(cam_from_world));
  NamedFrame& frame = named_[geometry.frame];
  if (frame.line == 0) {
    frame = {reader.line_number(), rig_from_world};
    return;
  }
  const double angle =
      NormalizedQuaternion(frame.rig_from_world)
          .angularDistance(NormalizedQuaternion(rig_from_world));
  if (angle <= kSameRotation) return;
  reader.Fail("a rotation " + std::to_string(angle) +
                  " rad off the one that line " + std::to_string(frame.line) +
                  " gives to the same frame",
              "the same, or one line of a frame");
}

bool Replacement::Turn(const QuaternionWxyz& rig_from_world,
                       Pose* frame) const {
  if (NormalizedQuaternion(frame->quaternion_wxyz).coeffs() ==
      NormalizedQuaternion(rig_from_world).coeffs()) {
    return false;
  }
  // t = -R C.
  frame->translation = RotationOf(rig_from_world) *
                       (frame->Rotation().transpose() * frame->translation);
  frame->quaternion_wxyz = rig_from_world;
  return true;
}

ReplacedRotations Replacement::Apply() {
  ReplacedRotations replaced;
  std::vector<char> is_turned(named_.size(), 0);
  for (size_t f = 0; f < named_.size(); ++f) {
    if (named_[f].line == 0) continue;
    ++replaced.num_frames;
    is_turned[f] =
        Turn(named_[f].rig_from_world, &model_.frames[f].rig_from_world);
  }
  for (size_t n = 0; n < model_.images.size(); ++n) {
    const ImageGeometry& geometry = geometries_[n];
    if (geometry.frame < 0 || named_[geometry.frame].line == 0) {
      ++replaced.num_kept_images;
    } else if (is_turned[geometry.frame]) {
      const Pose& frame = model_.frames[geometry.frame].rig_from_world;
      model_.images[n].cam_from_world =
          geometry.sensor < 0
              ? frame
              : ToPose(geometry.cam_from_rig * frame.Transform());
    }
  }
  return replaced;
}

}  // namespace

ReplacedRotations ReplaceRotations(const FileBytes& file, Model* model) {
  Replacement replacement(model);
  replacement.Read(file);
  const ReplacedRotations replaced = replacement.Apply();
  if (replaced.num_frames == 0) {
    throw ModelError(file.path +
                     ": found no rotation, expected one on a line each");
  }
  return replaced;
}

}  // namespace krot
