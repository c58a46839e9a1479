#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

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

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "COLMAP's binary files are read and written as they lie in "
              "memory, which must be little endian");

// Reads the packed little-endian values of a file in memory one after another.
// Every read is checked against the file's end and throws ModelError beyond it;
// `what` names in the message what was expected there ("the camera's width").
class BinaryReader {
 public:
  // Keeps a reference to `file`.
  explicit BinaryReader(const FileBytes& file) : file_(file) {}

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
    std::memcpy(values, file_.bytes.data() + offset_, num_bytes);
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
  std::string_view ReadString(const char* what) {
    const char* begin = file_.bytes.data() + offset_;
    const void* end = std::memchr(begin, '\0', BytesLeft());
    if (end == nullptr) {
      Fail(offset_, "no zero byte before the end of the file",
           std::string("one that ends ") + what);
    }
    const auto length =
        static_cast<size_t>(static_cast<const char*>(end) - begin);
    offset_ += length + 1;
    return {begin, length};
  }

  void ExpectEnd() const {
    if (BytesLeft() == 0) return;
    Fail(offset_,
         std::to_string(BytesLeft()) + " more bytes after the last record",
         "the end of the file");
  }

  // The offset of the next value; Fail takes it.
  size_t offset() const { return offset_; }

  // "cameras.bin, byte 12: found ..., expected ...".
  [[noreturn]] void Fail(size_t offset, const std::string& found,
                         const std::string& expected) const {
    throw ModelError(file_.path + ", byte " + std::to_string(offset) +
                     ": found " + found + ", expected " + expected);
  }

  size_t BytesLeft() const { return file_.bytes.size() - offset_; }

 private:
  [[noreturn]] void FailTruncated(size_t num_bytes, const char* what) const {
    Fail(offset_,
         "the end of the file after " + std::to_string(BytesLeft()) +
             " more bytes",
         std::to_string(num_bytes) + " bytes: " + what);
  }

  const FileBytes& file_;
  size_t offset_ = 0;
};

}  // namespace krot::internal
