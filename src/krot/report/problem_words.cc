#include "krot/report/problem_words.h"

namespace krot {

std::string LeftOutWords(const LeftOutCounts& left_out) {
  int64_t total = 0;
  std::string list;
  for (const auto& [reason, count] : left_out) {
    total += count;
    if (count == 0) continue;
    list += (list.empty() ? "" : ", ") + reason + " " + std::to_string(count);
  }
  return Counted(total, "observation") + " left out" +
         (list.empty() ? "" : " (" + list + ")");
}

std::string NothingToDoSentence(const std::string& what,
                                const LeftOutCounts& left_out) {
  bool has_observations = false;
  for (const auto& [reason, count] : left_out) has_observations |= count > 0;
  return "nothing to " + what + ": " +
         (has_observations ? LeftOutWords(left_out) : kNoObservations);
}

}  // namespace krot
