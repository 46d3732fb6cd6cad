#include "serve/http_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <thread>

#include "base/error.h"
#include "tests/support/certificates.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::http_server_test {
namespace {

using namespace std::chrono_literals;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

// What any program may send to the port.
class Connection {
 public:
  explicit Connection(std::uint16_t port, const char* from = "127.0.0.1") : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in own{.sin_family = AF_INET};
    ::inet_pton(AF_INET, from, &own.sin_addr);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof own), 0);
    sockaddr_in address{.sin_family = AF_INET, .sin_port = htons(port)};
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const timeval patience{.tv_sec = 10};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  }
  ~Connection() { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void send(const std::string& text) const { (void)!::send(socket_, text.data(), text.size(), MSG_NOSIGNAL); }
  // Up to this text, or all until the server closes the connection.
  std::string read(const std::string& until = "") const {
    std::string all;
    std::array<char, 4096> some{};
    while (until.empty() || all.find(until) == std::string::npos) {
      const ssize_t count = ::recv(socket_, some.data(), some.size(), 0);
      if (count <= 0) break;
      all.append(some.data(), static_cast<std::size_t>(count));
    }
    return all;
  }

 private:
  int socket_;
};

class HttpServerTest : public testing::Test {
 protected:
  ~HttpServerTest() override { is_over_ = true; }
  std::string answer(const std::string& request) const {
    const Connection connection(server_.port());
    connection.send(request);
    return connection.read();
  }
  HttpResponse handled(const HttpRequest& request) {
    if (request.path == "/throws") throw std::runtime_error("a secret of the server");
    if (request.path == "/events")
      return {.events = [this]() -> std::optional<std::string> {
        if (events_ > 2) return std::nullopt;
        return std::to_string(events_.load());
      }};
    return {.type = "text/plain",
            .body = fmt::format("{} {} [{}] from {}", request.method, request.path, request.body, request.from)};
  }

  std::atomic<bool> is_over_ = false;
  std::atomic<int> events_ = 0;
  std::string complaint_;
  HttpServer server_{{.most_connections = 20, .most_body = 100, .patience = 700ms, .idle = 700ms},
                     [this](const HttpRequest& request) { return handled(request); }};
  std::jthread running_{[this] {
    server_.run([this] { return is_over_.load(); }, [this](const std::string& trouble) { complaint_ = trouble; });
  }};
};

