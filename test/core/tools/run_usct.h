#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "core/io/file_text.h"
#include "core/io/temporary_folder.h"
#include "test_paths.h"

namespace usct::test {

struct Outcome {
  int exit_status;
  std::string output;
  std::string errors;
};

/// Runs the real `usct` as a user would, through a shell.
inline Outcome run_usct(const std::vector<std::string>& arguments) {
  const TemporaryFolder streams;
  std::string command = "'" USCT_TOOL "'";
  for (const std::string& argument : arguments) command += " '" + argument + "'";
  command +=
      " >'" + (streams.path() / "out").string() + "' 2>'" + (streams.path() / "err").string() + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_text(streams.path() / "out"),
          read_text(streams.path() / "err")};
}

}  // namespace usct::test
