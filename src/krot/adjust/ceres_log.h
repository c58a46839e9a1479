#pragma once

namespace krot {

// Ceres warns on stderr, through glog, of steps that it could not take; a
// summary says what became of them. From now on only what ends the process is
// printed, of everything in this process that logs through glog.
void SilenceCeres();

}  // namespace krot
