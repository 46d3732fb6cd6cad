#include "base/output_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::output_folder_test {
namespace {

std::string content(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

int entries(const std::filesystem::path& folder) {
  return static_cast<int>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(OutputFolder, AppearsWhole) {
  TemporaryFolder folder;
  OutputFolder output(folder / "deep" / "out", false);
  write_text(output.path() / "a.txt", "hello");
  EXPECT_FALSE(std::filesystem::exists(folder / "deep" / "out"));
  output.commit();
  EXPECT_EQ(content(folder / "deep" / "out" / "a.txt"), "hello");
  EXPECT_EQ(entries(folder / "deep"), 1);
}

TEST(OutputFolder, LeavesNothingBehindWithoutCommit) {
  TemporaryFolder folder;
  {
    OutputFolder output(folder / "out", false);
    write_text(output.path() / "a.txt", "hello");
  }
  EXPECT_EQ(entries(folder.path()), 0);
}

TEST(OutputFolder, ALinkLeadsToTheFolder) {
  TemporaryFolder folder;
  std::filesystem::create_directory(folder / "real");
  std::filesystem::create_directory_symlink("real", folder / "link");
  OutputFolder output(folder / "link", false);
  write_text(output.path() / "a.txt", "hello");
  output.commit();
  EXPECT_EQ(content(folder / "real" / "a.txt"), "hello");
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  std::filesystem::create_directory_symlink("nowhere", folder / "broken");
  EXPECT_THROW(OutputFolder(folder / "broken", false), Error);
}

TEST(OutputFolder, RefusesAFolderThatHoldsSomething) {
  TemporaryFolder folder;
  std::ofstream(folder / "precious.txt") << "keep me";
  EXPECT_THROW(OutputFolder(folder.path(), false), Error);
  EXPECT_EQ(content(folder / "precious.txt"), "keep me");
}

// A study that isoshift wrote is an earlier output, too.
TEST(OutputFolder, WhatIsReadIsNotReplaced) {
  TemporaryFolder folder;
  OutputFolder earlier(folder / "study", false);
  std::filesystem::create_directory(earlier.path() / "CT");
  write_text(earlier.path() / "CT" / "slice", "precious");
  earlier.commit();
  std::filesystem::create_directory_symlink(folder / "study", folder / "link");
  for (const std::filesystem::path& input : {folder / "study", folder / "study/CT", folder / "link/CT/slice"})
    EXPECT_THROW(OutputFolder(folder / "study", true, {input}), Error) << input;
  EXPECT_THROW(OutputFolder(folder / "link", true, {folder / "study/CT"}), Error);
  EXPECT_EQ(content(folder / "study/CT/slice"), "precious");
  EXPECT_NO_THROW(OutputFolder(folder / "study", true, {folder / "studies", folder.path()}));
}

TEST(OutputFolder, OverwritingReplacesAnEarlierOutputAsAWhole) {
  TemporaryFolder folder;
  {
    OutputFolder earlier(folder / "out", false);
    write_text(earlier.path() / "result.json", "old");
    write_text(earlier.path() / "spatial_registration.dcm", "old");
    earlier.commit();
  }
  OutputFolder output(folder / "out", true);
  write_text(output.path() / "result.json", "new");
  EXPECT_EQ(content(folder / "out" / "result.json"), "old");
  output.commit();
  EXPECT_EQ(content(folder / "out" / "result.json"), "new");
  EXPECT_FALSE(std::filesystem::exists(folder / "out" / "spatial_registration.dcm"));
  EXPECT_EQ(entries(folder.path()), 1);
}

TEST(OutputFolder, OverwritingSparesWhatItDidNotWrite) {
  TemporaryFolder folder;
  {
    OutputFolder earlier(folder / "out", false);
    write_text(earlier.path() / "result.json", "old");
    earlier.commit();
  }
  std::ofstream(folder / "out" / "note.txt") << "mine";
  try {
    OutputFolder(folder / "out", true);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("note.txt: was not written by isoshift"));
  }
  EXPECT_EQ(content(folder / "out" / "note.txt"), "mine");
  EXPECT_EQ(content(folder / "out" / "result.json"), "old");
}

TEST(OutputFolder, DoesNotReplaceWhatAppearedMeanwhile) {
  TemporaryFolder folder;
  OutputFolder output(folder / "out", false);
  std::filesystem::create_directory(folder / "out");
  std::ofstream(folder / "out" / "note.txt") << "mine";
  EXPECT_THROW(output.commit(), Error);
  EXPECT_EQ(content(folder / "out" / "note.txt"), "mine");
}

TEST(OutputFolder, TakesTheParentsItMadeAwayAgain) {
  TemporaryFolder folder;
  {
    OutputFolder output(folder / "a" / "b" / "out", false);
  }
  EXPECT_EQ(entries(folder.path()), 0);
}

}  // namespace
}  // namespace isoshift::output_folder_test
