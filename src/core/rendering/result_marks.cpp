#include "us_ct_registration/rendering/result_marks.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

#include "text.h"

namespace usct {
namespace {

const Picture::Colour kRefusedColour(225, 0, 0);
const Picture::Colour kHeaderColour(30, 30, 30);
constexpr int kLinePx = 24;
constexpr int kFrameWidthPx = 3;
/// Width of a letter of `draw_text`, generously.
constexpr int kLetterPx = 9;

void fill(Picture& picture, int left, int top, int width, int height,
          const Picture::Colour& colour) {
  for (int y = top; y < top + height; ++y)
    for (int x = left; x < left + width; ++x) std::copy_n(colour.data(), 3, picture.pixel(x, y));
}

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
  for (Picture& picture : panels) {
    const int px = std::min({kFrameWidthPx, picture.width, picture.height});
    fill(picture, 0, 0, picture.width, px, kRefusedColour);
    fill(picture, 0, picture.height - px, picture.width, px, kRefusedColour);
    fill(picture, 0, 0, px, picture.height, kRefusedColour);
    fill(picture, picture.width - px, 0, px, picture.height, kRefusedColour);
    draw_text(picture, "REFUSED", kTextMarginPx, picture.height - 2 * kTextMarginPx,
              kRefusedColour);
  }
}

Picture result_header(const RegistrationResult& result, int width) {
  const std::vector<std::string> lines =
      wrapped(headline(result),
              static_cast<std::size_t>(std::max(1, (width - 2 * kTextMarginPx) / kLetterPx)));
  Picture header(width, kLinePx * static_cast<int>(lines.size()));
  fill(header, 0, 0, header.width, header.height,
       is_refused(result) ? kRefusedColour : kHeaderColour);
  int bottom = 0;
  for (const std::string& line : lines)
    draw_text(header, line, kTextMarginPx, (bottom += kLinePx) - kTextMarginPx);
  return header;
}

}  // namespace usct
