// What lies below a folder: links are not followed, and named.

#include "io/study/files_below.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "io/study/study_files.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::files_below_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

TEST(FilesBelow, ALinkToNothingIsSaidAndStopsNothingElse) {
  const TemporaryFolder folder;
  std::ofstream(folder / "notes.txt") << "text";
  fs::create_symlink("nowhere", folder / "link.dcm");
  const StudyFiles files = scan_study({folder.path()});
  EXPECT_THAT(files.unreadable, testing::ElementsAre(HasSubstr("link.dcm: cannot be searched")));
  EXPECT_EQ(files.left_aside.size(), 1U);
}

TEST(FilesBelow, LinksInAFolderAreNotFollowedAndNamed) {
  const TemporaryFolder folder, elsewhere;
  std::ofstream(folder / "own") << "text";
  std::ofstream(elsewhere / "a") << "text";
  fs::create_directory_symlink(elsewhere.path(), folder / "out");
  fs::create_symlink(elsewhere / "a", folder / "file");
  fs::create_directory_symlink(folder.path(), folder / "back");  // round and round
  EXPECT_EQ(files_below({folder.path()}), std::vector{folder / "own"});
  EXPECT_EQ(files_below({folder / "out"}), std::vector{folder / "out" / "a"});  // named by a person
  EXPECT_THAT(scan_study({folder.path()}).left_aside,
              UnorderedElementsAre(
                  HasSubstr("own"),
                  HasSubstr("out: a link, which is not followed: name what it leads to, " + elsewhere.path().string()),
                  HasSubstr("file: a link"), HasSubstr("back: a link")));
  fs::create_directory_symlink("/not/there", folder / "lost");
  std::set<fs::path> unsearchable;
  EXPECT_EQ(files_below({folder.path()}, {}, &unsearchable).size(), 1U);
  EXPECT_TRUE(unsearchable.contains(folder / "lost"));
  EXPECT_THROW(files_below({folder.path()}), Error);
}

}  // namespace
}  // namespace isoshift::files_below_test
