#pragma once

#include <Eigen/Core>
#include <locale>
#include <sstream>
#include <string>

#include "text.h"

/// Numbers in messages, with six significant digits and the same in any locale.
namespace usct::io {

inline std::string format(double value) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out << value;
  return out.str();
}

/// "a b c".
template <typename Derived>
std::string format(const Eigen::MatrixBase<Derived>& v) {
  std::string out;
  for (Eigen::Index i = 0; i < v.size(); ++i)
    out += (i > 0 ? " " : "") + format(static_cast<double>(v(i)));
  return out;
}

/// Numbers with as many digits as are needed to read the same numbers back.
template <typename Derived>
std::string format_exactly(const Eigen::MatrixBase<Derived>& v) {
  std::string out;
  for (Eigen::Index i = 0; i < v.size(); ++i)
    out += (i > 0 ? " " : "") + format_double(static_cast<double>(v(i)));
  return out;
}

}  // namespace usct::io
