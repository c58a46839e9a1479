#include "tools/krot/log.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <iostream>
#include <mutex>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "krot/base/system.h"

namespace krot::internal {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

LogSink log_sink;

void LogToSink(const std::string& text) {
  if (log_sink) log_sink(text);
}

// In one piece, so that a signal's sentence begins a line of its own.
void Write(const std::string& text) { std::cerr << text << std::flush; }

// The longest beginning of the text that takes at most `columns`, with blanks
// for control characters. Beyond ASCII every character counts as two columns
// wide.
std::string Cut(const std::string& text, int columns) {
  std::string cut;
  int used = 0;
  for (const char letter : text) {
    const auto byte = static_cast<unsigned char>(letter);
    const bool continues = (byte & 0xC0) == 0x80;  // UTF-8
    const int width = continues ? 0 : byte < 0x80 ? 1 : 2;
    if (used + width > columns) break;
    used += width;
    cut += byte < 0x20 || byte == 0x7F ? ' ' : letter;
  }
  return cut;
}

// The line on stderr that shows that work goes on.
class ProgressLine {
 public:
  // Never destroyed: its thread sleeps when the process ends.
  static ProgressLine& Get() {
    static ProgressLine& line = *new ProgressLine();
    return line;
  }

  void Show(const LogOptions& options, const Progress& progress);
  void Begin(const LogOptions& options, const std::string& words);
  // Prints other text, on lines of its own.
  void Say(const std::string& text);
  void End();

 private:
  // These are called with the mutex locked.
  void Leave();
  void LeaveStage();
  void Print(const std::string& addition);
  void Rewrite(const std::string& line);
  double Pause() const;
  void StartWatching();
  void Watch();

