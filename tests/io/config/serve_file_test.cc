#include "io/config/serve_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::serve_file_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ServeFileTest : public testing::Test {
 protected:
  ServeFileTest() {
    fs::create_directories(folder_ / "in");
    std::ofstream(folder_ / "site.json") << R"({"site_file": 1, "name": "S", "sessions": {"views": 2, "quiet_s": 5}})";
    std::ofstream(folder_ / "watch.json")
        << R"({"watch_file": 1, "folder": "in", "results": "out", "site": "site.json"})";
    for (const char* name : {"c.pem", "k.pem", "secret"}) {
      std::ofstream(folder_ / name) << "word\n";
      fs::permissions(folder_ / name, fs::perms::owner_read | fs::perms::owner_write);
    }
  }
  ServeFile read(const std::string& more) const {
    std::ofstream(folder_ / "serve.json") << R"({"serve_file": 1, "watch": "watch.json")" << more << "}";
    return read_serve_file(folder_ / "serve.json");
  }
  std::string error_of(const std::string& more) const {
    try {
      read(more);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  TemporaryFolder folder_;
  const std::string roles_ = R"(, "roles": {"doe": ["view", "release"]})", pam_ = R"(, "pam_service": "isoshift")";
};

TEST_F(ServeFileTest, SaysWhoMayDoWhat) {
  const ServeFile serve = read(roles_ + pam_);
  EXPECT_EQ(serve.roles.at("doe"), (std::set{Role::kView, Role::kRelease}));
  EXPECT_EQ(serve.pam_service, "isoshift");
  EXPECT_EQ(serve.address, "127.0.0.1");
  EXPECT_EQ(serve.watch.results, folder_ / "out");
  const ServeFile proxied = read(roles_ + R"(, "proxy": {"header": "X-Remote-User", "secret_file": "secret"})");
  EXPECT_EQ(proxied.proxy->header, "x-remote-user");
  EXPECT_EQ(proxied.proxy->secret, "word");
}

TEST_F(ServeFileTest, OtherComputersAreListenedToWithTlsOnly) {
  EXPECT_THAT(error_of(roles_ + pam_ + R"(, "address": "0.0.0.0")"), HasSubstr("tls is missing"));
  const std::string tls = R"(, "tls": {"certificate": "c.pem", "key": "k.pem"})";
  EXPECT_EQ(read(roles_ + pam_ + R"(, "address": "0.0.0.0")" + tls).tls->key, folder_ / "k.pem");
  fs::permissions(folder_ / "k.pem", fs::perms::group_read, fs::perm_options::add);
  EXPECT_THAT(error_of(roles_ + pam_ + tls), HasSubstr("k.pem: other users can read or write this file"));
}

TEST_F(ServeFileTest, ErrorsNameTheMistake) {
  EXPECT_THAT(error_of(pam_), HasSubstr("roles is missing"));
  EXPECT_THAT(error_of(roles_), HasSubstr("pam_service and proxy: expected one of them"));
  EXPECT_THAT(error_of(pam_ + R"(, "roles": {"doe": ["admin"]})"), HasSubstr("doe"));
  EXPECT_THAT(error_of(pam_ + R"(, "roles": {"doe": ["release"]})"), HasSubstr("\"view\" among its roles"));
  EXPECT_THAT(error_of(roles_ + pam_ + R"(, "port": 70000)"), HasSubstr("port"));
  EXPECT_THAT(error_of(roles_ + pam_ + R"(, "colour": "red")"), HasSubstr("colour"));
  std::ofstream(folder_ / "secret") << "\n";
  EXPECT_THAT(error_of(roles_ + R"(, "proxy": {"header": "X-Remote-User", "secret_file": "secret"})"),
              HasSubstr("its first line is empty"));
}

}  // namespace
}  // namespace isoshift::serve_file_test
