#include "io/config/watch_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::watch_file_test {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

class WatchFileTest : public testing::Test {
 protected:
  WatchFileTest() {
    std::filesystem::create_directories(folder_ / "in");
    std::ofstream(folder_ / "site.json") << R"({"site_file": 1, "name": "S", "sessions": {"views": 2, "quiet_s": 5}})";
    for (const char* name : {"ca.pem", "c.pem", "k.pem"}) std::ofstream(folder_ / name) << "x";
  }
  // The file with other content.
  WatchFile read(const std::string& content) const {
    std::ofstream(folder_ / "watch.json") << content;
    return read_watch_file(folder_ / "watch.json");
  }
  std::string error_of(const std::string& content) const {
    try {
      read(content);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  static std::string with(const std::string& more) {
    return R"({"watch_file": 1, "folder": "in", "results": "out", "site": "site.json")" + more + "}";
  }
  static std::string peer(const std::string& tls, const std::string& name = "r", int port = 104) {
    return fmt::format(R"({{"name": "{}", "host": "h", "port": {}, "called_aet": "A", "calling_aet": "B", "tls": {}}})",
                       name, port, tls);
  }
  TemporaryFolder folder_;
};

TEST_F(WatchFileTest, SaysWhatIsFollowedAndWhereItGoes) {
  const WatchFile watch = read(with(R"(, "register": ["--preset=fast"], "peers": [)" +
                                    peer(R"({"ca": "ca.pem", "certificate": "c.pem", "key": "k.pem"})") + "]"));
  EXPECT_EQ(watch.folder, folder_ / "in");
  EXPECT_EQ(watch.results, folder_ / "out");
  EXPECT_EQ(watch.site.sessions->views, 2);
  EXPECT_EQ(watch.registration, std::vector<std::string>{"--preset=fast"});
  ASSERT_EQ(watch.peers.size(), 1U);
  EXPECT_EQ(watch.peers[0].tls->key, folder_ / "k.pem");
  EXPECT_EQ(watch.peers[0].tls->fingerprint, "");
  EXPECT_FALSE(read(with(", \"peers\": [" + peer("false") + "]")).peers[0].tls);
  EXPECT_FALSE(watch.syslog);
  EXPECT_TRUE(read(with(R"(, "syslog": true)")).syslog);
  EXPECT_FALSE(watch.keep_days);
  EXPECT_EQ(read(with(R"(, "keep_days": 400)")).keep_days, 400);
  for (const char* days : {"0", "-1", "1.5", "\"1\""})
    EXPECT_THAT(error_of(with(fmt::format(R"(, "keep_days": {})", days))), HasSubstr("a whole number of days"));
}

TEST_F(WatchFileTest, ACertificateIsPinnedByItsFingerprintAsOpensslPrintsIt) {
  const auto with_fingerprint = [](const std::string& digits) {
    return with(", \"peers\": [" +
                peer(R"({"ca": "ca.pem", "certificate": "c.pem", "key": "k.pem", "fingerprint": ")" + digits + "\"}") +
                "]");
  };
  std::string printed, plain;
  for (int n = 0; n < 32; ++n) {
    printed += n == 0 ? "AB" : ":AB";
    plain += "ab";
  }
  EXPECT_EQ(read(with_fingerprint(printed)).peers[0].tls->fingerprint, plain);
  EXPECT_EQ(read(with_fingerprint(plain)).peers[0].tls->fingerprint, plain);
  for (const std::string& wrong : {plain.substr(1), plain + "a", std::string(64, 'g'), std::string()})
    EXPECT_THAT(error_of(with_fingerprint(wrong)), HasSubstr("tls: fingerprint is \"" + wrong + "\", expected 64"));
}

// Of patients nothing travels without encryption unless the file says so, and no log ever shows a password.
TEST_F(WatchFileTest, ServersAreAskedWithEncryptionAndWithoutPasswordsInTheirUrl) {
  const auto with_server = [&](const std::string& server) {
    return R"({"watch_file": 1, "results": "out", "site": "site.json", "orthanc": {)" + server + "}}";
  };
  for (const std::string here : {"http://localhost:8042", "http://127.0.0.1", "http://[::1]:8042/", "https://h:8042"})
    EXPECT_EQ(error_of(with_server("\"url\": \"" + here + "\"")), "");
  EXPECT_THAT(error_of(with_server(R"("url": "http://h:8042")")), HasSubstr("\"tls\": false"));
  EXPECT_EQ(error_of(with_server(R"("url": "http://h:8042", "tls": false)")), "");
  EXPECT_THAT(error_of(with_server(R"("url": "http://localhost.example.org")")), HasSubstr("\"tls\": false"));
  EXPECT_THAT(error_of(with_server(R"("url": "https://me:word@h")")), HasSubstr("password_file"));
  std::ofstream(folder_ / "password") << "word\n";
  const std::string by_file = with_server(R"("url": "https://h", "user": "me", "password_file": "password")");
  EXPECT_THAT(error_of(by_file), HasSubstr("other users can read or write this file, which must be secret: chmod 600"));
  std::filesystem::permissions(folder_ / "password", std::filesystem::perms::owner_read);
  EXPECT_EQ(read(by_file).orthanc->password, "word");
}

TEST_F(WatchFileTest, MistakesAreNamed) {
  EXPECT_THAT(error_of(R"({"watch_file": 2})"), HasSubstr("watch_file"));
  EXPECT_THAT(error_of(with(", \"foo\": 1")), HasSubstr("foo"));
  EXPECT_THAT(error_of(with(R"(, "orthanc": {"url": "https://h"})")), HasSubstr("expected one of them"));
  EXPECT_THAT(
      error_of(with(R"(, "peers": [{"name": "r", "host": "h", "port": 1, "called_aet": "A", "calling_aet": "B"}])")),
      HasSubstr("peer 1: tls"));  // none must be said
  EXPECT_THAT(error_of(with(", \"peers\": [" + peer("true") + "]")), HasSubstr("or false for none"));
  EXPECT_THAT(
      error_of(with(", \"peers\": [" + peer(R"({"ca": "no.pem", "certificate": "c.pem", "key": "k.pem"})") + "]")),
      HasSubstr("no.pem cannot be read"));
  EXPECT_THAT(error_of(with(", \"peers\": [" + peer("false", "r", 0) + "]")), HasSubstr("1 to 65535"));
  EXPECT_THAT(error_of(with(", \"peers\": [" + peer("false", "a/b") + "]")), HasSubstr("letters, digits"));
  EXPECT_THAT(error_of(with(", \"peers\": [" + peer("false") + "," + peer("false") + "]")), HasSubstr("there twice"));
  EXPECT_THAT(error_of(R"({"watch_file": 1, "folder": "no", "results": "out", "site": "site.json"})"),
              EndsWith("/no is not a folder"));
  std::ofstream(folder_ / "site.json") << R"({"site_file": 1, "name": "S"})";
  EXPECT_THAT(error_of(with("")), HasSubstr("sessions: is missing"));
}

TEST_F(WatchFileTest, TheExampleOfThePackageIsOne) {
  std::filesystem::copy(ISOSHIFT_SOURCE_DIR "/packaging/watch.json", folder_ / "example.json");
  std::filesystem::copy(ISOSHIFT_SOURCE_DIR "/packaging/site.json", folder_ / "site.json",
                        std::filesystem::copy_options::overwrite_existing);
  for (const char* name : {"isoshift.pem", "isoshift.key"}) std::ofstream(folder_ / name) << "x";
  EXPECT_EQ(read_watch_file(folder_ / "example.json").peers.size(), 1U);
}

}  // namespace
}  // namespace isoshift::watch_file_test
