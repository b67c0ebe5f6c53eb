#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "us_ct_registration/error.h"

namespace usct::test {

/// Fails unless `action` throws InputError whose message holds every one of `named`.
template <typename Action>
void expect_input_error(const Action& action, const std::vector<std::string>& named) {
  try {
    action();
    ADD_FAILURE() << "no error was thrown";
  } catch (const InputError& error) {
    const std::string message = error.what();
    for (const std::string& part : named)
      EXPECT_NE(message.find(part), std::string::npos)
          << "the message does not name \"" << part << "\": " << message;
  } catch (const std::exception& error) {
    ADD_FAILURE() << "not an InputError: " << error.what();
  }
}

}  // namespace usct::test
