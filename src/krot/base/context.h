#pragma once

#include <functional>
#include <string>

#include "krot/base/progress.h"

namespace krot {

// How work is done, as opposed to what: handed on by every stage of a solve to
// those below it, which keep a copy if they keep anything. No result depends on
// it, unless it is cut short. What a stage has to tell of its own iterations
// goes to the callback in its options, whose type says what there is to tell.
struct Context {
  int num_threads = -1;                // -1: all
  const CancelFlag* cancel = nullptr;  // may be null
  // Takes a sentence on what was chosen, and why; may be empty.
  std::function<void(const std::string&)> on_note = {};

  bool IsCancelled() const { return krot::IsCancelled(cancel); }
  void Note(const std::string& sentence) const {
    if (on_note) on_note(sentence);
  }
};

}  // namespace krot
