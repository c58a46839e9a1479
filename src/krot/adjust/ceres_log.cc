#include "krot/adjust/ceres_log.h"

#include <glog/logging.h>

namespace krot {

void SilenceCeres() { FLAGS_minloglevel = google::GLOG_FATAL; }

}  // namespace krot
