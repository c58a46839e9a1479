#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "krot/base/number_text.h"
#include "krot/model/file_bytes.h"
#include "krot/model/model_error.h"

namespace krot {

// Walks over the lines of a text file in memory and over the words of the
// current line. Words are separated by spaces and tabs; a line may end with
// CR LF. Errors are ModelErrors that name the file, the line, the word found
// and, from `what`, what was expected ("the x of a 2D point").
class TextReader {
 public:
  // Keeps a reference to `file`.
  explicit TextReader(const FileBytes& file)
      : file_(file), remaining_(file.bytes) {}

  // Moves to the next line; false at the end of the file.
  bool NextLine() {
    if (remaining_.empty()) return false;
    const size_t end = remaining_.find('\n');
    line_ = remaining_.substr(0, end);
    remaining_.remove_prefix(end == std::string_view::npos ? remaining_.size()
                                                           : end + 1);
    ++line_number_;
    SkipBlanks();
    return true;
  }

  // Moves to the next line that holds a record: neither blank nor a comment.
  bool NextRecord() {
    while (NextLine()) {
      if (!AtEnd() && line_.front() != '#') return true;
    }
    return false;
  }

  // Whether no word is left on this line.
  bool AtEnd() const { return line_.empty(); }

  std::string_view Word(const char* what) {
    if (AtEnd()) Fail("the end of the line", what);
    size_t length = 0;
    while (length < line_.size() && !IsBlank(line_[length])) ++length;
    const std::string_view word = line_.substr(0, length);
    line_.remove_prefix(length);
    SkipBlanks();
    return word;
  }

  // The last word of the line, which the line then lacks.
  std::string_view LastWord(const char* what) {
    TrimEnd();
    if (AtEnd()) Fail("the end of the line", what);
    size_t length = 0;
    while (length < line_.size() &&
           !IsBlank(line_[line_.size() - 1 - length])) {
      ++length;
    }
    const std::string_view word = line_.substr(line_.size() - length);
    line_.remove_suffix(length);
    return word;
  }

  // The next word as a number; exact for what std::to_chars or 17 digits
  // wrote. Throws if it is none or out of range of T.
  template <typename T>
  T Number(const char* what) {
    const std::string_view word = Word(what);
    const std::optional<T> value = ParseNumber<T>(word);
    if (!value) Fail("\"" + std::string(word) + "\"", what);
    return *value;
  }

  // The rest of the line without the blanks at its ends.
  std::string_view Rest() {
    TrimEnd();
    return std::exchange(line_, {});
  }

  void ExpectEndOfLine(const char* after) {
    if (AtEnd()) return;
    Fail("\"" + std::string(Word(after)) + "\"",
         std::string("the end of the line after ") + after);
  }

  // Of the current line, from 1.
  size_t line_number() const { return line_number_; }

  // "images.txt:12: found ..., expected ...".
  [[noreturn]] void Fail(const std::string& found,
                         const std::string& expected) const {
    throw ModelError(file_.path + ":" + std::to_string(line_number_) +
                     ": found " + found + ", expected " + expected);
  }

  template <typename T>
  static std::optional<T> ParseNumber(std::string_view word) {
    // Streams take a plus sign.
    if (word.size() > 1 && word[0] == '+' && word[1] != '-') {
      word.remove_prefix(1);
    }
    return krot::ParseNumber<T>(word);
  }

 private:
  static bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

  void TrimEnd() {
    while (!line_.empty() && IsBlank(line_.back())) line_.remove_suffix(1);
  }

  void SkipBlanks() {
    size_t count = 0;
    while (count < line_.size() && IsBlank(line_[count])) ++count;
    line_.remove_prefix(count);
  }

  const FileBytes& file_;
  std::string_view remaining_;
  std::string_view line_;
  size_t line_number_ = 0;
};

}  // namespace krot
