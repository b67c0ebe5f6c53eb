#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "core/io/temporary_folder.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/results/alignment_file.h"

namespace usct {
namespace {

using testing::HasSubstr;

StoredAlignment example() {
  Alignment alignment;
  alignment.fixed_frame = "base";
  alignment.us_stamp_ns = 1234567890123456789;
  alignment.ct_frame = "ct";
  alignment.T_fixed_ct = {{0.1, -1.0 / 3.0, 1e-9}, {0.5, 0.5, -0.5, 0.5}};
  alignment.accepted_ns = 1234567900000000005;
  alignment.expected_error_m = 0.0017;
  alignment.ct_crc32 = 4294967295U;
  alignment.covariance.diagonal() << 1e-6, 2e-6, 3e-6, 1.0 / 3.0, 5e-6, 6e-6;
  alignment.covariance(0, 4) = alignment.covariance(4, 0) = -1e-7;
  return {alignment, 17, "two parents"};
}

std::string text_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::string error_of(const std::filesystem::path& path) {
  try {
    read_alignment(path);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(AlignmentFile, ComesBackBitByBitAsRestored) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "alignment.json";
  write_alignment(example(), path);
  const StoredAlignment back = read_alignment(path);
  Alignment expected = *example().alignment;
  expected.restored = true;
  ASSERT_TRUE(back.alignment);
  EXPECT_TRUE(*back.alignment == expected);
  EXPECT_EQ(back.decided, 17U);
  EXPECT_EQ(back.suspended_because, "two parents");
}

TEST(AlignmentFile, AnUnknownErrorAndNoAlignmentComeBack) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "alignment.json";
  StoredAlignment stored = example();
  stored.alignment->expected_error_m = std::numeric_limits<double>::quiet_NaN();
  write_alignment(stored, path);
  EXPECT_TRUE(std::isnan(read_alignment(path).alignment->expected_error_m));
  stored.alignment.reset();
  write_alignment(stored, path);
  EXPECT_FALSE(read_alignment(path).alignment);
  EXPECT_EQ(read_alignment(path).decided, 17U);
}

TEST(AlignmentFile, NoFileIsNoAlignment) {
  const test::TemporaryFolder folder;
  EXPECT_FALSE(read_alignment(folder.path() / "none.json").alignment);
}

TEST(AlignmentFile, AFileCutOffAnywhereIsAnError) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "alignment.json";
  write_alignment(example(), path);
  const std::string whole = text_of(path);
  const std::size_t last_brace = whole.rfind('}');
  for (std::size_t length = 0; length <= last_brace; ++length) {
    std::ofstream(path) << whole.substr(0, length);
    EXPECT_THAT(error_of(path), HasSubstr(path.string() + ": is damaged")) << length;
  }
}

TEST(AlignmentFile, AnyDigitThatChangedIsAnError) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "alignment.json";
  write_alignment(example(), path);
  const std::string whole = text_of(path);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    if (std::isdigit(static_cast<unsigned char>(whole[i])) == 0) continue;
    std::string changed = whole;
    changed[i] = whole[i] == '9' ? '8' : static_cast<char>(whole[i] + 1);
    std::ofstream(path) << changed;
    EXPECT_THAT(error_of(path), HasSubstr(path.string() + ": is damaged")) << i;
  }
}

TEST(AlignmentFile, AFolderInItsPlaceAndAMissingFolderAreErrors) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(error_of(folder.path()), HasSubstr("cannot be read"));
  EXPECT_THROW(write_alignment(example(), folder.path() / "missing" / "alignment.json"),
               InputError);
}

TEST(AlignmentFile, AKeyGivenTwiceIsRefused) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "alignment.json";
  write_alignment(example(), path);
  const std::string whole = text_of(path);
  std::ofstream(path) << "{\"crc32\": 1," << whole.substr(1);
  EXPECT_THAT(error_of(path), HasSubstr(path.string() + ": key 'crc32' is given twice"));
}

TEST(AlignmentFile, DeepNestingIsDamage) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "alignment.json";
  constexpr int kLevels = 300000;
  std::ofstream(path) << "{\"crc32\": 1, \"content\": " << std::string(kLevels, '[')
                      << std::string(kLevels, ']') << "}";
  EXPECT_THAT(error_of(path), HasSubstr(path.string()));
  EXPECT_THAT(error_of(path), HasSubstr("nested too deeply"));
}

}  // namespace
}  // namespace usct
