#include "krot/model/trivial_rigs.h"

namespace krot::internal {

void UseTrivialRigs(Model* model) {
  model->rigs.clear();
  for (const Camera& camera : model->cameras) {
    const SensorId sensor_id{kSensorTypeCamera, camera.id};
    model->rigs.push_back({camera.id, sensor_id, {}});
  }
  model->frames.clear();
  for (const Image& image : model->images) {
    const SensorId sensor_id{kSensorTypeCamera, image.camera_id};
    model->frames.push_back({image.id,
                             image.camera_id,
                             image.cam_from_world,
                             {{sensor_id, image.id}}});
  }
}

}  // namespace krot::internal
