#pragma once

#include <string>

namespace usct::io {

/// Throws InputError unless `text` is an ISO 8601 time in UTC, `YYYY-MM-DDThh:mm:ssZ`, with or
/// without a fraction of the seconds.
void check_utc_time(const std::string& text, const std::string& source, const std::string& field);

}  // namespace usct::io
