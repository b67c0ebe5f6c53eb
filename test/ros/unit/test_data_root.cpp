#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "core/io/temporary_folder.h"
#include "ros/node/data_root.h"

namespace usct::ros_interface {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

/// root/ct.nrrd, root/case/slice_1.dcm, outside/secret.nrrd, and links between them.
class DataRootTest : public testing::Test {
 protected:
  DataRootTest() {
    fs::create_directories(root_ / "case");
    fs::create_directories(folder_.path() / "rooted");
    fs::create_directories(outside_);
    for (const fs::path& file : {root_ / "ct.nrrd", root_ / "case" / "slice_1.dcm",
                                 outside_ / "secret.nrrd", folder_.path() / "rooted" / "ct.nrrd"})
      std::ofstream(file) << "x";
  }

  DataRoot root() const { return {root_, "~data_root"}; }

  std::string refusal_of(const std::string& given) const {
    try {
      root().resolve(given, "path");
    } catch (const PathRefused& error) {
      return error.what();
    } catch (const InputError& error) {
      return "input error: " + std::string(error.what());
    }
    return "no refusal";
  }

  test::TemporaryFolder folder_;
  fs::path root_ = fs::canonical(folder_.path()) / "root";
  fs::path outside_ = fs::canonical(folder_.path()) / "outside";
};

TEST_F(DataRootTest, PathsBelowItAreResolved) {
  EXPECT_EQ(root().resolve("ct.nrrd", "path"), root_ / "ct.nrrd");
  EXPECT_EQ(root().resolve("case/../ct.nrrd", "path"), root_ / "ct.nrrd");
  EXPECT_EQ(root().resolve((root_ / "case").string(), "path"), root_ / "case");
  EXPECT_EQ(root().resolve(".", "path"), root_);
  fs::create_symlink("ct.nrrd", root_ / "link.nrrd");
  EXPECT_EQ(root().resolve("link.nrrd", "path"), root_ / "ct.nrrd");
}

TEST_F(DataRootTest, TheRootItselfMayBeALink) {
  fs::create_directory_symlink(root_, folder_.path() / "link");
  EXPECT_EQ(DataRoot(folder_.path() / "link", "~data_root").resolve("ct.nrrd", "path"),
            root_ / "ct.nrrd");
}

TEST_F(DataRootTest, PathsOutsideAreRefusedWhetherTheyExistOrNot) {
  for (const std::string& given :
       {(outside_ / "secret.nrrd").string(), (outside_ / "missing.nrrd").string(),
        std::string("../outside/secret.nrrd"), std::string("case/../../outside/secret.nrrd"),
        std::string("missing/../../outside/secret.nrrd"), std::string("../rooted/ct.nrrd"),
        std::string(".."), std::string("/"), std::string("/proc/self/environ")}) {
    const std::string refusal = refusal_of(given);
    EXPECT_THAT(refusal, HasSubstr("'path' is '" + given + "', must lie below the data root"));
    if (given.front() != '/') {
      EXPECT_THAT(refusal, Not(HasSubstr(folder_.path().string())));
    }
  }
}

TEST_F(DataRootTest, LinksThatLeadOutAreRefused) {
  fs::create_symlink(outside_ / "secret.nrrd", root_ / "file.nrrd");
  fs::create_directory_symlink(outside_, root_ / "folder");
  fs::create_symlink("file.nrrd", root_ / "link_to_link.nrrd");
  for (const char* given :
       {"file.nrrd", "folder", "folder/secret.nrrd", "folder/missing.nrrd", "link_to_link.nrrd"})
    EXPECT_THAT(refusal_of(given), HasSubstr("must lie below the data root"));
}

TEST_F(DataRootTest, NewFilesLieBelowItAsWell) {
  EXPECT_EQ(root().resolve_new("new.png", "path"), root_ / "new.png");
  EXPECT_EQ(root().resolve_new("ct.nrrd", "path"), root_ / "ct.nrrd");
  EXPECT_EQ(root().resolve_new("case/../missing/new.png", "path"), root_ / "missing" / "new.png");
  fs::create_directory_symlink(outside_, root_ / "folder");
  for (const char* given : {"../new.png", "/tmp/new.png", "folder/new.png", "missing/../../x.png"})
    EXPECT_THROW(root().resolve_new(given, "path"), PathRefused) << given;
}

TEST_F(DataRootTest, LinksInAFolderOrBesideAFileOfSeveralAreRefused) {
  fs::create_symlink(outside_ / "secret.nrrd", root_ / "case" / "slice_2.dcm");
  std::ofstream(root_ / "case" / "alone.nrrd") << "x";
  std::ofstream(root_ / "case" / "header.nhdr") << "x";
  for (const char* given : {"case", ".", "case/slice_1.dcm", "case/header.nhdr"})
    EXPECT_THAT(refusal_of(given), HasSubstr("a link that leads out of the data root"));
  EXPECT_EQ(refusal_of("case/alone.nrrd"), "no refusal") << "it is read alone";
}

TEST_F(DataRootTest, WhatIsNotThereAndWhatIsNoFileAreErrors) {
  EXPECT_EQ(refusal_of("missing.nrrd"), "input error: missing.nrrd: does not exist");
  EXPECT_EQ(refusal_of(""), "input error: 'path': is empty");
  ASSERT_EQ(::mkfifo((root_ / "pipe.nrrd").c_str(), 0600), 0);
  EXPECT_EQ(refusal_of("pipe.nrrd"), "input error: pipe.nrrd: is neither a folder nor a file");
  EXPECT_EQ(refusal_of(std::string("ct.nrrd\0.dcm", 12)), "input error: 'path': has a zero byte");
}

TEST_F(DataRootTest, ARootThatIsNoFolderIsAnError) {
  const auto why = [](const fs::path& root) {
    try {
      DataRoot(root, "~data_root");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  const std::string missing = (root_ / "missing").string();
  EXPECT_EQ(why(missing),
            "~data_root: is '" + missing + "', which cannot be opened: No such file or directory");
  EXPECT_THAT(why(root_ / "ct.nrrd"), HasSubstr("must be a folder"));
  EXPECT_EQ(why("relative"), "~data_root: is 'relative', must be the whole path of a folder");
}

TEST_F(DataRootTest, MessagesHaveNoNameThatTheCallerDidNotGive) {
  std::ofstream(root_ / "case" / "ROE_RICHARDA.dcm") << "x";
  fs::create_directories(root_ / "case" / "PAT-77031");
  std::ofstream(root_ / "case" / "PAT-77031" / "1") << "x";
  const fs::path path = root_ / "case";
  const std::string shown = without_names(
      (path / "ROE_RICHARDA.dcm").string() + ": ends early; also: slice_1.dcm, ROE_RICHARDA.dcm, " +
          (path / "PAT-77031" / "1").string() + "; 1 of 3 slices in " + path.string(),
      path, "the/case");
  for (const char* name : {"ROE", "77031", "slice_1"}) EXPECT_THAT(shown, Not(HasSubstr(name)));
  EXPECT_THAT(shown, Not(HasSubstr(root_.string())));
  EXPECT_THAT(shown, HasSubstr("file 3: ends early; also: file 4, file 3, file 2; "
                               "1 of 3 slices in the/case"));
}

TEST_F(DataRootTest, MessagesKeepTheNameThatTheCallerGave) {
  std::ofstream(root_ / "ct") << "x";
  const fs::path path = root_ / "ct.nrrd";
  EXPECT_EQ(without_names(path.string() + ": is cut off", path, "ct.nrrd"), "ct.nrrd: is cut off");
  const fs::path missing = root_ / "no" / "sheet.png";
  EXPECT_EQ(without_names(
                missing.string() + ": folder '" + missing.parent_path().string() + "' is not there",
                missing, "no/sheet.png"),
            "no/sheet.png: folder 'no' is not there");
}

/// Before a request has a path, nothing can be found in a text, and least of all everywhere.
TEST_F(DataRootTest, MessagesWithoutAPathStayAsTheyAre) {
  EXPECT_EQ(without_names("'path': is empty", "", ""), "'path': is empty");
  EXPECT_EQ(without_names("'path': is empty", root_, ""), "'path': is empty");
}

}  // namespace
}  // namespace usct::ros_interface
