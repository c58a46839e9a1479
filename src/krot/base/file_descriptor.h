#pragma once

#include <unistd.h>

namespace krot {

// An open file that closes itself when an exception passes by.
class FileDescriptor {
 public:
  explicit FileDescriptor(int value) : value_(value) {}
  ~FileDescriptor() {
    if (is_open()) ::close(value_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  bool is_open() const { return value_ >= 0; }
  int get() const { return value_; }
  // False, with errno, if what was written before did not arrive.
  bool Close() {
    const int value = value_;
    value_ = -1;
    return ::close(value) == 0;
  }

 private:
  int value_;
};

}  // namespace krot
