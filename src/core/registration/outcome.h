#pragma once

#include <string>
#include <utility>
#include <variant>

#include "us_ct_registration/registration/registration_result.h"

namespace usct::registration {

/// The reason why a registration cannot go on; it becomes the result's status and message.
struct Refusal {
  RegistrationStatus status = RegistrationStatus::kFailed;
  std::string message;
};

/// The value that a step makes, or a refusal with the reason why it cannot.
template <typename T>
class Outcome {
 public:
  Outcome(T value) : content_(std::move(value)) {}            // NOLINT: a value is an outcome
  Outcome(Refusal refusal) : content_(std::move(refusal)) {}  // NOLINT: and so is a refusal

  explicit operator bool() const { return std::holds_alternative<T>(content_); }
  const T& operator*() const { return std::get<T>(content_); }
  const T* operator->() const { return &std::get<T>(content_); }
  T& operator*() { return std::get<T>(content_); }
  T* operator->() { return &std::get<T>(content_); }
  const Refusal& refusal() const { return std::get<Refusal>(content_); }

 private:
  std::variant<T, Refusal> content_;
};

}  // namespace usct::registration
