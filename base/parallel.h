#pragma once
// Loops that run on all threads.

#include <tbb/parallel_for.h>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace isoshift {

// Calls work(n) for every n from `first` up to, but not including, `end`. Throws what a call throws.
//
// The thread sanitizer cannot look into TBB's library. It is told here what TBB promises: every call comes after what
// precedes the loop, and before what follows it. Two calls that touch the same memory remain a race.
template <class Index, class Work>
void parallel_for(Index first, Index end, const Work& work) {
#ifdef __SANITIZE_THREAD__
  char begin = 0, done = 0;
  __tsan_release(&begin);
  tbb::parallel_for(first, end, [&](Index n) {
    __tsan_acquire(&begin);
    work(n);
    __tsan_release(&done);
  });
  __tsan_acquire(&done);
#else
  tbb::parallel_for(first, end, work);
#endif
}

}  // namespace isoshift
