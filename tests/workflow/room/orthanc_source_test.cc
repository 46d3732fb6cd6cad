#include "workflow/room/orthanc_source.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>

#include "io/study/files_below.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/small_study.h"
#include "tests/support/treatment_room.h"

namespace isoshift::orthanc_source_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// A server of one patient.
class FakeOrthanc : public Orthanc {
 public:
  std::vector<std::pair<std::string, std::string>> held;  // identifiers and files, in the order of their coming
  std::map<std::string, int> refusals;                    // how often an instance is not given yet
  std::string database = "one";
  bool is_down = false;
  int changes_at_once = 1000;
  std::size_t cleared = 0;                   // instances whose changes somebody has cleared
  mutable std::map<std::string, int> asked;  // how often for an instance

  std::string add(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    held.emplace_back(fmt::format("{:08x}", held.size() + 1), std::string{std::istreambuf_iterator<char>(file), {}});
    return held.back().first;
  }

  Changes changes_since(std::int64_t last, int limit) const override {
    if (is_down) throw ServerError("the server is down");
    const auto size = static_cast<std::int64_t>(held.size());
    Changes changes{.instances = {}, .mark = "", .last = std::min(last, size), .done = true};
    for (int n = 0; n < std::min(limit, changes_at_once) && changes.last < size; ++n) {
      const auto number = static_cast<std::size_t>(changes.last++);
      if (number < cleared) continue;
      changes.instances.push_back(held[number].first);
      changes.mark = database + changes.instances.back();
    }
    changes.done = changes.last == size;
    return changes;
  }
  std::string file_of(const std::string& instance) const override {
    if (is_down) throw ServerError("the server is down");
    if (const auto left = refusals.find(instance); left != refusals.end() && asked[instance] < left->second) {
      ++asked[instance];
      throw Error("instance " + instance + ": answered 500");
    }
    ++asked[instance];
    return std::ranges::find(held, instance, &std::pair<std::string, std::string>::first)->second;
  }
  std::vector<std::string> instances() const override {
    std::vector<std::string> all;
    for (const auto& [instance, content] : held) all.push_back(instance);
    return all;
  }
  std::vector<std::string> instances_beside(const std::string& /*instance*/) const override { return instances(); }
};

class OrthancSourceTest : public testing::Test {
 protected:
  OrthancSourceTest() {
    for (const fs::path& file : files_below({study_.path()}))
      if (file.extension() == ".dcm" && file != study_.image(0) && file != study_.image(1)) server_.add(file);
    start();
  }
  void start() { source_ = std::make_unique<OrthancSource>(server_, "http://test", objects_, clock_); }
  void update(std::chrono::seconds later = 1s) {
    clock_.pass(later);
    source_->update(notes_);
  }
  const StudyFiles& files() const { return source_->patients().begin()->second.files; }
  std::string patient_id() const { return source_->patients().begin()->first; }
  std::size_t kept() const {
    return static_cast<std::size_t>(std::ranges::count_if(
        fs::directory_iterator(objects_), [](const auto& entry) { return entry.path().extension() == ".dcm"; }));
  }

  const SmallStudy study_;
  const TemporaryFolder folder_{memory_folder()};
  const fs::path objects_ = folder_ / "objects";
  ManualClock clock_;
  FakeOrthanc server_;
  Notes notes_;
  std::unique_ptr<OrthancSource> source_;
};

TEST_F(OrthancSourceTest, FetchesEveryInstanceOnceOverRestartsToo) {
  update();
  ASSERT_THAT(source_->patients(), SizeIs(1));
  EXPECT_EQ(kept(), server_.held.size());
  start();
  update();
  EXPECT_THAT(files().plans, SizeIs(1));
  server_.add(study_.image(0));
  update();
  EXPECT_THAT(files().images, SizeIs(1));
  EXPECT_FALSE(source_->is_coming(patient_id()));
  for (const auto& [instance, times] : server_.asked) EXPECT_EQ(times, 1) << instance;
  EXPECT_THAT(notes_.warnings, IsEmpty());
}

TEST_F(OrthancSourceTest, ChangesThatTheServerHasNotToldAreComing) {
  server_.changes_at_once = 3;
  update();
  EXPECT_EQ(kept(), 3U);
  EXPECT_TRUE(source_->is_coming(patient_id()));
  while (source_->is_coming(patient_id())) update();
  EXPECT_EQ(kept(), server_.held.size());
}

