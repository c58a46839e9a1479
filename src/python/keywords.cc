#include "python/keywords.h"

#include <string>
#include <vector>

namespace krot::internal {
namespace {

namespace py = pybind11;

std::string TextOf(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "1" : "0";
  return py::str(value);
}

// The option that the keyword means. If there is none, the keyword itself, so
// that the table reports what is wrong with it.
std::string FullName(const std::string& keyword, const OptionTable& table) {
  std::string found;
  for (const Option& option : table.options()) {
    const size_t dot = option.name.find('.');
    if (dot == std::string::npos || option.name.substr(dot + 1) != keyword) {
      continue;
    }
    if (!found.empty()) {
      throw OptionError(keyword + " may be " + found + " or " + option.name +
                        ": give the whole name in `options`");
    }
    found = option.name;
  }
  return found.empty() ? keyword : found;
}

}  // namespace

void AssignKeywords(const py::dict& keywords, OptionTable* table) {
  std::vector<OptionAssignment> assignments;
  for (const auto& [key, value] : keywords) {
    const std::string name = FullName(py::str(key), *table);
    assignments.push_back({name, TextOf(value), name});
  }
  table->Assign(assignments);
  table->RequireAll();
}

}  // namespace krot::internal
