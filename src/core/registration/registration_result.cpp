#include "us_ct_registration/registration/registration_result.h"

#include <array>
#include <utility>

#include "us_ct_registration/error.h"

namespace usct {
namespace {

constexpr std::array<std::pair<RegistrationStatus, const char*>, 5> kNames = {{
    {RegistrationStatus::kFailed, "failed"},
    {RegistrationStatus::kRegistered, "registered"},
    {RegistrationStatus::kLowConfidence, "low_confidence"},
    {RegistrationStatus::kNoOverlap, "no_overlap"},
    {RegistrationStatus::kCancelled, "cancelled"},
}};

}  // namespace

const char* status_name(RegistrationStatus status) {
  for (const auto& [known, name] : kNames)
    if (known == status) return name;
  return "failed";
}

RegistrationStatus parse_status(const std::string& name, const std::string& source) {
  std::string all;
  for (const auto& [status, known] : kNames) {
    if (name == known) return status;
    all += (all.empty() ? "" : ", ") + std::string(known);
  }
  throw InputError(source, "'status' is '" + name + "', must be one of " + all);
}

}  // namespace usct
