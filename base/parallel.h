#pragma once
// Loops that run on all threads.

#include <tbb/parallel_for.h>

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

}  // namespace isoshift
