// progress MODEL_FOLDER: tells how far a solve is, and ends it after three
// messages, as somebody might who presses a button. The best so far is kept.

#include <cstdio>
#include <exception>

#include "krot/solve.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "Usage: %s MODEL_FOLDER\n", argv[0]);
    return 1;
  }
  try {
    krot::CancelFlag stop{false};  // may be set from any thread, too
    krot::Context context;
    context.cancel = &stop;
    context.on_note = [](const std::string& why) { std::puts(why.c_str()); };

    int num_messages = 0;
    krot::SolveOptions options;
    options.on_progress = [&](const krot::SolveState& state) {
      if (state.max_error) {
        std::printf("largest error %.4f px\n", *state.max_error);
      }
      if (++num_messages == 3) stop = true;
    };
    const krot::SolveResult result =
        krot::Solve(krot::ReadModel(argv[1]), options, context);
    std::printf("%s at %.4f px\n",
                result.termination == krot::SolveTermination::kInterrupted
                    ? "ended early"
                    : "done",
                result.errors_after.max);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
