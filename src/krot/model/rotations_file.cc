#include "krot/model/model_io.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/model/model_checks.h"
#include "krot/model/name_list.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// Rounding one rotation twice to six digits changes it by less than this;
// radians.
constexpr double kSameRotation = 1e-5;

// A line of the file.
struct ListedRotation {
  int32_t image = 0;  // index in Model::images
  QuaternionWxyz cam_from_world;
  size_t line = 0;
  bool is_new = false;  // the model has no rotation of this image
};

// What the lines read so far say about a frame.
struct NamedFrame {
  size_t line = 0;  // the first line that names the frame; 0: none
  QuaternionWxyz rig_from_world;
};

// Replaces the model's rotations by those of the lines.
class Replacement {
 public:
  explicit Replacement(Model* model)
      : model_(*model),
        geometries_(ImageGeometries(*model)),
        named_(model->frames.size()) {}

  void Read(const FileBytes& file, const FileNote& note) {
    ListReader list(file, model_, ListReader::Of::kImages);
    while (list.Next()) {
      const auto line = list.Take({4}, "QW QX QY QZ of a rotation");
      if (!line) continue;
      const std::vector<double>& q = line->numbers;
      const QuaternionWxyz cam_from_world = {q[0], q[1], q[2], q[3]};
      if (!HasRotation(cam_from_world)) {
        list.reader().Fail("a quaternion of zeros, or too long to be squared",
                           "one that can be normalised");
      }
      Add(line->index, cam_from_world, list.reader());
    }
    list.Finish(note);
  }

  ReplacedRotations Apply(const std::string& path) {
    ReplacedRotations replaced;
    std::vector<char> is_named(named_.size(), 0);
    for (const ListedRotation& listed : listed_) {
      is_named[geometries_[listed.image].frame] = 1;
    }
    replaced.num_frames = std::count(is_named.begin(), is_named.end(), 1);
    for (const ImageGeometry& geometry : geometries_) {
      if (geometry.frame < 0 || is_named[geometry.frame] == 0) {
        ++replaced.num_kept_images;
      }
    }
    const std::vector<Eigen::Quaterniond> before = OwnRotations();
    Judge(&replaced);
    NameFrames(replaced, path);
    std::vector<char> is_turned(named_.size(), 0);
    for (size_t f = 0; f < named_.size(); ++f) {
      if (is_named[f] == 0) continue;
      is_turned[f] =
          Turn(named_[f].rig_from_world, &model_.frames[f].rig_from_world);
    }
    for (size_t n = 0; n < model_.images.size(); ++n) {
      const ImageGeometry& geometry = geometries_[n];
      if (geometry.frame < 0 || is_turned[geometry.frame] == 0) continue;
      const Pose& frame = model_.frames[geometry.frame].rig_from_world;
      model_.images[n].cam_from_world =
          geometry.sensor < 0
              ? frame
              : ToPose(geometry.cam_from_rig * frame.Transform());
    }
    CountTurns(before, &replaced);
    return replaced;
  }

 private:
  void Add(int32_t image, const QuaternionWxyz& cam_from_world,
           const TextReader& reader) {
    const Pose& frame = model_.frames[geometries_[image].frame].rig_from_world;
    listed_.push_back({image, cam_from_world, reader.line_number(),
                       !HasRotation(frame.quaternion_wxyz)});
  }

  // The model's own rotations of the listed images that have one.
  std::vector<Eigen::Quaterniond> OwnRotations() const {
    std::vector<Eigen::Quaterniond> rotations;
    for (const ListedRotation& listed : listed_) {
      if (listed.is_new) continue;
      rotations.emplace_back(geometries_[listed.image].cam_from_world.rotation);
    }
    return rotations;
  }

  // False if all listed frames have the same rotation: then the model probably
  // has none.
  bool HasRotations() const {
    const ListedRotation* first = nullptr;
    for (const ListedRotation& listed : listed_) {
      if (listed.is_new) continue;
      if (first == nullptr) first = &listed;
      if (!geometries_[listed.image].rig_from_world.rotation.isApprox(
              geometries_[first->image].rig_from_world.rotation,
              kSameRotation)) {
        return true;
      }
    }
    return false;
  }

