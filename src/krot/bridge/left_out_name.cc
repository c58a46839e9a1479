#include "krot/bridge/bridge.h"

namespace krot {

const char* LeftOutName(LeftOut reason) {
  switch (reason) {
    case LeftOut::kBehind:
      return "behind";
    case LeftOut::kUndistortion:
      return "undistortion";
    case LeftOut::kOffAxis:
      return "off_axis";
    case LeftOut::kShortTrack:
      return "short_track";
    case LeftOut::kNoPose:
      return "no_pose";
    case LeftOut::kSameImage:
      return "same_image";
    case LeftOut::kFixed:
      return "fixed";
  }
  return "unknown";
}

}  // namespace krot
