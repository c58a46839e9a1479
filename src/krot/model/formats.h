#pragma once

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/base/system.h"
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

// Reads the packed little-endian values of a file one after another. Every read
// is checked against the file's end and throws ModelError beyond it; `what`
// names in the message what was expected there ("the camera's width").
class BinaryReader {
 public:
  // Of a file in memory. Keeps a reference to `file`.
  explicit BinaryReader(const FileBytes& file)
      : path_(file.path), size_(file.bytes.size()), window_(file.bytes) {}
  // Of a file on the disk, with a mebibyte of it in memory. Throws ModelError
  // if that cannot be read.
  explicit BinaryReader(const std::filesystem::path& path);

  template <typename T>
  T Read(const char* what) {
    T value;
    ReadArray(&value, 1, what);
    return value;
  }

  // Fills values[0, count). The bytes are copied, so T must have no padding.
  template <typename T>
  void ReadArray(T* values, size_t count, const char* what) {
    static_assert(std::is_trivially_copyable_v<T>);
    const size_t num_bytes = count * sizeof(T);
    if (num_bytes > BytesLeft()) FailTruncated(num_bytes, what);
    if (num_bytes == 0) return;
    if (offset_ < begin_ || offset_ + num_bytes > begin_ + window_.size()) {
      MoveWindow(num_bytes);
    }
    std::memcpy(values, window_.data() + (offset_ - begin_), num_bytes);
    offset_ += num_bytes;
  }

  // Reads the number of records that follow, each of which takes
  // `min_record_bytes` or more. Fails if the rest of the file cannot hold so
  // many, so that memory may be reserved for them.
  template <typename Count>
  size_t ReadCount(size_t min_record_bytes, const char* what) {
    const size_t start = offset_;
    const Count count = Read<Count>(what);
    const size_t limit = BytesLeft() / min_record_bytes;
    if (count > limit) {
      Fail(start, std::string(what) + " = " + std::to_string(count),
           "at most " + std::to_string(limit) + " (" +
               std::to_string(BytesLeft()) + " bytes are left)");
    }
    return static_cast<size_t>(count);
  }

  // The characters up to the next '\0', which is skipped as well.
  std::string ReadString(const char* what);

  // Requires that there are so many bytes.
  void Skip(size_t num_bytes) { offset_ += num_bytes; }
  void Seek(size_t offset) { offset_ = offset; }
  void ExpectEnd() const;

  // The offset of the next value; Fail takes it.
  size_t offset() const { return offset_; }
  size_t BytesLeft() const { return size_ - offset_; }

  // "cameras.bin, byte 12: found ..., expected ...".
  [[noreturn]] void Fail(size_t offset, const std::string& found,
                         const std::string& expected) const;

 private:
  [[noreturn]] void FailTruncated(size_t num_bytes, const char* what) const;
  // Makes the next bytes part of the window.
  void MoveWindow(size_t num_bytes);

  const std::string path_;
  std::optional<FileDescriptor> file_;  // on the disk
  size_t size_ = 0;
  size_t offset_ = 0;
  size_t begin_ = 0;  // of the window, in the file
  std::string_view window_;
  std::string memory_;  // of the window of a file on the disk
};

// The smallest size of one record in bytes, with empty lists.
inline constexpr size_t kPoseBytes = 7 * sizeof(double);
inline constexpr size_t kImageBytes = 4 + kPoseBytes + 4 + 1 + 8;
inline constexpr size_t kPoint3DBytes = 8 + 24 + 3 + 8 + 8;

// Everything of an image but its 2D points; then these; and a 3D point with its
// track.
void ReadImageHead(BinaryReader* reader, Image* image);
void ReadPoints2D(BinaryReader* reader, std::vector<Point2D>* points2D);
void ReadPoint3D(BinaryReader* reader, Point3D* point,
                 std::vector<TrackElement>* track_elements);

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
