#pragma once
// A results tree with one session that was accepted, and why steps on it fail.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "base/error.h"
#include "base/sha256.h"
#include "tests/support/registered_session.h"
#include "tests/support/temporary_folder.h"
#include "workflow/room/results_tree.h"

namespace isoshift {

inline const Releaser kDoe{.by = "J. Doe", .user = "isoshift", .sudo_user = "doe"};

inline std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

class ResultsTreeTest : public testing::Test {
 protected:
  std::string error_of_release(const std::string& session) {
    try {
      tree_.release(session, kDoe, {"record"});
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::string error_of_publishing(const std::string& session) {
    try {
      tree_.publish(session, sha256_of_folder(tree_.registering(session)));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::string error_of_sending(const Delivery& delivery) const {
    try {
      tree_.checked_file(delivery);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::filesystem::path record(const std::string& session) const {
    return tree_.path() / "registered" / (session + ".json");
  }
  std::filesystem::path released(const std::string& session) const {
    return tree_.path() / "released" / (session + ".json");
  }
  std::string audit() const { return text_of(tree_.path() / "audit.jsonl"); }
  std::ptrdiff_t lines_of(const std::string& event) const {
    std::ifstream file(tree_.path() / "audit.jsonl");
    std::ptrdiff_t count = 0;
    for (std::string line; std::getline(file, line);)
      count += line.find("\"event\":\"" + event + "\"") != std::string::npos ? 1 : 0;
    return count;
  }

  TemporaryFolder folder_;
  ResultsTree tree_{folder_ / "results"};
  const std::string a_ = register_session(tree_, {"1.2.1", "1.2.2"}, "accepted");
};

}  // namespace isoshift
