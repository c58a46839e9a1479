#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// COLMAP's binary files (docs/formats.md): little endian, packed, without magic
// number or version. Bytes that COLMAP 3.8 to 4.x wrote are reproduced exactly.
//
// Parse... replaces its part of the model. Throws ModelError with the byte
// offset if the file is truncated, or holds a count larger than itself, an
// unknown camera model, or bytes after its last record. Format... returns the
// file's content. O(bytes), a few GB/s.

void ParseCamerasBinary(const FileBytes& file, Model* model);
void ParseRigsBinary(const FileBytes& file, Model* model);
void ParseFramesBinary(const FileBytes& file, Model* model);
void ParseImagesBinary(const FileBytes& file, Model* model);
void ParsePoints3DBinary(const FileBytes& file, Model* model);

std::string FormatCamerasBinary(const Model& model);
std::string FormatRigsBinary(const Model& model);
std::string FormatFramesBinary(const Model& model);
std::string FormatImagesBinary(const Model& model);
std::string FormatPoints3DBinary(const Model& model);

// COLMAP's text files (docs/formats.md). Numbers are written with the fewest
// digits that restore the same bits; a NaN keeps its sign but not its payload.
// An image's name is the rest of its line and may contain blanks.
//
// Parse... replaces its part of the model. Throws ModelError with the line, the
// word found and what was expected. Text has no counts of records:
// ValidateModel finds duplicates and gaps. Format... returns the file's
// content. Throws WriteError for what text cannot hold: an unknown camera model
// or sensor type, and a name with line breaks or with blanks at its ends.
// O(bytes), some 100 MB/s.

void ParseCamerasText(const FileBytes& file, Model* model);
void ParseRigsText(const FileBytes& file, Model* model);
void ParseFramesText(const FileBytes& file, Model* model);
void ParseImagesText(const FileBytes& file, Model* model);
void ParsePoints3DText(const FileBytes& file, Model* model);

std::string FormatCamerasText(const Model& model);
std::string FormatRigsText(const Model& model);
std::string FormatFramesText(const Model& model);
std::string FormatImagesText(const Model& model);
std::string FormatPoints3DText(const Model& model);

// The text without the byte order mark that Windows editors put in front.
// Throws ModelError for UTF-16, which PowerShell writes.
inline std::string_view WithoutByteOrderMark(const FileBytes& file) {
  std::string_view text = file.bytes;
  const std::string_view mark = text.substr(0, 2);
  if (mark == "\xff\xfe" || mark == "\xfe\xff") {
    throw ModelError(file.path +
                     ": found UTF-16, expected UTF-8; save it as UTF-8 text");
  }
  if (text.substr(0, 3) == "\xef\xbb\xbf") text.remove_prefix(3);
  return text;
}

// Reads a text file in memory line by line, and the current line word by word.
// Words are separated by spaces and tabs; a line may end with CR LF; a byte
// order mark is skipped. Errors are ModelErrors that name the file, the line,
// the word found and, from `what`, what was expected ("the x of a 2D point").
class TextReader {
 public:
  // Keeps a reference to `file`.
  explicit TextReader(const FileBytes& file)
      : file_(file), remaining_(WithoutByteOrderMark(file)) {}

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
      if (!AtEnd() && !IsComment()) return true;
    }
    return false;
  }

  // Whether this line is a comment.
  bool IsComment() const { return !AtEnd() && line_.front() == '#'; }

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

  // The next word as a number; exact for what std::to_chars wrote, or 17
  // digits. Throws if it is not a number or out of T's range.
  template <typename T>
  T Number(const char* what) {
    const std::string_view word = Word(what);
    const std::optional<T> value = ParseNumber<T>(word);
    if (!value) FailAtNumber<T>(word, what);
    return *value;
  }

  // Throws what Number throws for a word that is not a number.
  template <typename T>
  [[noreturn]] void FailAtNumber(std::string_view word,
                                 const std::string& what) const {
    const bool has_comma = word.find(',') != std::string_view::npos;
    std::string range;
    if constexpr (std::is_integral_v<T>) {
      using Limits = std::numeric_limits<T>;
      if (ParseNumber<double>(word)) {
        range = ", an integer from " + std::to_string(Limits::min()) + " to " +
                std::to_string(Limits::max());
      }
    }
    Fail("\"" + std::string(word) + "\"",
         what + range +
             (has_comma ? "; write numbers with a decimal point, without commas"
                        : ""));
  }

  // The rest of the line, without blanks at its ends.
  std::string_view Rest() {
    while (!line_.empty() && IsBlank(line_.back())) line_.remove_suffix(1);
    return std::exchange(line_, {});
  }

  void ExpectEndOfLine(const char* after) {
    if (AtEnd()) return;
    Fail("\"" + std::string(Word(after)) + "\"",
         std::string("the end of the line after ") + after);
  }

  // The number of the current line, from 1.
  size_t line_number() const { return line_number_; }

  // "images.txt:12: found ..., expected ...".
  [[noreturn]] void Fail(const std::string& found,
                         const std::string& expected) const {
    throw ModelError(file_.path + ":" + std::to_string(line_number_) +
                     ": found " + found + ", expected " + expected);
  }

  static bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

  template <typename T>
  static std::optional<T> ParseNumber(std::string_view word) {
    // Like a C++ stream, accepts a plus sign in front.
    if (word.size() > 1 && word[0] == '+' && word[1] != '-') {
      word.remove_prefix(1);
    }
    const std::optional<T> value = internal::ParseNumber<T>(word);
    if constexpr (std::is_integral_v<T>) {
      if (!value) return ParseWhole<T>(word);
    }
    return value;
  }

 private:
  // An integer that is written as a real number, like "1000.0", if a double
  // holds it exactly.
  template <typename T>
  static std::optional<T> ParseWhole(std::string_view word) {
    const std::optional<double> real = internal::ParseNumber<double>(word);
    if (!real || std::trunc(*real) != *real || std::abs(*real) >= 0x1p53 ||
        *real < static_cast<double>(std::numeric_limits<T>::min()) ||
        *real > static_cast<double>(std::numeric_limits<T>::max())) {
      return std::nullopt;
    }
    return static_cast<T>(*real);
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

}  // namespace krot::internal
