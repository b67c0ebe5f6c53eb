#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

namespace usct::ros_interface {

/// Hands values from one thread to another that may be slower: only the newest one waits.
template <typename T>
class NewestSlot {
 public:
  /// Replaces a value that waits, which is then dropped.
  void put(T value) {
    {
      const std::lock_guard lock(mutex_);
      if (value_) ++dropped_;
      value_ = std::move(value);
    }
    changed_.notify_one();
  }

  /// Waits for a value; empty once the slot is closed.
  std::optional<T> take() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_closed_ || value_; });
    if (is_closed_) return std::nullopt;
    return std::exchange(value_, std::nullopt);
  }

  /// Forgets the value that waits.
  void clear() {
    const std::lock_guard lock(mutex_);
    value_.reset();
  }

  void close() {
    {
      const std::lock_guard lock(mutex_);
      is_closed_ = true;
    }
    changed_.notify_all();
  }

  std::uint32_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<T> value_;
  std::uint32_t dropped_ = 0;
  bool is_closed_ = false;
};

}  // namespace usct::ros_interface
