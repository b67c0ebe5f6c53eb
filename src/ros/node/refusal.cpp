#include "ros/node/refusal.h"

#include <map>

#include "us_ct_registration/error.h"

namespace usct::ros_interface {

using Status = us_ct_registration::StatusCode;

std::optional<Refusal> refusal_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Refusal& refusal) {
    return refusal;
  } catch (const InputError& error) {
    return Refusal(Status::INVALID_MESSAGE, error.what());
  } catch (const std::exception& error) {
    return Refusal(Status::FAILED, error.what());
  }
  return std::nullopt;
}

std::string code_name(std::uint8_t code) {
  static const std::map<std::uint8_t, std::string> kNames = {
      {Status::FAILED, "FAILED"},
      {Status::OK, "OK"},
      {Status::REGISTERED, "REGISTERED"},
      {Status::LOW_CONFIDENCE, "LOW_CONFIDENCE"},
      {Status::NO_OVERLAP, "NO_OVERLAP"},
      {Status::CANCELLED, "CANCELLED"},
      {Status::NO_CT, "NO_CT"},
      {Status::NO_ULTRASOUND, "NO_ULTRASOUND"},
      {Status::NO_INITIAL_ALIGNMENT, "NO_INITIAL_ALIGNMENT"},
      {Status::TF_UNAVAILABLE, "TF_UNAVAILABLE"},
      {Status::TF_STALE, "TF_STALE"},
      {Status::TF_JUMPED, "TF_JUMPED"},
      {Status::INVALID_MESSAGE, "INVALID_MESSAGE"},
      {Status::UNKNOWN_PRESET, "UNKNOWN_PRESET"},
      {Status::INVALID_REQUEST, "INVALID_REQUEST"},
      {Status::ULTRASOUND_OUTDATED, "ULTRASOUND_OUTDATED"},
      {Status::PATH_REFUSED, "PATH_REFUSED"},
      {Status::FILE_ERROR, "FILE_ERROR"},
      {Status::BUSY, "BUSY"},
      {Status::NOTHING_TO_DECIDE, "NOTHING_TO_DECIDE"},
      {Status::NOT_RUNNING, "NOT_RUNNING"},
  };
  const auto found = kNames.find(code);
  return found == kNames.end() ? std::to_string(code) : found->second;
}

}  // namespace usct::ros_interface