TEST_F(OrthancSourceTest, AnInstanceThatIsNotGivenIsAskedForAgainAndHoldsUpNoOther) {
  update();
  const std::string image = server_.add(study_.image(0));
  server_.refusals[image] = 1000;
  server_.add(study_.image(1));
  std::vector<int> seconds;  // of the attempts
  for (int second = 1; second <= 70; ++second) {
    const int before = server_.asked[image];
    update();
    if (server_.asked[image] > before) seconds.push_back(second);
    EXPECT_THAT(files().images, SizeIs(1)) << second;  // the other one
    EXPECT_EQ(source_->is_coming(patient_id()), second <= 60) << second;
  }
  EXPECT_THAT(seconds, ElementsAre(1, 2, 4, 8, 16, 32, 64));
  EXPECT_THAT(notes_.warnings, ElementsAre(HasSubstr("does not deliver an instance: instance " + image)));
  start();  // remembers what it has not got
  server_.refusals.clear();
  update();
  EXPECT_THAT(files().images, SizeIs(2));
}

TEST_F(OrthancSourceTest, AServerThatIsDownLosesNothing) {
  server_.is_down = true;
  EXPECT_THROW(update(), ServerError);
  EXPECT_TRUE(source_->is_coming("anybody"));
  server_.is_down = false;
  update();
  EXPECT_EQ(kept(), server_.held.size());
}

TEST_F(OrthancSourceTest, AFullDiskLosesNothing) {
  {
    const FileSizeLimit full_disk(100);
    EXPECT_THROW(update(), Error);
  }
  while (kept() < server_.held.size()) update();
  EXPECT_FALSE(source_->is_coming(patient_id()));
  EXPECT_THAT(notes_.warnings, IsEmpty());
}

TEST_F(OrthancSourceTest, ADamagedObjectIsFetchedAgain) {
  update();
  const fs::path object = objects_ / (server_.held[0].first + ".dcm");
  fs::resize_file(object, 200);
  start();
  update();
  EXPECT_EQ(fs::file_size(object), server_.held[0].second.size());
  EXPECT_EQ(server_.asked[server_.held[0].first], 2);
  EXPECT_EQ(server_.asked[server_.held[1].first], 1);
}

TEST_F(OrthancSourceTest, AnotherDatabaseIsReadFromItsBeginning) {
  update();
  const auto first = std::exchange(server_.held, {});
  server_.database = "other";
  for (const auto& [instance, content] : first) server_.held.emplace_back("f" + instance, content);
  server_.held.erase(server_.held.begin() + 1, server_.held.end() - 1);
  server_.add(study_.image(0));
  while (server_.held.size() <= first.size()) server_.add(study_.image(1));
  start();
  update();
  update();
  EXPECT_THAT(files().images, SizeIs(2));
  EXPECT_THAT(notes_.warnings, testing::Contains(HasSubstr("holds another database than before")));
}

TEST_F(OrthancSourceTest, AListOfChangesThatWasClearedHidesNothing) {
  server_.add(study_.image(0));
  server_.cleared = server_.held.size();
  update();
  update();
  EXPECT_EQ(kept(), server_.held.size()) << "at the first start";
  start();
  server_.add(study_.image(1));
  server_.cleared = server_.held.size();  // while nobody watched
  update();
  update();
  EXPECT_THAT(files().images, SizeIs(2));
  for (const auto& [instance, times] : server_.asked) EXPECT_EQ(times, 1) << instance;
}

TEST_F(OrthancSourceTest, WhatWasForgottenIsFetchedAgainWhenItIsAskedFor) {
  update();
  const std::string patient = patient_id();
  source_->forget_before(clock_.file_time() - 24h, {});
  EXPECT_EQ(kept(), server_.held.size()) << "forgotten too soon";
  clock_.pass(48h);
  source_->forget_before(clock_.file_time() - 24h, {patient});
  EXPECT_EQ(kept(), server_.held.size()) << "the patient has X-rays without a result";
  source_->forget_before(clock_.file_time() - 24h, {});
  EXPECT_EQ(kept(), 0U);
  EXPECT_THAT(source_->patients(), IsEmpty());
  server_.add(study_.image(0));
  server_.add(study_.image(1));
  update();
  EXPECT_THAT(files().cts, IsEmpty());
  source_->ask_for_rest(patient);
  update();
  EXPECT_THAT(files().cts, SizeIs(1));
  EXPECT_THAT(files().plans, SizeIs(1));
  EXPECT_THAT(files().images, SizeIs(2));
}

}  // namespace
}  // namespace isoshift::orthanc_source_test
