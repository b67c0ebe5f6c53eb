#include "io/sibling_file.h"

#include "io/bytes.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct::io {

std::filesystem::path sibling_file(const std::filesystem::path& header, const std::string& name,
                                   const std::string& field) {
  // "./voxels.raw" is in the same folder too.
  const std::filesystem::path file = std::filesystem::path(name).lexically_normal();
  if (name.empty() || file != file.filename())
    throw InputError(header.string(), "'" + field + "' is " + in_quotes(name) +
                                          ", must name a file in the same folder");
  const std::filesystem::path sibling = behind_links(header).parent_path() / file;
  std::error_code error;
  if (std::filesystem::is_symlink(sibling, error) &&
      std::filesystem::weakly_canonical(sibling, error).parent_path() !=
          std::filesystem::weakly_canonical(sibling.parent_path(), error))
    throw InputError(header.string(), "'" + field + "' is " + in_quotes(name) +
                                          ", a link to another folder, must name a file in the "
                                          "same folder");
  try {
    read_prefix(sibling, 1);
  } catch (const InputError& unreadable) {
    throw InputError(header.string(),
                     "'" + field + "' is " + in_quotes(name) + ", which " + unreadable.violation());
  }
  return sibling;
}

}  // namespace usct::io
