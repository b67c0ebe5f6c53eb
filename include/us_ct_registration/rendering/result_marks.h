#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "us_ct_registration/registration/registration_result.h"
#include "us_ct_registration/rendering/picture.h"

/// What tells a registered pose from a refused one in pictures. A refused result is drawn at its
/// best candidate, and every such picture says so in red.
namespace usct {

inline bool is_refused(const RegistrationResult& result) { return !result.T_us_ct.has_value(); }

/// The pose to draw: the transform of a registration, or the best candidate of a refused one; unset
/// if there is neither.
std::optional<Eigen::Isometry3d> drawn_pose(const RegistrationResult& result);

/// The text in lines of at most `letters`, broken at blanks; a longer word has a line of its own.
std::vector<std::string> wrapped(const std::string& text, std::size_t letters);

/// Draws a red frame around each panel, and the word REFUSED into it, if the result was refused.
void mark_if_refused(std::vector<Picture>& panels, const RegistrationResult& result);

/// Header of a sheet: status, similarity, overlap and message of the result, in as many lines as
/// the width (pixels) needs. Its background is red if the result was refused.
Picture result_header(const RegistrationResult& result, int width);

}  // namespace usct
