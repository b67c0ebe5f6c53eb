#pragma once

#include <unistd.h>

#include <filesystem>
#include <stdexcept>

namespace usct::test {

/// While it lives, nobody may read the file: not even root, who is an ordinary user for as long.
class WithoutPermission {
 public:
  explicit WithoutPermission(std::filesystem::path file)
      : file_(std::move(file)), was_root_(::geteuid() == 0) {
    // The folder stays open to all, so that it is the file that refuses.
    using std::filesystem::perms;
    std::filesystem::permissions(
        file_.parent_path(),
        perms::group_read | perms::group_exec | perms::others_read | perms::others_exec,
        std::filesystem::perm_options::add);
    std::filesystem::permissions(file_, std::filesystem::perms::none);
    if (was_root_ && ::seteuid(kNobody) != 0) throw std::runtime_error("cannot cease to be root");
  }
  ~WithoutPermission() {
    if (was_root_ && ::seteuid(0) != 0) std::terminate();
    std::error_code ignored;
    std::filesystem::permissions(file_, std::filesystem::perms::owner_all, ignored);
  }
  WithoutPermission(const WithoutPermission&) = delete;
  WithoutPermission& operator=(const WithoutPermission&) = delete;

 private:
  static constexpr uid_t kNobody = 65534;
  std::filesystem::path file_;
  bool was_root_;
};

}  // namespace usct::test
