#include "ros/conversions/registration_result.h"

#include <limits>
#include <map>

#include "ros/conversions/poses.h"

namespace usct::ros_interface {
namespace {

namespace msg = us_ct_registration;

std::uint8_t status_code(RegistrationStatus status) {
  switch (status) {
    case RegistrationStatus::kFailed:
      return msg::StatusCode::FAILED;
    case RegistrationStatus::kRegistered:
      return msg::StatusCode::REGISTERED;
    case RegistrationStatus::kLowConfidence:
      return msg::StatusCode::LOW_CONFIDENCE;
    case RegistrationStatus::kNoOverlap:
      return msg::StatusCode::NO_OVERLAP;
    case RegistrationStatus::kCancelled:
      return msg::StatusCode::CANCELLED;
  }
  return msg::StatusCode::FAILED;
}

RegistrationStatus status_from(std::uint8_t code) {
  for (const RegistrationStatus status :
       {RegistrationStatus::kRegistered, RegistrationStatus::kLowConfidence,
        RegistrationStatus::kNoOverlap, RegistrationStatus::kCancelled})
    if (status_code(status) == code) return status;
  return RegistrationStatus::kFailed;
}

std::vector<msg::Measure> to_messages(const std::map<std::string, double>& numbers) {
  std::vector<msg::Measure> messages;
  for (const auto& [name, value] : numbers) {
    msg::Measure measure;
    measure.name = name;
    measure.value = value;
    messages.push_back(measure);
  }
  return messages;
}

void fill_measures(const Measures& measures, msg::RegistrationResult& message) {
  constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  message.measures = to_messages(by_name(measures));
  message.wrong_probability = measures.wrong_probability.value_or(kNotKnown);
  message.expected_error = measures.expected_error_mm.value_or(kNotKnown) / kMmPerM;
  message.error_bound = measures.error_bound_mm.value_or(kNotKnown) / kMmPerM;
}

}  // namespace

msg::RegistrationResult to_message(const RegistrationResult& result) {
  msg::RegistrationResult message;
  message.status.code = status_code(result.status);
  message.status.message = result.message;
  if (result.T_us_ct) message.transform = to_message(*result.T_us_ct);
  if (result.covariance) message.covariance = covariance_to_message(*result.covariance);
  message.similarity = result.similarity;
  message.overlap = result.overlap;
  for (const RegistrationCandidate& candidate : result.candidates) {
    msg::RegistrationCandidate one;
    one.transform = to_message(candidate.T_us_ct);
    one.similarity = candidate.similarity;
    one.overlap = candidate.overlap;
    message.candidates.push_back(one);
  }
  fill_measures(result.measures, message);
  message.durations = to_messages(result.seconds);
  message.evaluations = static_cast<std::uint32_t>(result.evaluations);
  message.version = result.version;
  return message;
}

RegistrationResult registration_result_from(const msg::RegistrationResult& message,
                                            const std::string& source) {
  RegistrationResult result;
  result.status = status_from(message.status.code);
  result.message = message.status.message;
  if (result.status == RegistrationStatus::kRegistered)
    result.T_us_ct = from_message_mm(message.transform, source);
  result.similarity = message.similarity;
  result.overlap = message.overlap;
  for (const msg::RegistrationCandidate& one : message.candidates)
    result.candidates.push_back(
        {from_message_mm(one.transform, source), one.similarity, one.overlap});
  std::map<std::string, double> measures;
  for (const msg::Measure& measure : message.measures) measures[measure.name] = measure.value;
  result.measures = measures_from(measures, source);
  result.evaluations = static_cast<int>(message.evaluations);
  result.version = message.version;
  return result;
}

}  // namespace usct::ros_interface
