#pragma once

#ifdef __linux__
#include <sys/mman.h>
#endif

#include <cstddef>
#include <cstdlib>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace usct {

/// Allocator for memory with scattered accesses: large blocks are in pages of 2 MiB if the system
/// has them. With 4 KiB pages nearly every gather misses the TLB.
template <typename T>
struct LargePages {
  using value_type = T;

  LargePages() = default;
  template <typename U>
  LargePages(const LargePages<U>& /*other*/) {}  // NOLINT(google-explicit-constructor)

  T* allocate(std::size_t count) {
    constexpr std::size_t kPage = std::size_t{2} << 20;
    constexpr std::size_t kSmall = 64;
    std::size_t bytes = count * sizeof(T);
    const std::size_t alignment = bytes < kPage ? kSmall : kPage;
    bytes = (bytes + alignment - 1) / alignment * alignment;
    void* memory = std::aligned_alloc(alignment, bytes);
    if (memory == nullptr) throw std::bad_alloc();
#ifdef __linux__
    if (alignment == kPage) madvise(memory, bytes, MADV_HUGEPAGE);  // only a hint; may fail
#endif
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, std::size_t /*count*/) { std::free(memory); }

  /// Values without an initialiser stay uninitialised, so that the caller can write all of them
  /// from many threads.
  template <typename U>
  void construct(U* value) noexcept {
    static_assert(std::is_trivially_default_constructible_v<U>);
    ::new (static_cast<void*>(value)) U;
  }
  template <typename U, typename... Arguments>
  void construct(U* value, Arguments&&... arguments) {
    ::new (static_cast<void*>(value)) U(std::forward<Arguments>(arguments)...);
  }

  friend bool operator==(const LargePages&, const LargePages&) { return true; }
  friend bool operator!=(const LargePages&, const LargePages&) { return false; }
};

template <typename T>
using LargeVector = std::vector<T, LargePages<T>>;

}  // namespace usct