  // Finds the convention and the world frame of the lines by comparing them
  // with the model's own rotations.
  void Judge(ReplacedRotations* replaced) {
    replaced->is_comparable = HasRotations();
    if (!replaced->is_comparable) return;
    std::vector<QuaternionWxyz> listed;
    for (const ListedRotation& one : listed_) {
      if (!one.is_new) listed.push_back(one.cam_from_world);
    }
    const RotationAgreement agreement =
        CompareRotations(OwnRotations(), listed);
    replaced->mistake = agreement.mistake;
    if (!agreement.own_world_from_list || replaced->num_kept_images > 0) return;
    list_from_own_world_ = agreement.own_world_from_list->conjugate();
    replaced->frame_turn_deg = AngleDeg(*agreement.own_world_from_list,
                                        Eigen::Quaterniond::Identity());
  }

  // The rotation of the rig that a line asks for, to the bit where nothing is
  // multiplied to it.
  QuaternionWxyz RigFromWorld(const ListedRotation& listed) const {
    const ImageGeometry& geometry = geometries_[listed.image];
    const bool is_reference = geometry.sensor < 0;
    if (is_reference && !list_from_own_world_) return listed.cam_from_world;
    Eigen::Quaterniond rotation = NormalizedQuaternion(listed.cam_from_world);
    if (!is_reference) {
      rotation =
          Eigen::Quaterniond(geometry.cam_from_rig.rotation).conjugate() *
          rotation;
    }
    if (list_from_own_world_) rotation = rotation * *list_from_own_world_;
    return ToWxyz(rotation);
  }

  void NameFrames(const ReplacedRotations& replaced, const std::string& path) {
    for (const ListedRotation& listed : listed_) {
      const QuaternionWxyz rig_from_world = RigFromWorld(listed);
      NamedFrame& frame = named_[geometries_[listed.image].frame];
      if (frame.line == 0) {
        frame = {listed.line, rig_from_world};
        continue;
      }
      const double angle =
          NormalizedQuaternion(frame.rig_from_world)
              .angularDistance(NormalizedQuaternion(rig_from_world));
      if (angle <= kSameRotation) continue;
      if (!replaced.mistake.empty()) {
        throw ModelError(path + ": " + replaced.mistake);
      }
      throw ModelError(
          path + ":" + std::to_string(listed.line) + ": found a rotation " +
          std::to_string(angle) + " rad off the one that line " +
          std::to_string(frame.line) +
          " gives to the same frame, expected the same, or one line "
          "of a frame");
    }
  }

  void CountTurns(const std::vector<Eigen::Quaterniond>& before,
                  ReplacedRotations* replaced) const {
    if (before.empty()) return;
    std::vector<double> turns_deg;
    auto own = before.begin();
    for (const ListedRotation& listed : listed_) {
      if (listed.is_new) continue;
      const int32_t image = listed.image;
      const ImageGeometry& geometry = geometries_[image];
      const Eigen::Quaterniond after(
          geometry.cam_from_rig.rotation *
          model_.frames[geometry.frame].rig_from_world.Rotation());
      turns_deg.push_back(AngleDeg(*own++, after));
      if (turns_deg.back() > replaced->largest_turn_deg) {
        replaced->largest_turn_deg = turns_deg.back();
        replaced->largest_turn_image = model_.images[image].name;
      }
    }
    replaced->median_turn_deg = Median(turns_deg);
  }

  // Gives the frame its rotation; false if it has it already.
  bool Turn(const QuaternionWxyz& rig_from_world, Pose* frame) const {
    if (NormalizedQuaternion(frame->quaternion_wxyz).coeffs() ==
        NormalizedQuaternion(rig_from_world).coeffs()) {
      return false;
    }
    // t = -R C.
    frame->translation = RotationOf(rig_from_world) *
                         (frame->Rotation().transpose() * frame->translation);
    frame->quaternion_wxyz = ToWxyz(NormalizedQuaternion(rig_from_world));
    return true;
  }

  Model& model_;
  const std::vector<ImageGeometry> geometries_;
  std::vector<ListedRotation> listed_;
  // None: the worlds agree.
  std::optional<Eigen::Quaterniond> list_from_own_world_;
  std::vector<NamedFrame> named_;
};

}  // namespace

ReplacedRotations ReplaceRotations(const FileBytes& file, Model* model,
                                   const FileNote& note) {
  Replacement replacement(model);
  replacement.Read(file, note);
  return replacement.Apply(file.path);
}

}  // namespace krot::internal
