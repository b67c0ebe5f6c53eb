#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "module.h"

namespace usct::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// A package of which a file was lost, or that was installed in part.
TEST(Module, ThatIsMissingIsNamed) {
  try {
    load_module("no_such_part");
    FAIL() << "loaded what does not exist";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("us_ct_registration_core-"), HasSubstr("/no_such_part.so: "),
                      HasSubstr("cannot be loaded"), HasSubstr("No such file")));
  }
}

}  // namespace
}  // namespace usct::test
