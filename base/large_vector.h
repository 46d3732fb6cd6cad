#pragma once
// Memory for volumes.

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/parallel.h"

namespace isoshift {

// A vector of so many zeros. To get the pages of a large one from the kernel takes longer than to fill it: they are
// asked for in large pieces, and by all threads.
template <class T>
std::vector<T> large_vector(std::size_t count) {
  constexpr std::uintptr_t kLargePage = std::uintptr_t{2} << 20;
  std::vector<T> values;
  values.reserve(count);
  auto* begin = reinterpret_cast<std::byte*>(values.data());
  const auto address = reinterpret_cast<std::uintptr_t>(begin);
  const auto first = (address + kLargePage - 1) / kLargePage;
  const auto end = (address + count * sizeof(T)) / kLargePage;
  // Advice: where the kernel does not follow it, nothing but time is lost.
  const auto advise = [&](std::uintptr_t page, std::uintptr_t pages, int advice) {
    static_cast<void>(::madvise(begin + (page * kLargePage - address), pages * kLargePage, advice));
  };
  if (first < end) {
    advise(first, end - first, MADV_HUGEPAGE);
    parallel_for(first, end, [&](std::uintptr_t page) { advise(page, 1, MADV_POPULATE_WRITE); });
  }
  values.resize(count);
  return values;
}

}  // namespace isoshift
