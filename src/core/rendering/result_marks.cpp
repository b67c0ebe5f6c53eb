#include "us_ct_registration/rendering/result_marks.h"

#include <cmath>
#include <sstream>
#include <string>

#include "rendering/panel_marks.h"
#include "text.h"

namespace usct {
namespace {

const Picture::Colour kRefusedColour(225, 0, 0);

std::string headline(const RegistrationResult& result) {
  std::ostringstream text;
  text.precision(3);
  if (is_refused(result))
    text << "REFUSED (" << status_name(result.status) << "), "
         << (result.candidates.empty() ? "no candidate to draw"
                                       : "drawn: the best candidate, NOT a registration");
  else
    text << "registered";
  if (std::isfinite(result.similarity)) text << ", similarity " << result.similarity;
  if (std::isfinite(result.overlap)) text << ", overlap " << result.overlap;
  text << ". " << result.message;
  return text.str();
}

}  // namespace

std::optional<Eigen::Isometry3d> drawn_pose(const RegistrationResult& result) {
  if (result.T_us_ct) return result.T_us_ct;
  if (!result.candidates.empty()) return result.candidates.front().T_us_ct;
  return std::nullopt;
}

std::vector<std::string> wrapped(const std::string& text, std::size_t letters) {
  std::vector<std::string> lines;
  for (const std::string_view word : words(text)) {
    if (lines.empty() || lines.back().size() + 1 + word.size() > letters)
      lines.emplace_back(word);
    else
      lines.back().append(" ").append(word);
  }
  return lines;
}

void mark_if_refused(std::vector<Picture>& panels, const RegistrationResult& result) {
  if (!is_refused(result)) return;
  for (Picture& picture : panels) rendering::draw_frame(picture, "REFUSED", kRefusedColour);
}

Picture result_header(const RegistrationResult& result, int width) {
  rendering::TextStyle style;
  if (is_refused(result)) style.background = kRefusedColour;
  return rendering::text_block(headline(result), width, style);
}

}  // namespace usct
