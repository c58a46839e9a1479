#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/write_file.h"

namespace krot::internal {

// A checkpoint that cannot be used; what() is one sentence.
class CheckpointError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The steps that a run has completed, in their order. Runs are deterministic:
// one that was killed and is started again takes all its decisions again, comes
// to the same steps, and reads their results from here (RunStep). So it ends
// with the same bits. The base class stores nothing; ranks other than 0 use it.
class Checkpoint {
 public:
  virtual ~Checkpoint() = default;

  // The record of the next step; none once all completed steps were read.
  virtual std::optional<std::string> Next() { return std::nullopt; }

  // Adds a record after those that Next has returned. Throws WriteError if it
  // cannot be stored.
  virtual void Append(const std::string& /*record*/) {}
};

// Writes or reads the values that a step changes. One function names them, so
// that they are read in the order in which they were written. T holds no
// pointer.
class StepValues {
 public:
  // Writes. Where ranks share the points, all of them name the values together.
  explicit StepValues(Ranks* ranks) : ranks_(ranks) {}
  // Reads. Only the first rank has the record.
  StepValues(std::string record, Ranks* ranks)
      : ranks_(ranks), is_read_(true), record_(std::move(record)) {}

  // A value that is the same on every rank.
  template <typename T>
  void Value(T* value) {
    std::vector<Boxed<T>> boxed = {{*value}};
    Values(&boxed);
    if (is_read_) *value = boxed.at(0).value;
  }
  template <typename T>
  void Values(std::vector<T>* values) {
    OnFirst(values);
    if (is_read_ && ranks_ != nullptr) ranks_->Broadcast(values);
  }
  // A value that is present on all ranks or on none. If it is present,
  // `describe` names what it holds.
  template <typename T, typename Describe>
  void Optional(std::optional<T>* value, const Describe& describe) {
    bool is_there = value->has_value();
    Value(&is_there);
    if (!is_there) return value->reset();
    if (!*value) value->emplace();
    describe(&**value);
  }

  // A value per point, of which every rank has its share. The record is the
  // same at any number of ranks.
  template <typename T>
  void Shared(std::vector<T>* values) {
    if (ranks_ == nullptr) return OnFirst(values);
    if (!is_read_) {
      std::vector<T> all = ranks_->GatherOnFirst(*values);
      return OnFirst(&all);
    }
    const std::vector<int64_t> sizes = ranks_->Gather(
        std::vector<int64_t>{static_cast<int64_t>(values->size())});
    std::vector<std::vector<T>> to(ranks_->count());
    if (ranks_->IsFirst()) {
      std::vector<T> all;
      OnFirst(&all);
      auto begin = all.begin();
      for (int r = 0; r < ranks_->count(); ++r) {
        to[r].assign(begin, begin + sizes[r]);
        begin += sizes[r];
      }
    }
    *values = std::move(ranks_->ExchangeValues(std::move(to))[0]);
  }

  // The values of the first rank alone; reading gives them to it alone.
  template <typename T>
  void OnFirst(std::vector<T>* values) {
    if (ranks_ != nullptr && !ranks_->IsFirst()) return;
    auto size = static_cast<uint64_t>(values->size());
    Bytes(&size, sizeof(size));
    if (is_read_) {
      Require(size <= (record_.size() - offset_) / sizeof(T));
      values->resize(size);
    }
    if (size > 0) Bytes(values->data(), size * sizeof(T));
  }

  const std::string& record() const { return record_; }

  // Throws CheckpointError if the record holds more than was read.
  void RequireEnd() const { Require(offset_ == record_.size()); }

 private:
  static void Require(bool fits) {
    if (fits) return;
    throw CheckpointError(
        "the checkpoint is of another build of KROT: its steps hold other "
        "values; remove it");
  }
  void Bytes(void* bytes, size_t size) {
    if (!is_read_) {
      record_.append(static_cast<const char*>(bytes), size);
      return;
    }
    Require(size <= record_.size() - offset_);
    std::memcpy(bytes, record_.data() + offset_, size);
    offset_ += size;
  }

  Ranks* const ranks_;
  const bool is_read_ = false;
  std::string record_;
  size_t offset_ = 0;
};

// Runs a step. If the checkpoint has its record, the values that
// `describe(StepValues*)` names are read from it and nothing is computed.
// Otherwise the step is computed and, unless the run was interrupted, recorded;
// a record that cannot be stored does not end the run. Without a checkpoint
// (null) it only computes. Every rank must call it, all with a checkpoint or
// all without.
template <typename Compute, typename Describe>
void RunStep(Checkpoint* checkpoint, const Context& context,
             const Compute& compute, const Describe& describe) {
  if (checkpoint == nullptr) return compute();
  std::optional<std::string> record = checkpoint->Next();
  if (AnyRank(context, record.has_value())) {
    StepValues values(std::move(record).value_or(""), context.ranks);
    describe(&values);
    return values.RequireEnd();
  }
  compute();
  if (AnyRank(context, context.IsCancelled())) return;
  StepValues values(context.ranks);
  describe(&values);
  try {
    checkpoint->Append(values.record());
  } catch (const WriteError& error) {
    context.Note(std::string("going on without checkpoints: ") + error.what());
  }
}

}  // namespace krot::internal
