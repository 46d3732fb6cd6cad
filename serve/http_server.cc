#include "serve/http_server.h"

#include <fmt/format.h>
#include <openssl/ssl.h>

#include <algorithm>
#include <cctype>
#include <csignal>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

// Boost 1.74 uses std::exchange and does not include it: <utility> stands before it.
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>

#include "base/error.h"

namespace isoshift {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;

constexpr std::chrono::milliseconds kLookForEvents(200);

// Everything comes from here, nothing is kept, and no other site may show or use it.
constexpr std::pair<const char*, const char*> kHeaders[] = {
    {"Content-Security-Policy",
     "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; frame-src "
     "'self'; form-action "
     "'self'; frame-ancestors 'none'; base-uri 'none'"},
    {"X-Content-Type-Options", "nosniff"},
    {"X-Frame-Options", "DENY"},
    {"Referrer-Policy", "no-referrer"},
    {"Cross-Origin-Opener-Policy", "same-origin"},
    {"Cross-Origin-Resource-Policy", "same-origin"},
    {"Cache-Control", "no-store"}};

template <class Message>
void set_headers(const HttpResponse& response, bool is_encrypted, Message& message) {
  message.set(http::field::server, "isoshift");
  message.set(http::field::content_type, response.type);
  for (const auto& [name, value] : kHeaders) message.set(name, value);
  if (is_encrypted) message.set("Strict-Transport-Security", "max-age=31536000");
  for (const auto& [name, value] : response.headers) message.set(name, value);
}

HttpRequest request_of(const http::request<http::string_body>& message, const std::string& from, bool is_encrypted) {
  const auto text = [](beast::string_view view) { return std::string(view.data(), view.size()); };
  HttpRequest request{.method = text(message.method_string()),
                      .path = "",
                      .headers = {},
                      .body = message.body(),
                      .from = from,
                      .is_encrypted = is_encrypted};
  const std::string target = text(message.target());
  request.path = url_decoded(std::string_view(target).substr(0, target.find('?')));
  for (const auto& field : message) {
    std::string name = text(field.name_string());
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    std::string& value = request.headers[name];
    value += (value.empty() ? "" : name == "cookie" ? "; " : ", ") + text(field.value());
  }
  return request;
}

// Whether what arrived is no request that can be answered, and the other end is still there.
bool is_of_request(const boost::system::error_code& failed) {
  return failed.category() == make_error_code(http::error::bad_method).category() &&
         failed != http::error::end_of_stream && failed != http::error::partial_message;
}

int status_of(const boost::system::error_code& failed) {
  return failed == http::error::body_limit ? 413 : failed == http::error::header_limit ? 431 : 400;
}

}  // namespace

class HttpServer::Implementation {
 public:
  Implementation(const HttpServerOptions& options, HttpHandler handler)
      : options_(options), handler_(std::move(handler)), acceptor_(io_) {
    try {
      if (options.tls) {
        tls_.set_options(net::ssl::context::default_workarounds | net::ssl::context::no_sslv2 |
                         net::ssl::context::no_sslv3 | net::ssl::context::no_tlsv1 | net::ssl::context::no_tlsv1_1);
        tls_.use_certificate_chain_file(options.tls->certificate.string());
        tls_.use_private_key_file(options.tls->key.string(), net::ssl::context::pem);
      }
    } catch (const boost::system::system_error& error) {
      throw Error(fmt::format("{} and {}: cannot be used as certificate and key: {}", options.tls->certificate.string(),
                              options.tls->key.string(), error.what()));
    }
    try {
      const net::ip::tcp::endpoint endpoint(net::ip::make_address(options.address), options.port);
      acceptor_.open(endpoint.protocol());
      acceptor_.set_option(net::socket_base::reuse_address(true));
      acceptor_.bind(endpoint);
      acceptor_.listen();
    } catch (const boost::system::system_error& error) {
      throw Error(fmt::format("{}:{}: cannot be listened to: {}", options.address, options.port, error.what()));
    }
  }

