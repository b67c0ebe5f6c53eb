#pragma once

#include <us_ct_registration/StatusCode.h>

#include <cstdint>
#include <stdexcept>
#include <string>

namespace usct::ros_interface {

/// Why a request cannot be fulfilled, as a StatusCode and in words: thrown by what finds out,
/// answered by whoever was asked.
class Refusal : public std::runtime_error {
 public:
  Refusal(std::uint8_t code, const std::string& message)
      : std::runtime_error(message), code_(code) {}

  std::uint8_t code() const { return code_; }

  us_ct_registration::StatusCode status() const {
    us_ct_registration::StatusCode status;
    status.code = code_;
    status.message = what();
    return status;
  }

 private:
  std::uint8_t code_;
};

/// "LOW_CONFIDENCE" and so on, as in StatusCode.msg.
std::string code_name(std::uint8_t code);

}  // namespace usct::ros_interface
