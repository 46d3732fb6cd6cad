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
  const auto first = (reinterpret_cast<std::uintptr_t>(values.data()) + kLargePage - 1) / kLargePage;
  const auto end = reinterpret_cast<std::uintptr_t>(values.data() + count) / kLargePage;
  // Advice: where the kernel does not follow it, nothing but time is lost.
  const auto advise = [](std::uintptr_t page, std::uintptr_t pages, int advice) {
    static_cast<void>(::madvise(reinterpret_cast<void*>(page * kLargePage), pages * kLargePage, advice));
  };
  if (first < end) {
    advise(first, end - first, MADV_HUGEPAGE);
    parallel_for(first, end, [&](std::uintptr_t page) { advise(page, 1, MADV_POPULATE_WRITE); });
  }
  values.resize(count);
  return values;
}

}  // namespace isoshift
