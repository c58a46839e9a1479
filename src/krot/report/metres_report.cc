#include <cstdint>
#include <string>

#include "krot/report/report_json.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string Metres(double length) { return FormatLength(length) + " m"; }

}  // namespace

std::string PositionFrameSentence(const PositionFrame& frame) {
  const int64_t num_wrong = static_cast<int64_t>(frame.wrong.size());
  std::string text =
      std::to_string(frame.num_compared - num_wrong) + " of " +
      Counted(frame.num_compared, "position") + " agree with the model, to " +
      Metres(frame.median_distance) + " (median); a unit of the model is " +
      Metres(frame.own_from_model.scale);
  if (frame.radius) {
    text += "; every radius is " + Metres(*frame.radius) +
            ", from their scatter, as the file has none";
  } else if (frame.tolerance > 1) {
    text += "; the scatter is larger than the radii say, so up to " +
            FormatNumber(frame.tolerance, 1) + " radii count as agreement";
  }
  return text;
}

std::string WrongPositionSentence(const WrongPosition& wrong) {
  return "the position of " + wrong.name + " is " + Metres(wrong.distance) +
         " off, its radius is " + Metres(wrong.radius) + ": left out";
}

Json PositionFrameJson(const SolveReport& report) {
  if (!report.position_frame) return nullptr;
  const PositionFrame& frame = *report.position_frame;
  Json wrong = Json::array();
  for (const WrongPosition& position : frame.wrong) {
    wrong.push_back({{"name", position.name},
                     {"distance", position.distance},
                     {"radius", position.radius}});
  }
  const Similarity& own_from_model = frame.own_from_model;
  return {
      {"scale", own_from_model.scale},
      {"quaternion_wxyz", ToWxyz(Eigen::Quaterniond(own_from_model.rotation))},
      {"translation", VectorJson(own_from_model.translation)},
      {"is_written", report.is_in_position_frame},
      {"num_compared", frame.num_compared},
      {"median_distance", frame.median_distance},
      {"tolerance", frame.tolerance},
      {"radius", NumberOrNull(frame.radius)},
      {"wrong", std::move(wrong)}};
}

}  // namespace krot::internal