  std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

  void run(const std::function<bool()>& is_end_asked_for, const std::function<void(const std::string&)>& complain) {
    std::signal(SIGPIPE, SIG_IGN);
    complain_ = [this, complain](const std::string& trouble) {
      const std::lock_guard lock(complaining_);
      complain(trouble);
    };
    net::co_spawn(io_, accept(), net::detached);
    std::vector<std::jthread> threads;
    threads.reserve(static_cast<std::size_t>(options_.threads));
    for (int n = 0; n < options_.threads; ++n) threads.emplace_back([this] { io_.run(); });
    constexpr std::chrono::milliseconds kRound(50);
    while (!is_end_asked_for()) std::this_thread::sleep_for(kRound);
    io_.stop();
  }

 private:
  using Stream = beast::tcp_stream;
  using TlsStream = beast::ssl_stream<beast::tcp_stream>;

  // The connections that are open, by address.
  struct Open {
    std::mutex mutex;
    std::size_t count = 0;
    std::map<std::string, std::size_t> of_address;
  };

  // One of them, if there is room for it.
  class Place {
   public:
    Place(Open& open, const std::string& from, const HttpServerOptions& options) : open_(open), from_(from) {
      const std::lock_guard lock(open_.mutex);
      const auto own = open_.of_address.find(from_);
      is_free_ = open_.count < options.most_connections &&
                 (own == open_.of_address.end() || own->second < options.most_of_address);
      if (!is_free_) return;
      ++open_.count;
      ++open_.of_address[from_];
    }
    ~Place() {
      if (!is_free_) return;
      const std::lock_guard lock(open_.mutex);
      --open_.count;
      if (--open_.of_address[from_] == 0) open_.of_address.erase(from_);
    }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    bool is_free() const { return is_free_; }
    const std::string& from() const { return from_; }

   private:
    Open& open_;
    std::string from_;
    bool is_free_ = false;
  };

  net::awaitable<void> accept() {
    for (;;) {
      boost::system::error_code failed;
      net::ip::tcp::socket socket =
          co_await acceptor_.async_accept(net::make_strand(io_), net::redirect_error(net::use_awaitable, failed));
      if (failed) {  // too many open files, for one: try again a little later
        net::steady_timer pause(io_, kLookForEvents);
        co_await pause.async_wait(net::use_awaitable);
        continue;
      }
      // Places are given out in the order in which connections came.
      const net::ip::tcp::endpoint from = socket.remote_endpoint(failed);
      if (failed) continue;  // it has gone already
      auto place = std::make_unique<Place>(open_, from.address().to_string(), options_);
      if (!place->is_free()) continue;  // closes it
      const auto executor = socket.get_executor();
      // If the other end has gone, is too slow or does not speak HTTP, there is nobody to tell.
      net::co_spawn(executor, speak(std::move(socket), std::move(place)), [](const std::exception_ptr&) {});
    }
  }

  net::awaitable<void> speak(net::ip::tcp::socket socket, std::unique_ptr<const Place> place) {
    if (!options_.tls) {
      Stream stream(std::move(socket));
      co_await answer(stream, stream, place->from());
    } else {
      TlsStream stream(std::move(socket), tls_);
      stream.next_layer().expires_after(options_.patience);
      co_await stream.async_handshake(net::ssl::stream_base::server, net::use_awaitable);
      co_await answer(stream, stream.next_layer(), place->from());
    }
  }

