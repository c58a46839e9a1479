#pragma once

#include <string>

#include "krot/base/context.h"

namespace krot::internal {

// What SIGINT, SIGTERM and SIGPIPE do to a command.

// From now on they end the process at once, with kExitInterrupted and a
// sentence that begins with `who`. For as long as nothing has been written.
void EndOnInterrupt(const std::string& who);

// From now on the first one sets the returned flag: what has begun is
// completed, or cut short by those who look at the flag. A second one ends the
// process at once.
const CancelFlag& DeferInterrupts();

// Sets that flag.
void Interrupt();

// From now on writing into a pipe that nobody reads any more fails, and does
// not end the process (SIGPIPE): a model is written though its progress is not
// read.
void OutliveClosedPipes();

// Whether that has happened.
bool HasMetClosedPipe();

}  // namespace krot::internal
