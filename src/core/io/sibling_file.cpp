#include "io/sibling_file.h"

#include "text.h"
#include "us_ct_registration/error.h"

namespace usct::io {

std::filesystem::path sibling_file(const std::filesystem::path& header, const std::string& name,
                                   const std::string& field) {
  const std::filesystem::path file(name);
  if (name.empty() || file != file.filename())
    throw InputError(header.string(), "'" + field + "' is " + in_quotes(name) +
                                          ", must name a file in the same folder");
  return header.parent_path() / file;
}

}  // namespace usct::io
