#pragma once
// Loops that run on all threads.

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace isoshift {

#ifdef __SANITIZE_THREAD__
inline char before_loop = 0, after_loop = 0;  // their addresses are what the sanitizer is told of

// Tells it when a scope ends, also by an exception.
struct TellAtEnd {
  void (*tell)(void*);
  char& of;
  ~TellAtEnd() { tell(&of); }
};
#endif

// Calls work(n) for every n from `first` up to, but not including, `end`. Throws what a call throws.
//
// The thread sanitizer cannot look into TBB's library. It is told here what TBB promises: every call comes after what
// precedes the loop, and before what follows it. Two calls that touch the same memory remain a race.
template <class Index, class Work>
void parallel_for(Index first, Index end, const Work& work) {
#ifdef __SANITIZE_THREAD__
  const auto judged_work = [&](Index n) {
    __tsan_acquire(&before_loop);
    const TellAtEnd call{__tsan_release, after_loop};
    work(n);
  };
  __tsan_release(&before_loop);
  const TellAtEnd loop{__tsan_acquire, after_loop};
  tbb::parallel_for(first, end, judged_work);
#else
  tbb::parallel_for(first, end, work);
#endif
}

// The same for work that mostly waits, for other processes or for a disk: three calls at a time for every processor, so
// that a busy computer does not stand still between a process that ends and one that begins. No call is begun after one
// has thrown.
template <class Work>
void parallel_for_waiting(std::size_t end, const Work& work) {
  constexpr std::size_t kPerProcessor = 3;
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr failed;
  {
    std::vector<std::jthread> threads;
    const std::size_t count =
        std::min<std::size_t>(end, kPerProcessor * std::max(1U, std::thread::hardware_concurrency()));
    for (std::size_t n = 0; n < count; ++n)
      threads.emplace_back([&] {
        try {
          for (std::size_t index = next++; index < end; index = next++) work(index);
        } catch (...) {
          next = end;
          const std::lock_guard lock(mutex);
          if (!failed) failed = std::current_exception();
        }
      });
  }
  if (failed) std::rethrow_exception(failed);
}

}  // namespace isoshift
