#include "io/utc_time.h"

#include <regex>

#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {

void check_utc_time(const std::string& text, const std::string& source, const std::string& field) {
  static const std::regex kForm(
      R"(\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])T([01]\d|2[0-3]):[0-5]\d:([0-5]\d|60)(\.\d{1,9})?Z)");
  constexpr std::size_t kLongest = 40;  // std::regex recurses once per character
  if (text.size() > kLongest || !std::regex_match(text, kForm))
    throw InputError(source, "'" + field + "' is " + in_quotes(text) +
                                 ", must be ISO 8601 in UTC, such as 2024-05-17T09:30:00Z");
}

}  // namespace usct::io
