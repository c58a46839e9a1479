#include "krot/report/html_page.h"

#include <map>
#include <string_view>

#include <Eigen/Core>

#include "krot/report/html_model_view.h"
#include "krot/report/html_page_template.h"

namespace krot::internal {
namespace {

// JSON holds '<' in strings only. Written as an escape there, no text in it
// can end the element that holds it, or begin a comment.
std::string EscapeForScript(const std::string& json) {
  std::string escaped;
  escaped.reserve(json.size());
  for (const char character : json) {
    if (character == '<') {
      escaped += "\\u003c";
    } else {
      escaped += character;
    }
  }
  return escaped;
}

// `text` with every {{name}} replaced by its value. What a value holds is not
// looked at.
std::string FillTemplate(
    std::string_view text,
    const std::map<std::string_view, std::string>& values) {
  std::string filled;
  for (size_t at = 0;;) {
    const size_t begin = text.find("{{", at);
    filled += text.substr(at, begin - at);
    if (begin == std::string_view::npos) return filled;
    const size_t end = text.find("}}", begin);
    filled += values.at(text.substr(begin + 2, end - begin - 2));
    at = end + 2;
  }
}

}  // namespace

std::string HtmlPage(const std::string& report_json, const Model& before,
                     const Model& after, int num_threads,
                     const std::string& crops_json) {
  const Eigen::Vector3d origin = SceneOrigin(before);
  const auto view = [&](const Model& model) {
    return ModelViewJson(model, origin, kMaxShownPoints, num_threads);
  };
  return FillTemplate(
      kHtmlPageTemplate,
      {{"report", EscapeForScript(report_json)},
       {"crops", EscapeForScript(crops_json)},
       {"models", EscapeForScript("{\"before\":" + view(before) +
                                  ",\"after\":" + view(after) + "}")}});
}

}  // namespace krot::internal