  std::mutex mutex_;  // for all that follows
  std::condition_variable has_changed_;
  bool is_watched_ = false;
  bool is_terminal_ = false;
  bool is_active_ = false;
  bool is_phase_ = false;
  bool prints_all_ = false;
  Progress progress_;
  std::set<std::string> told_;  // stages that have left a line
  const Clock::time_point begun_ = Clock::now();
  Clock::time_point updated_;  // when its words changed
  Clock::time_point printed_;
  bool is_printed_ = false;    // the present words are
  bool says_seconds_ = false;  // after the words
  bool line_is_open_ = false;  // on a terminal
  size_t num_shown_ = 0;       // columns of the open line
};

void ProgressLine::Show(const LogOptions& options, const Progress& progress) {
  const std::lock_guard<std::mutex> lock(mutex_);
  LogToSink(progress.words);
  if (options.level < 1) return;
  const bool is_new =
      !is_active_ || is_phase_ || progress.stage != progress_.stage;
  if (is_new) LeaveStage();
  const std::optional<double> so_far = progress_.fraction;
  progress_ = progress;
  if (so_far && progress_.fraction) {
    progress_.fraction = std::max(*so_far, *progress_.fraction);
  }
  is_active_ = true;
  is_phase_ = false;
  prints_all_ = options.level >= 2;
  updated_ = Clock::now();
  is_printed_ = false;
  if (is_new) {
    is_terminal_ = CanRewriteLines();
    StartWatching();
  }
  const bool is_first = is_new && told_.count(progress.stage) == 0;
  const bool is_due = Seconds(updated_ - printed_).count() >= Pause();
  if (is_first || is_due || (prints_all_ && !is_terminal_)) Print("");
}

void ProgressLine::Begin(const LogOptions& options, const std::string& words) {
  LogLine(options, 2, words);
  const std::lock_guard<std::mutex> lock(mutex_);
  LeaveStage();
  if (options.level < 1) return;
  progress_.words = words;
  is_active_ = true;
  is_phase_ = true;
  is_printed_ = true;  // not before it takes long
  is_terminal_ = CanRewriteLines();
  updated_ = printed_ = Clock::now();
  StartWatching();
}

void ProgressLine::Say(const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  Leave();
  Write(text);
}

void ProgressLine::End() {
  const std::lock_guard<std::mutex> lock(mutex_);
  Leave();
  is_active_ = false;
  progress_ = {};
  told_.clear();
}

void ProgressLine::Leave() {
  if (is_active_ && !is_printed_) Print("");
  if (!line_is_open_) return;
  if (!is_phase_ && says_seconds_) Print("");
  if (is_phase_) {  // leaves no line
    Rewrite("");
    Write("\r");
  } else {
    Write("\n");
  }
  num_shown_ = 0;
  line_is_open_ = false;
}

// In a hard solve the same stages follow each other again and again. They leave
// a line behind the first time only.
void ProgressLine::LeaveStage() {
  const bool is_first = told_.insert(progress_.stage).second;
  if (is_active_ && (is_first || is_phase_)) Leave();
  is_active_ = false;
  progress_ = {};
}

void ProgressLine::Print(const std::string& addition) {
  Progress whole = progress_;
  whole.words += addition;
  if (is_terminal_) {
    constexpr int kUsual = 80;
    Rewrite(FitProgress(whole, TerminalColumns().value_or(kUsual)));
    line_is_open_ = true;
  } else {
    Write(whole.words + '\n');
  }
  printed_ = Clock::now();
  is_printed_ = true;
  says_seconds_ = !addition.empty();
}

// Goes back to the margin, and writes spaces over what is left of a longer
// line: not every console knows the sequence that erases it.
void ProgressLine::Rewrite(const std::string& line) {
  const size_t num_left = num_shown_ - std::min(num_shown_, line.size());
  Write('\r' + line + std::string(num_left, ' '));
  num_shown_ = line.size();
}

// Seconds between two lines, or two states of one.
double ProgressLine::Pause() const {
  if (is_terminal_) return 0.1;
  return std::clamp(Seconds(Clock::now() - begun_).count() / 10, 2.0, 60.0);
}

void ProgressLine::StartWatching() {
  has_changed_.notify_one();
  if (is_watched_) return;
  is_watched_ = true;
  try {
    std::thread([this] { Watch(); }).detach();
  } catch (const std::system_error&) {
    // Without a thread for it, nothing is said between two steps.
  }
}

void ProgressLine::Watch() {
  constexpr double kSilence = 2;
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    if (!is_active_) {
      has_changed_.wait(lock);
      continue;
    }
    has_changed_.wait_for(lock, std::chrono::milliseconds(500));
    if (!is_active_) continue;
    if (is_terminal_ && !is_printed_) Print("");
    const double silence = Seconds(Clock::now() - updated_).count();
    const double pause = is_terminal_ ? 1 : Pause();
    if (silence >= kSilence &&
        Seconds(Clock::now() - printed_).count() >= pause) {
      Print(" (" + std::to_string(std::lround(silence)) + " s)");
    }
  }
}

}  // namespace

void SetLogSink(LogSink sink) { log_sink = std::move(sink); }

void LogLine(const LogOptions& options, int level, const std::string& line) {
  LogToSink(line);
  if (options.level < level) return;
  ProgressLine::Get().Say(line + '\n');
}

std::function<void(const std::string&)> WarnOn(const LogOptions& options) {
  return [&options](const std::string& text) {
    LogLine(options, 0, "warning: " + text);
  };
}

void PrintTable(const LogOptions& options, const std::string& text) {
  EndProgress();
  LogToSink(text);
  (options.to_stderr ? std::cerr : std::cout) << text << std::flush;
}

void ShowProgress(const LogOptions& options, const Progress& progress) {
  ProgressLine::Get().Show(options, progress);
}

void BeginPhase(const LogOptions& options, const std::string& words) {
  ProgressLine::Get().Begin(options, words);
}

void EndProgress() { ProgressLine::Get().End(); }

std::string FitProgress(const Progress& progress, int columns) {
  constexpr int kLeastCells = 5;
  constexpr int kMostCells = 30;
  const int room = columns - 1;  // the last column would begin a new row
  const std::string words = Cut(progress.words, room);
  const int cells = std::min(
      kMostCells, room - static_cast<int>(words.size() + sizeof("[] ") - 1));
  if (!progress.fraction || cells < kLeastCells) return words;
  const auto filled = static_cast<size_t>(
      std::lround(cells * std::clamp(*progress.fraction, 0.0, 1.0)));
  return "[" + std::string(filled, '#') +
         std::string(static_cast<size_t>(cells) - filled, '.') + "] " + words;
}

}  // namespace krot::internal
