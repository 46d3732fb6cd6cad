#include "io/dicom/decoder_confinement.h"

#include <fmt/format.h>
#include <seccomp.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "base/error.h"

namespace isoshift {
namespace {

constexpr rlim_t kMaxCpuS = 10;  // of a frame: the largest takes about one
constexpr rlim_t kMaxMemoryBytes = rlim_t{4} << 30;

void limit_resources() {
  const auto limit = [](auto resource, rlim_t most) {
    const rlimit value{.rlim_cur = most, .rlim_max = most};
    if (::setrlimit(resource, &value) != 0)
      throw Error(fmt::format("the decoder of compressed pixels cannot be confined: {}", std::strerror(errno)));
  };
  limit(RLIMIT_AS, kMaxMemoryBytes);
  limit(RLIMIT_FSIZE, 0);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, kMaxCpuS);
}

void limit_system_calls() {
  const auto check = [](int failed) {
    if (failed != 0)
      throw Error(fmt::format("the decoder of compressed pixels cannot be confined: {}", std::strerror(-failed)));
  };
  const std::unique_ptr<void, decltype(&seccomp_release)> filter(seccomp_init(SCMP_ACT_KILL_PROCESS), &seccomp_release);
  if (!filter) check(-ENOMEM);
  // What memory, sockets that are open, time, exceptions, abort() and the end need.
  for (const int call : {SCMP_SYS(brk), SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(madvise), SCMP_SYS(futex),
                         SCMP_SYS(sendto), SCMP_SYS(poll), SCMP_SYS(ppoll), SCMP_SYS(clock_gettime), SCMP_SYS(getpid),
                         SCMP_SYS(gettid), SCMP_SYS(tgkill), SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask),
                         SCMP_SYS(rt_sigreturn), SCMP_SYS(restart_syscall), SCMP_SYS(exit), SCMP_SYS(exit_group)})
    check(seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 0));
  // Memory, but none that can be run.
  for (const int call : {SCMP_SYS(mmap), SCMP_SYS(mprotect)})
    check(seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)));
  check(seccomp_load(filter.get()));
}

}  // namespace

void confine_decoder() {
  // The sanitizers of addresses and threads need all addresses there are, and system calls of their own.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  limit_resources();
  limit_system_calls();
#endif
}

}  // namespace isoshift
