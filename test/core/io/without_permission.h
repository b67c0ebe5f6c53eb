#pragma once

#include <unistd.h>

#include <filesystem>
#include <stdexcept>

namespace usct::test {

/// Removes the permission to read a file for a scope. Root becomes an ordinary user meanwhile.
class WithoutPermission {
 public:
  explicit WithoutPermission(std::filesystem::path file)
      : file_(std::move(file)), was_root_(::geteuid() == 0) {
    // The folder stays readable, so that only the file is refused.
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
