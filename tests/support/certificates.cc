#include "tests/support/certificates.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <thread>
#include <utility>

#include "base/output_folder.h"
#include "tests/support/command.h"

namespace isoshift {
namespace {

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

}  // namespace

Certificates::Certificates(std::filesystem::path folder) : folder_(std::move(folder)) { make_authority("ca"); }

bool Certificates::can_be_made() { return run_shell("command -v openssl").exit_status == 0; }

void Certificates::openssl(const std::string& words) const {
  const CommandOutcome outcome = run_shell(fmt::format("cd {} && openssl {}", folder_.string(), words));
  ASSERT_EQ(outcome.exit_status, 0) << outcome.out;
}

void Certificates::make_authority(const std::string& name) const {
  openssl(fmt::format("req -x509 -newkey rsa:2048 -nodes -days 2 -subj '/CN={0}' -keyout {0}.key -out {0}.pem", name));
}

void Certificates::make(const std::string& name, const std::string& subject, const std::string& names,
                        const std::string& authority) const {
  openssl(fmt::format("req -newkey rsa:2048 -nodes -subj '/CN={1}' -keyout {0}.key -out {0}.csr", name, subject));
  write_text(folder_ / (name + ".ext"), names.empty() ? "" : "subjectAltName=" + names);
  openssl(fmt::format(
      "x509 -req -days 2 -in {0}.csr -CA {1}.pem -CAkey {1}.key -CAcreateserial -extfile {0}.ext -out {0}.pem", name,
      authority));
}

std::string Certificates::fingerprint(const std::string& name) const {
  constexpr std::size_t kDigits = 64;
  return run_shell(fmt::format("openssl x509 -in {}/{}.pem -outform DER | sha256sum", folder_.string(), name))
      .out.substr(0, kDigits);
}

std::uint16_t free_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address = loopback(0);
  socklen_t size = sizeof(address);
  ::bind(socket, reinterpret_cast<sockaddr*>(&address), size);
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(socket);
  return ntohs(address.sin_port);
}

void wait_for_listener(std::uint16_t port) {
  const sockaddr_in address = loopback(port);
  for (int n = 0; n < 100; ++n) {
    const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
    const bool is_there = ::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    ::close(socket);
    if (is_there) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

}  // namespace isoshift
