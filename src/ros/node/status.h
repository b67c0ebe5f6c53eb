#pragma once

#include <us_ct_registration/StatusCode.h>

#include <string>

namespace usct::ros_interface {

/// A StatusCode of a code and a message.
inline us_ct_registration::StatusCode status(std::uint8_t code, const std::string& message) {
  us_ct_registration::StatusCode answer;
  answer.code = code;
  answer.message = message;
  return answer;
}

}  // namespace usct::ros_interface
