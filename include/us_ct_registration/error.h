#pragma once

#include <stdexcept>
#include <string>

namespace usct {

/// Bad input: a file, option or value that violates a constraint.
///
/// The message reads "<source>: <violation>". `source` names the file or option; `violation` names
/// the field, its value and the constraint, for example
/// `sweep.nrrd: 'sample_spacing_mm' is -0.3, must be > 0`.
/// Command-line tools end with exit status 2 on it.
class InputError : public std::runtime_error {
 public:
  InputError(const std::string& source, const std::string& violation)
      : std::runtime_error(source + ": " + violation), source_(source), violation_(violation) {}

  const std::string& source() const { return source_; }
  const std::string& violation() const { return violation_; }

 private:
  std::string source_;
  std::string violation_;
};

}  // namespace usct
