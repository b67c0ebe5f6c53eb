#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "core/io/file_size_limit.h"
#include "core/io/temporary_folder.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/atomic_file.h"

namespace usct {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;

void put(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }

std::string get(const fs::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::size_t file_count(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(AtomicFile, WritesTheTargetAndLeavesNothingElse) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "ct.nii.gz";
  put(target, "old");
  write_atomically(target, [&](const fs::path& temporary) {
    EXPECT_EQ(temporary.parent_path(), target.parent_path());
    EXPECT_NE(temporary, target);
    const std::string name = temporary.filename().string();
    EXPECT_EQ(name.substr(name.size() - 7), ".nii.gz");
    put(temporary, "new");
    EXPECT_EQ(get(target), "old");
  });
  EXPECT_EQ(get(target), "new");
  EXPECT_EQ(file_count(folder.path()), 1U);
}

TEST(AtomicFile, FailureOfTheWriterLeavesTheOldFileAndNoTemporary) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "result.json";
  put(target, "old");
  EXPECT_THROW(write_atomically(target,
                                [](const fs::path& temporary) {
                                  put(temporary, "half");
                                  throw std::runtime_error("disk full");
                                }),
               std::runtime_error);
  EXPECT_EQ(get(target), "old");
  EXPECT_EQ(file_count(folder.path()), 1U);
}

TEST(AtomicFile, AFullDiskIsNamedAsTheReason) {
  const TemporaryFolder folder;
  const fs::path target = folder.path() / "result.json";
  put(target, "old");
  try {
    const test::FileSizeLimit full(2);
    write_text(target, "new text");
    ADD_FAILURE() << "no error was thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(error.what(), target.string() + ": writing failed: File too large");
  }
  EXPECT_EQ(get(target), "old");
  EXPECT_EQ(file_count(folder.path()), 1U);
}

TEST(AtomicFile, WriterThatCreatesNothingIsAFailure) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_atomically(folder.path() / "a.txt", [](const fs::path&) {}),
               std::runtime_error);
  EXPECT_EQ(file_count(folder.path()), 0U);
}

TEST(AtomicFile, RefusesMissingFolderAndFolderAsTargetBeforeWriting) {
  const TemporaryFolder folder;
  const auto never = [](const fs::path&) { FAIL() << "must not be called"; };
  EXPECT_THROW(write_atomically(folder.path() / "missing" / "a.txt", never), InputError);
  EXPECT_THROW(write_atomically(folder.path(), never), InputError);
  put(folder.path() / "file", "");
  EXPECT_THROW(write_atomically(folder.path() / "file" / "a.txt", never), InputError);
  EXPECT_THROW(write_atomically("/proc/a.txt", never), InputError);
}

/// A rename would take the place of a device for all programs, and of a link in place of its file.
TEST(AtomicFile, ReplacesNeitherDevicesNorLinks) {
  const TemporaryFolder folder;
  const auto never = [](const fs::path&) { FAIL() << "must not be called"; };
  const fs::path pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(write_atomically(pipe, never), InputError);
  EXPECT_THROW(require_writable(pipe), InputError);
  EXPECT_TRUE(fs::is_fifo(pipe));
  const fs::path elsewhere = folder.path() / "elsewhere";
  fs::create_directory(elsewhere);
  for (const char* name : {"there.txt", "new.txt"}) {
    if (name == std::string("there.txt")) put(elsewhere / name, "old");
    const fs::path link = folder.path() / name;
    fs::create_symlink(fs::path("elsewhere") / name, link);
    write_text(link, "text");
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_EQ(get(elsewhere / name), "text");
  }
  fs::create_symlink(folder.path() / "loop", folder.path() / "loop");
  EXPECT_ANY_THROW(write_text(folder.path() / "loop", "text"));
}

}  // namespace
}  // namespace usct
