// Sending with TLS to storescp, DCMTK's receiver, with certificates of the test's own.

#include "io/network/dicom_send.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <future>
#include <iterator>
#include <optional>

#include "base/process.h"
#include "base/sha256.h"
#include "tests/support/certificates.h"
#include "tests/support/small_study.h"

namespace isoshift::dicom_send_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class DicomSendTest : public testing::Test {
 protected:
  void SetUp() override {
    if (run_shell("command -v storescp").exit_status != 0 || !Certificates::can_be_made())
      GTEST_SKIP() << "storescp (dcmtk) or openssl is not installed";
    fs::create_directories(folder_ / "received");
    certificates_.emplace(folder_.path());
    certificates_->make("client", "isoshift", "DNS:isoshift");
  }

  DicomPeer peer_at(const std::string& host, std::uint16_t port, const std::string& pinned) const {
    return {.name = "record",
            .host = host,
            .port = port,
            .called_aet = "RECORD",
            .calling_aet = "ISOSHIFT",
            .tls = DicomPeer::Tls{.ca = folder_ / "ca.pem",
                                  .certificate = folder_ / "client.pem",
                                  .key = folder_ / key_,
                                  .fingerprint = pinned}};
  }

  // Sends an object to a receiver with that certificate. Returns why it could not be sent; empty: it was.
  std::string error_of_sending(const std::string& certificate, const std::string& host,
                               const std::string& pinned = "") {
    const std::uint16_t port = free_port();
    const std::string& folder = folder_.path().string();
    const Process receiver(
        {"sh", "-c",
         fmt::format("exec storescp -v -aet RECORD -od {0}/received +tls {0}/{1}.key {0}/{1}.pem +cf "
                     "{0}/ca.pem {2} > {0}/log 2>&1",
                     folder, certificate, port)});
    wait_for_listener(port);
    try {
      send_object(file_, sha256_, peer_at(host, port, pinned), false);
    } catch (const PeerError& error) {
      return error.what();
    } catch (const Error& error) {
      return std::string("the object: ") + error.what();
    }
    return "";
  }
  // The object, not its file: the receiver writes a header of its own.
  void expect_sent() const {
    ASSERT_FALSE(fs::is_empty(folder_ / "received")) << log();
    const auto elements = [](const fs::path& file) {
      return run_shell(fmt::format("dcmdump -q +L {} | grep '^ *(' | grep -v '^(0002,'", file.string())).out;
    };
    EXPECT_THAT(elements(study_.plan()), HasSubstr("SOPInstanceUID"));
    EXPECT_EQ(elements(fs::directory_iterator(folder_ / "received")->path()), elements(study_.plan()));
  }
  void expect_nothing_sent() const {
    EXPECT_TRUE(fs::is_empty(folder_ / "received"));
    EXPECT_THAT(log(), Not(HasSubstr("Association Received")));
  }
  static std::string text_of(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::string log() const { return text_of(folder_ / "log"); }

  TemporaryFolder folder_;
  std::optional<Certificates> certificates_;
  SmallStudy study_;
  fs::path file_ = study_.plan();
  std::string sha256_ = sha256_of_file(study_.plan());
  std::string key_ = "client.key";
};

TEST_F(DicomSendTest, APeerWhoseCertificateNamesItsAddressReceives) {
  certificates_->make("server", "record", "IP:127.0.0.1");
  EXPECT_EQ(error_of_sending("server", "127.0.0.1"), "");
  expect_sent();
}

TEST_F(DicomSendTest, APeerWhoseCertificateNamesTheHostReceives) {
  certificates_->make("server", "record", "DNS:other.example,DNS:localhost");
  EXPECT_EQ(error_of_sending("server", "localhost"), "");
  expect_sent();
}

TEST_F(DicomSendTest, ASubjectNamesTheHostWhereNothingElseDoes) {
  certificates_->make("server", "localhost", "");
  EXPECT_EQ(error_of_sending("server", "localhost"), "");
  expect_sent();
  certificates_->make("server2", "localhost", "DNS:other.example");
  EXPECT_THAT(error_of_sending("server2", "localhost"), HasSubstr("expected a certificate of localhost"));
}

TEST_F(DicomSendTest, ACertificateOfAnotherHostIsRefusedBeforeAnythingIsSent) {
  certificates_->make("server", "other", "DNS:other.example,IP:10.0.0.5");
  for (const char* host : {"127.0.0.1", "localhost"})
    EXPECT_THAT(error_of_sending("server", host),
                AllOf(StartsWith(fmt::format("peer record: {}:", host)), HasSubstr("CN = other, DNS:other.example"),
                      HasSubstr("10.0.0.5"), HasSubstr(fmt::format("expected a certificate of {}", host)),
                      HasSubstr(certificates_->fingerprint("server"))));
  expect_nothing_sent();
}

TEST_F(DicomSendTest, APinnedCertificateNeedsNoName) {
  certificates_->make("server", "other", "DNS:other.example");
  EXPECT_EQ(error_of_sending("server", "127.0.0.1", certificates_->fingerprint("server")), "");
  expect_sent();
}

TEST_F(DicomSendTest, AnotherCertificateThanThePinnedOneIsRefusedBeforeAnythingIsSent) {
  certificates_->make("server", "record", "IP:127.0.0.1");  // it names the host
  certificates_->make("other", "record", "IP:127.0.0.1");
  EXPECT_THAT(
      error_of_sending("server", "127.0.0.1", certificates_->fingerprint("other")),
      AllOf(HasSubstr(certificates_->fingerprint("server")), HasSubstr("expected the certificate with fingerprint"),
            HasSubstr(certificates_->fingerprint("other"))));
  expect_nothing_sent();
}

TEST_F(DicomSendTest, ACertificateThatTheAuthorityDidNotSignIsRefusedEvenIfItIsPinned) {
  certificates_->make_authority("stranger");
  certificates_->make("server", "record", "IP:127.0.0.1", "stranger");
  EXPECT_THAT(error_of_sending("server", "127.0.0.1", certificates_->fingerprint("server")),
              AllOf(StartsWith("peer record: "), HasSubstr("expected one that"), HasSubstr("ca.pem vouches for")));
  EXPECT_THAT(error_of_sending("server", "127.0.0.1"), HasSubstr("ca.pem vouches for"));
  expect_nothing_sent();
}

TEST_F(DicomSendTest, AFileThatIsNotWhatWasReleasedIsNotSent) {
  certificates_->make("server", "record", "IP:127.0.0.1");
  sha256_ = std::string(64, '0');
  EXPECT_THAT(error_of_sending("server", "127.0.0.1"),
              AllOf(StartsWith("the object: "), HasSubstr("RTPLAN.dcm: was changed: its SHA-256 is ")));
  expect_nothing_sent();
}

// A pipe that is written once is read once: whoever opens it again waits.
TEST_F(DicomSendTest, WhatIsSentIsReadOnce) {
  certificates_->make("server", "record", "IP:127.0.0.1");
  file_ = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  auto error = std::async(std::launch::async, [&] { return error_of_sending("server", "127.0.0.1"); });
  std::ofstream(file_, std::ios::binary) << text_of(study_.plan());
  while (error.wait_for(30s) != std::future_status::ready) {
    ADD_FAILURE() << "the file is read again";
    std::ofstream(file_, std::ios::binary) << text_of(study_.image(0));
  }
  EXPECT_EQ(error.get(), "");
  expect_sent();
}

TEST_F(DicomSendTest, FilesThatCannotBeUsedAreNamed) {
  certificates_->make("server", "record", "IP:127.0.0.1");
  key_ = "ca.key";
  EXPECT_THAT(error_of_sending("server", "127.0.0.1"),
              AllOf(StartsWith("peer record: "), HasSubstr("ca.key: expected the key of the certificate")));
  certificates_->openssl("rsa -aes128 -passout pass:secret -in client.key -out locked.key");
  key_ = "locked.key";
  EXPECT_THAT(error_of_sending("server", "127.0.0.1"), HasSubstr("without a passphrase"));
  expect_nothing_sent();
}

// BCP 195 has no key exchange without forward secrecy, which OpenSSL's defaults allow.
TEST_F(DicomSendTest, ACipherThatBcp195DoesNotAllowIsRefused) {
  certificates_->make("server", "record", "IP:127.0.0.1");
  for (const auto& [cipher, is_allowed] :
       {std::pair("AES128-SHA", false), std::pair("ECDHE-RSA-AES128-GCM-SHA256", true)}) {
    const std::uint16_t port = free_port();
    // It ends after two connections: wait_for_listener(), and the peer's.
    Process server({"sh", "-c",
                    fmt::format("cd {} && exec openssl s_server -naccept 2 -accept 127.0.0.1:{} -tls1_2 -cipher {} "
                                "-key server.key -cert server.pem < /dev/zero",
                                folder_.path().string(), port, cipher)});
    wait_for_listener(port);
    EXPECT_THROW(send_object(file_, sha256_, peer_at("127.0.0.1", port, ""), false),
                 PeerError);  // it is no DICOM peer
    const auto end = server.end(30s);
    ASSERT_TRUE(end);
    EXPECT_EQ(end->output.find("   1 server accepts that finished") != std::string::npos, is_allowed) << end->output;
  }
}

}  // namespace
}  // namespace isoshift::dicom_send_test