  // `socket`: the layer of the stream that keeps the time.
  template <class S>
  net::awaitable<void> answer(S& stream, Stream& socket, const std::string& from) {
    beast::flat_buffer buffer;
    for (bool is_first = true;; is_first = false) {
      http::request_parser<http::string_body> parser;
      parser.header_limit(static_cast<std::uint32_t>(options_.most_header));
      parser.body_limit(options_.most_body);
      socket.expires_after(is_first || buffer.size() > 0 ? options_.patience : options_.idle);
      boost::system::error_code failed;
      if (!is_first && buffer.size() == 0) {
        const std::size_t read = co_await stream.async_read_some(buffer.prepare(4096), net::use_awaitable);
        buffer.commit(read);
        socket.expires_after(options_.patience);
      }
      co_await http::async_read(stream, buffer, parser, net::redirect_error(net::use_awaitable, failed));
      socket.expires_after(options_.patience);
      if (failed && !is_of_request(failed)) break;
      const bool keep = !failed && parser.get().keep_alive();
      // A name of its own: GCC 12 destroys a temporary twice in an expression with co_await.
      HttpResponse response = failed ? HttpResponse{.status = status_of(failed)} : handled(parser.get(), from);
      socket.expires_after(options_.patience);
      if (response.events) {
        co_await write_events(stream, socket, response);
        break;
      }
      co_await write(stream, std::move(response), keep);
      if (!keep) break;
    }
    socket.socket().shutdown(net::ip::tcp::socket::shutdown_send);
  }

  HttpResponse handled(const http::request<http::string_body>& message, const std::string& from) {
    HttpRequest request;
    try {
      request = request_of(message, from, options_.tls.has_value());
    } catch (const Error&) {
      return {.status = 400};
    }
    try {
      return handler_(request);
    } catch (const std::exception& error) {
      complain_(fmt::format("{} {}: {}", request.method, request.path, error.what()));
      return {.status = 500};
    }
  }

  template <class S>
  net::awaitable<void> write(S& stream, HttpResponse response, bool keep) {
    http::response<http::string_body> message(static_cast<http::status>(response.status), 11);
    set_headers(response, options_.tls.has_value(), message);
    message.keep_alive(keep);
    message.body() = std::move(response.body);
    message.prepare_payload();
    co_await http::async_write(stream, message, net::use_awaitable);
  }

  std::optional<std::string> event_of(const HttpResponse& response) {
    try {
      return response.events();
    } catch (const std::exception& error) {
      complain_(fmt::format("a stream of events: {}", error.what()));
      return std::nullopt;
    }
  }

  template <class S>
  net::awaitable<void> write_events(S& stream, Stream& socket, const HttpResponse& response) {
    http::response<http::empty_body> message(http::status::ok, 11);
    set_headers({.type = "text/event-stream", .body = "", .headers = response.headers, .events = {}},
                options_.tls.has_value(), message);
    message.keep_alive(false);
    http::response_serializer<http::empty_body> serializer(message);
    co_await http::async_write_header(stream, serializer, net::use_awaitable);
    net::steady_timer timer(co_await net::this_coro::executor);
    std::optional<std::string> sent;
    for (;;) {
      const std::optional<std::string> now = event_of(response);
      if (!now) break;
      if (now != sent) {
        const std::string text = fmt::format("data: {}\n\n", *now);
        socket.expires_after(options_.patience);
        co_await net::async_write(stream, net::buffer(text), net::use_awaitable);
        sent = now;
      }
      timer.expires_after(kLookForEvents);
      co_await timer.async_wait(net::use_awaitable);
    }
  }

  HttpServerOptions options_;
  HttpHandler handler_;
  std::mutex complaining_;
  std::function<void(const std::string&)> complain_;
  Open open_;
  net::ssl::context tls_{net::ssl::context::tls_server};
  net::io_context io_;
  net::ip::tcp::acceptor acceptor_;
};

HttpServer::HttpServer(const HttpServerOptions& options, HttpHandler handler)
    : implementation_(std::make_unique<Implementation>(options, std::move(handler))) {}
HttpServer::~HttpServer() = default;
std::uint16_t HttpServer::port() const { return implementation_->port(); }
void HttpServer::run(const std::function<bool()>& is_end_asked_for,
                     const std::function<void(const std::string&)>& complain) {
  implementation_->run(is_end_asked_for, complain);
}

}  // namespace isoshift
