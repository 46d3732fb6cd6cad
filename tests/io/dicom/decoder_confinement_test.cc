#include "io/dicom/decoder_confinement.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <functional>
#include <stdexcept>
#include <vector>

namespace isoshift::decoder_confinement_test {
namespace {

// How a process ends that is confined, and then does this: its status, or minus the signal that ended it.
int end_of(const std::function<void()>& action) {
  const pid_t child = ::fork();
  if (child == 0) {
    confine_decoder();
    action();
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
}

class DecoderConfinement : public testing::Test {
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers need system calls of their own";
#endif
  }
};

TEST_F(DecoderConfinement, MemoryExceptionsAndOpenSocketsAreLeft) {
  std::array<int, 2> sockets{};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, sockets.data()), 0);
  EXPECT_EQ(end_of([&] {
              std::vector<char> large(std::size_t{100} << 20, 'x');
              try {
                throw std::runtime_error("x");
              } catch (const std::exception&) {
                ::send(sockets[1], large.data(), 1, MSG_NOSIGNAL);
              }
            }),
            0);
  char received = 0;
  EXPECT_EQ(::recv(sockets[0], &received, 1, MSG_DONTWAIT), 1);
  for (const int socket : sockets) ::close(socket);
}

TEST_F(DecoderConfinement, FilesNetworkProgramsAndCodeAreNot) {
  EXPECT_EQ(end_of([] { ::open("/etc/hostname", O_RDONLY); }), -SIGSYS);
  EXPECT_EQ(end_of([] { ::socket(AF_INET, SOCK_STREAM, 0); }), -SIGSYS);
  EXPECT_EQ(end_of([] { ::execl("/bin/true", "true", nullptr); }), -SIGSYS);
  EXPECT_EQ(end_of([] { ::fork(); }), -SIGSYS);
  EXPECT_EQ(end_of([] { ::kill(1, 0); }), -SIGSYS);
  EXPECT_EQ(end_of([] { ::mmap(nullptr, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0); }), -SIGSYS);
}

TEST_F(DecoderConfinement, MemoryIsBounded) {
  EXPECT_EQ(end_of([] {
              try {
                const std::vector<char> huge(std::size_t{5} << 30);
              } catch (const std::bad_alloc&) {
                ::_exit(7);
              }
            }),
            7);
}

}  // namespace
}  // namespace isoshift::decoder_confinement_test