TEST_F(HttpServerTest, TellsTheHandlerWhatWasAskedFor) {
  const std::string text =
      answer("POST /a%20b?c=d HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\nConnection: close\r\n\r\nbody");
  EXPECT_THAT(text, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(text, EndsWith("\r\n\r\nPOST /a b [body] from 127.0.0.1"));
  EXPECT_THAT(text, HasSubstr("Content-Security-Policy: default-src 'none'; script-src 'self'"));
  EXPECT_THAT(text, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(text, HasSubstr("X-Content-Type-Options: nosniff"));
  EXPECT_THAT(text, HasSubstr("Cache-Control: no-store"));
}

TEST_F(HttpServerTest, AConnectionServesSeveralRequests) {
  const Connection connection(server_.port());
  connection.send("GET /1 HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(connection.read("127.0.0.1"), HasSubstr("GET /1"));
  connection.send("GET /2 HTTP/1.1\r\nHost: x\r\n\r\nGET /3 HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  const std::string rest = connection.read();
  EXPECT_THAT(rest, HasSubstr("GET /2"));
  EXPECT_THAT(rest, HasSubstr("GET /3"));
}

TEST_F(HttpServerTest, RefusesWhatIsNoRequestOrTooLarge) {
  EXPECT_THAT(answer("what is this\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(answer("GET /%zz HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(answer("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 101\r\n\r\n"), StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(answer("GET / HTTP/1.1\r\nHost: x\r\nX: " + std::string(20000, 'x') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431"));
}

TEST_F(HttpServerTest, ErrorsOfTheServerStayThere) {
  const std::string text = answer("GET /throws HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(text, StartsWith("HTTP/1.1 500"));
  EXPECT_EQ(text.find("secret"), std::string::npos);
  EXPECT_EQ(complaint_, "GET /throws: a secret of the server");
}

// Who sends a byte now and then holds no place for long.
TEST_F(HttpServerTest, SlowRequestsAreCutOff) {
  const Connection connection(server_.port());
  const auto begin = std::chrono::steady_clock::now();
  std::jthread dripping([&](const std::stop_token& stop) {
    for (int n = 0; n < 600 && !stop.stop_requested(); ++n) {
      connection.send("G");
      std::this_thread::sleep_for(100ms);
    }
  });
  connection.read();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 50s) << "as long as the bytes came";
}

TEST_F(HttpServerTest, MoreConnectionsThanAllowedAreClosedAndTheRestIsServed) {
  std::vector<std::unique_ptr<Connection>> held;
  for (int n = 0; n < 200; ++n) held.push_back(std::make_unique<Connection>(server_.port()));
  EXPECT_EQ(held.back()->read(), "");  // at once, or when its time is over
  held.clear();
  std::string served;  // once those that were held are closed
  for (int n = 0; n < 100 && served.empty(); ++n) {
    std::this_thread::sleep_for(100ms);
    served = answer("GET /again HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  }
  EXPECT_THAT(served, HasSubstr("GET /again"));
}

TEST_F(HttpServerTest, OneAddressDoesNotTakeAllConnections) {
  constexpr std::size_t kMost = 8;
  std::atomic<bool> is_over = false;
  HttpServer server({.most_connections = 20, .most_of_address = kMost},
                    [](const HttpRequest&) { return HttpResponse{.body = "served"}; });
  const std::jthread running([&] { server.run([&] { return is_over.load(); }); });
  std::vector<std::unique_ptr<Connection>> held;
  for (std::size_t n = 0; n < kMost + 4; ++n) held.push_back(std::make_unique<Connection>(server.port()));
  EXPECT_EQ(held.back()->read(), "") << "closed at once";
  const std::string question = "GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
  const Connection from_elsewhere(server.port(), "127.0.0.2");
  from_elsewhere.send(question);
  EXPECT_THAT(from_elsewhere.read(), EndsWith("served"));
  held[0]->send(question);
  EXPECT_THAT(held[0]->read(), EndsWith("served"));
  is_over = true;
}

TEST_F(HttpServerTest, EventsComeAsTheyHappenAndEnd) {
  const Connection connection(server_.port());
  connection.send("GET /events HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(connection.read("data: 0\n\n"), HasSubstr("Content-Type: text/event-stream"));
  events_ = 1;
  EXPECT_EQ(connection.read("\n\n"), "data: 1\n\n");
  events_ = 3;
  EXPECT_EQ(connection.read(), "");
}

// A client nobody of this project wrote.
TEST(HttpServerWithTls, SpeaksToWhoKnowsItsAuthority) {
  if (!Certificates::can_be_made()) GTEST_SKIP() << "openssl is not installed";
  const TemporaryFolder folder;
  const Certificates certificates(folder.path());
  certificates.make_authority("ca");
  certificates.make_authority("other");
  certificates.make("server", "/CN=localhost", "DNS:localhost,IP:127.0.0.1");
  HttpServer server(
      {.tls = ServeFile::Tls{folder / "server.pem", folder / "server.key"}, .patience = 2s},
      [](const HttpRequest& request) { return HttpResponse{.body = request.is_encrypted ? "encrypted" : "plain"}; });
  std::atomic<bool> is_over = false;
  const std::jthread running([&] { server.run([&] { return is_over.load(); }); });
  const auto answer = [&](const std::string& authority, const std::string& more = "") {
    return run_shell(fmt::format("printf 'GET / HTTP/1.1\\r\\nHost: localhost\\r\\nConnection: close\\r\\n\\r\\n' | "
                                 "timeout 10 openssl s_client -quiet -verify_return_error -verify_hostname localhost "
                                 "-CAfile {} {} -connect 127.0.0.1:{} 2>&1",
                                 (folder / authority).string(), more, server.port()))
        .out;
  };
  EXPECT_THAT(answer("ca.pem"), HasSubstr("encrypted"));
  EXPECT_THAT(answer("ca.pem"), HasSubstr("Strict-Transport-Security: max-age="));
  EXPECT_THAT(answer("other.pem"), Not(HasSubstr("encrypted")));
  EXPECT_THAT(answer("ca.pem", "-tls1_1"), Not(HasSubstr("encrypted")));
  // Who speaks without encryption learns nothing.
  const Connection plain(server.port());
  plain.send("GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_THAT(plain.read(), Not(HasSubstr("plain")));
  is_over = true;
}

TEST(HttpServerWithTls, SaysWhatIsWrongWithItsFiles) {
  const TemporaryFolder folder;
  try {
    const HttpServer server({.tls = ServeFile::Tls{folder / "no.pem", folder / "no.key"}}, {});
    FAIL() << "it began";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no.pem"));
  }
  const HttpServer first({}, {});
  EXPECT_THROW(HttpServer({.port = first.port()}, {}), Error);
}

}  // namespace
}  // namespace isoshift::http_server_test
