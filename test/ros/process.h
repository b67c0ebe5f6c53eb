#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace usct::ros_interface {

/// A node as a process of its own, interrupted at the end of the test.
class Process {
 public:
  Process(const std::string& name, const std::vector<std::string>& arguments) {
    // Test programs and nodes lie in the same folder.
    std::string program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
    std::vector<std::string> texts(arguments);
    std::vector<char*> argv{program.data()};
    for (std::string& text : texts) argv.push_back(text.data());
    argv.push_back(nullptr);
    std::array<int, 2> ends{};
    if (::pipe(ends.data()) != 0) throw std::runtime_error("no pipe");
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::dup2(ends[1], STDERR_FILENO);
      ::close(ends[0]);
      ::execv(program.c_str(), argv.data());
      ::_exit(127);
    }
    ::close(ends[1]);
    output_ = ::fdopen(ends[0], "r");
  }
  ~Process() {
    if (pid_ > 0) {
      ::kill(pid_, SIGINT);
      ::waitpid(pid_, nullptr, 0);
    }
    std::fclose(output_);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Output of the node until it ends by itself, and its exit status.
  std::pair<std::string, int> end() {
    std::string output;
    std::array<char, 256> part{};
    while (std::fgets(part.data(), static_cast<int>(part.size()), output_) != nullptr)
      output += part.data();
    int status = 0;
    ::waitpid(pid_, &status, 0);
    pid_ = -1;
    return {output, WEXITSTATUS(status)};
  }

 private:
  pid_t pid_ = -1;
  FILE* output_ = nullptr;
};

}  // namespace usct::ros_interface
