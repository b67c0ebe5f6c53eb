#pragma once

#include <us_ct_registration/StatusCode.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

namespace usct::ros_interface {

/// The reason why a request cannot be fulfilled, as a StatusCode and in words. It is thrown where
/// the reason is found, and caught where the request is answered.
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

/// Why `work` could not be done, for those who ask later: a Refusal as it was thrown, an InputError
/// as INVALID_MESSAGE, and another exception as FAILED. Empty if it was done.
std::optional<Refusal> refusal_of(const std::function<void()>& work);

/// The name of a code as in StatusCode.msg, like "LOW_CONFIDENCE".
std::string code_name(std::uint8_t code);

}  // namespace usct::ros_interface
