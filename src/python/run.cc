#include "python/run.h"

#include <chrono>
#include <future>

#include <pybind11/pybind11.h>

namespace krot::internal {
namespace {

namespace py = pybind11;

// How often Python's signal handlers are called.
constexpr std::chrono::milliseconds kBetweenLooks(50);

}  // namespace

void RunInterruptibly(const std::function<void(const CancelFlag&)>& work) {
  CancelFlag cancel(false);
  std::future<void> done =
      std::async(std::launch::async, [&] { work(cancel); });
  bool is_interrupted = false;
  for (;;) {
    {
      const py::gil_scoped_release release;
      if (done.wait_for(kBetweenLooks) == std::future_status::ready) break;
    }
    if (!is_interrupted && PyErr_CheckSignals() != 0) {
      is_interrupted = true;
      cancel = true;
      // The error is kept until the work has ended, because its callbacks may
      // need Python.
      const py::error_already_set error;
      {
        const py::gil_scoped_release release;
        done.wait();
      }
      throw error;
    }
  }
  done.get();
}

}  // namespace krot::internal
