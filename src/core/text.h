#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Numbers and words in text files, independent of the locale.
namespace usct {

std::string_view trimmed(std::string_view text);

/// The words between blanks.
std::vector<std::string_view> words(std::string_view text);

/// The parts between separators; one more than there are separators.
std::vector<std::string_view> split(std::string_view text, char separator);

/// Letters of ASCII in lower case.
std::string lower_case(std::string_view text);

/// Text for a message: in quotes, long text cut, unprintable bytes replaced.
std::string in_quotes(std::string_view text, std::size_t longest = 60);

/// Throws InputError, naming `field`, unless the whole text is one finite number.
double parse_double(std::string_view text, const std::string& source, const std::string& field);

/// Throws InputError, naming `field`, unless every word is a finite number.
std::vector<double> parse_doubles(std::string_view text, const std::string& source,
                                  const std::string& field);

/// Throws InputError, naming `field`, unless the whole text is one integer that fits.
int parse_int(std::string_view text, const std::string& source, const std::string& field);

/// The shortest text that reads back as the same double.
std::string format_double(double value);

/// The numbers separated by blanks.
std::string format_doubles(const std::vector<double>& values);

}  // namespace usct
