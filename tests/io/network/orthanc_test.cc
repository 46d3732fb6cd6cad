#include "io/network/orthanc.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <optional>

#include "base/process.h"
#include "tests/support/certificates.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::orthanc_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

// OpenSSL's own web server: it answers, though not as an Orthanc would.
class OrthancTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Certificates::can_be_made()) GTEST_SKIP() << "openssl is not installed";
    certificates_.emplace(folder_.path());
  }

  // What comes of asking a server with this certificate, called by this host.
  std::string error_of_asking(const std::string& certificate, const std::string& host) const {
    const std::uint16_t port = free_port();
    const Process server({"sh", "-c",
                          fmt::format("cd {0} && exec openssl s_server -www -accept 127.0.0.1:{1} -key {2}.key -cert "
                                      "{2}.pem",
                                      folder_.path().string(), port, certificate)});
    wait_for_listener(port);
    const RestOrthanc orthanc({.url = fmt::format("https://{}:{}", host, port), .ca = folder_ / "ca.pem"});
    try {
      (void)orthanc.changes_since(0, 1);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  TemporaryFolder folder_;
  std::optional<Certificates> certificates_;
};

TEST_F(OrthancTest, TheCertificateOfTheServerIsChecked) {
  certificates_->make("server", "orthanc", "IP:127.0.0.1,DNS:localhost");
  EXPECT_THAT(error_of_asking("server", "127.0.0.1"), HasSubstr("answered something else than a list of changes"));
  EXPECT_THAT(error_of_asking("server", "localhost"), HasSubstr("answered something else than a list of changes"));

  certificates_->make("other", "other", "DNS:other.example");
  for (const char* host : {"127.0.0.1", "localhost"})
    EXPECT_THAT(error_of_asking("other", host), AllOf(HasSubstr("Orthanc at https://"), HasSubstr("certificate")));

  certificates_->make_authority("stranger");
  certificates_->make("stranger_server", "orthanc", "IP:127.0.0.1", "stranger");
  EXPECT_THAT(error_of_asking("stranger_server", "127.0.0.1"), HasSubstr("certificate"));
}

}  // namespace
}  // namespace isoshift::orthanc_test
