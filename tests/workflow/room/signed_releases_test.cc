#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "base/signing_key.h"
#include "tests/support/command.h"
#include "tests/support/results_tree.h"

namespace isoshift::signed_releases_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A results tree whose watch file names a key.
class SignedReleasesTest : public ResultsTreeTest {
 protected:
  SignedReleasesTest() { make_key("ed25519"); }

  void make_key(const std::string& algorithm) const {
    const CommandOutcome made = run_shell("openssl genpkey -algorithm " + algorithm + " -out " + key_.string() +
                                          " 2>&1 && chmod 600 " + key_.string());
    EXPECT_EQ(made.exit_status, 0) << made.out;
  }
  ResultsTree tree_with_key() const { return ResultsTree(WatchFile{.results = tree_.path(), .signing_key = key_}); }
  nlohmann::json release() const { return nlohmann::json::parse(std::ifstream(released(a_))); }
  // What a person with write access can do who has no key: another release, with its line in the log.
  void forge(const nlohmann::json& release) {
    const std::string text = release.dump();
    replace_text(released(a_), text);
    AuditLog(tree_.path() / "audit.jsonl").append("released", {{"session", a_}, {"release", sha256_of(text)}});
  }
  std::string error_of_reading() const {
    try {
      tree_with_key().release_of(a_);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  fs::path key_ = folder_ / "release.key";
};

TEST_F(SignedReleasesTest, OpensslVerifiesThem) {
  tree_with_key().release(a_, kDoe, {"record"});
  EXPECT_EQ(error_of_reading(), "");
  nlohmann::json release = this->release();
  std::ofstream(folder_ / "signature.base64") << release.at("signature").get<std::string>() << "\n";
  release.erase("signature");
  std::ofstream(folder_ / "signed") << release.dump();
  const std::string at = "cd " + folder_.path().string() + " && ";
  const std::string verify =
      at +
      "openssl base64 -d -in signature.base64 -out signature && openssl pkey -in release.key -pubout -out public && "
      "openssl pkeyutl -verify -pubin -inkey public -rawin -in signed -sigfile signature";
  EXPECT_THAT(run_shell(verify).out, HasSubstr("Signature Verified Successfully"));
  std::ofstream(folder_ / "signed") << " ";
  EXPECT_NE(run_shell(verify).exit_status, 0);
}

TEST_F(SignedReleasesTest, WithoutTheKeyNothingIsReleased) {
  tree_with_key().release(a_, kDoe, {"record"});
  nlohmann::json forged = release();
  forged["peers"] = {"elsewhere"};
  forge(forged);
  EXPECT_THAT(error_of_reading(), HasSubstr(a_ + ".json: is not signed by the signing_key of the watch file"));
  forged.erase("signature");
  forge(forged);
  EXPECT_THAT(error_of_reading(), HasSubstr("is not signed"));
  EXPECT_EQ(tree_.release_of(a_)->peers.front(), "elsewhere");  // a watch file without a key does not ask
  make_key("ed25519");                                          // another key
  fs::remove(released(a_));
  ResultsTree tree = tree_with_key();
  tree.release(a_, kDoe, {"record"});
  EXPECT_EQ(error_of_reading(), "");
}

TEST_F(SignedReleasesTest, AReleaseOfBeforeTheKeyIsNotSent) {
  tree_.release(a_, kDoe, {"record"});
  EXPECT_THAT(error_of_reading(), HasSubstr("is not signed"));
  ResultsTree::Pending pending = tree_with_key().pending();
  EXPECT_TRUE(pending.deliveries.empty());
  EXPECT_THAT(pending.refused.at(a_), HasSubstr("is not signed"));
}

TEST_F(SignedReleasesTest, AKeyThatOthersCanReadOrOfAnotherKindIsRefused) {
  const auto error_of_key = [&] {
    try {
      const SigningKey key(key_);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(error_of_key(), "");
  fs::permissions(key_, fs::perms::group_read, fs::perm_options::add);
  EXPECT_THAT(error_of_key(),
              HasSubstr("release.key: other users can read or write this file, which must be secret: chmod 600"));
  make_key("rsa");
  EXPECT_THAT(error_of_key(), HasSubstr("holds no private Ed25519 key without passphrase"));
  std::ofstream(key_, std::ios::trunc) << "x";
  EXPECT_THAT(error_of_key(), HasSubstr("holds no private Ed25519 key"));
  fs::remove(key_);
  EXPECT_THAT(error_of_key(), HasSubstr("release.key: cannot be read: No such file"));
}

}  // namespace
}  // namespace isoshift::signed_releases_test
