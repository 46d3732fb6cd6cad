#pragma once
// An HTTP/1.1 server for one handler, with TLS where asked for. Only this file's source knows Boost.Beast.
//
//   HttpServer server({.address = "127.0.0.1", .port = 8443}, [](const HttpRequest& request) { ... });
//   server.run([&] { return end.is_asked_for(); });

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "io/config/serve_file.h"
#include "serve/http_message.h"

namespace isoshift {

struct HttpServerOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;  // 0: any that is free
  std::optional<ServeFile::Tls> tls;
  std::size_t most_connections = 256;                  // any more are closed at once
  std::size_t most_of_address = 64;                    // likewise, from one address
  std::size_t most_header = 16384, most_body = 65536;  // bytes of a request
  std::chrono::milliseconds patience{10000};           // for a whole request, from its first byte or the last answer
  std::chrono::milliseconds idle{60000};               // for the next request on a connection
  int threads = 4;                                     // that call the handler
};

class HttpServer {
 public:
  // Listens from now on. Throws Error if the address cannot be used, or a certificate or key cannot be read.
  HttpServer(const HttpServerOptions& options, HttpHandler handler);
  ~HttpServer();

  std::uint16_t port() const;

  // Answers until the end is asked for. The handler is called from several threads. What it throws is answered with
  // status 500, without a word of the error: that goes to `complain`, one at a time. A browser may close its connection
  // at any time: the signal SIGPIPE is ignored from then on.
  void run(
      const std::function<bool()>& is_end_asked_for,
      const std::function<void(const std::string&)>& complain = [](const std::string&) {});

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isoshift
