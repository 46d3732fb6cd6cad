#include "workflow/room/results_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <fstream>
#include <functional>
#include <iterator>
#include <thread>

#include "base/error.h"
#include "base/output_folder.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/registered_session.h"
#include "tests/support/results_tree.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::results_tree_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

TEST_F(ResultsTreeTest, NothingIsPendingBeforeItIsReleased) {
  EXPECT_EQ(tree_.sessions(), std::vector<std::string>{a_});
  EXPECT_THAT(tree_.pending().deliveries, IsEmpty());
  EXPECT_FALSE(tree_.release_of(a_));
}

TEST_F(ResultsTreeTest, EveryObjectIsPendingForEveryPeerUntilItIsSent) {
  tree_.release(a_, kDoe, {"record", "archive"});
  const std::vector<Delivery> pending = tree_.pending().deliveries;
  ASSERT_EQ(pending.size(), 4U);
  EXPECT_EQ(tree_.checked_file(pending[0]), tree_.session(a_) / pending[0].object.file);
  tree_.prepare_to_send(pending[0]);
  ResultsTree killed(tree_.path());  // before the peer answered, or after
  EXPECT_EQ(killed.pending().deliveries.size(), 4U);
  EXPECT_TRUE(killed.is_in_doubt(pending[0]));
  EXPECT_FALSE(killed.is_in_doubt(pending[1]));
  tree_.mark_sent(pending[0], "");
  ResultsTree reopened(tree_.path());  // as after a kill
  EXPECT_EQ(reopened.pending().deliveries.size(), 3U);
  EXPECT_EQ(to_string(reopened.release_of(a_)->releaser), "J. Doe (user isoshift, sudo of doe)");
  EXPECT_EQ(lines_of("released"), 1);
  EXPECT_EQ(lines_of("sent"), 1);
}

TEST_F(ResultsTreeTest, TheLineOfAReleaseNamesThePersonAndTheUser) {
  tree_.release(a_, kDoe, {"record"});
  EXPECT_THAT(audit(), HasSubstr(R"("by":"J. Doe","user":"isoshift","sudo_user":"doe")"));
  const std::string b = register_session(tree_, {"1.2.3"}, "accepted");
  tree_.release(b, {.by = "J. Doe", .user = "isoshift", .sudo_user = ""}, {"record"});
  EXPECT_EQ(to_string(tree_.release_of(b)->releaser), "J. Doe (user isoshift)");
}

TEST_F(ResultsTreeTest, AMarkWithoutItsLineInTheLogIsInDoubt) {
  tree_.release(a_, kDoe, {"record"});
  const std::vector<Delivery> pending = tree_.pending().deliveries;
  ASSERT_EQ(pending.size(), 2U);
  tree_.prepare_to_send(pending[0]);
  tree_.mark_sent(pending[0], "");
  EXPECT_EQ(ResultsTree(tree_.path()).pending().deliveries.size(), 1U);
  const std::string before = audit();
  replace_text(tree_.path() / "audit.jsonl", before.substr(0, before.find("\"event\":\"sent\"") + 20));  // cut
  // A mark that nobody but its forger wrote.
  fs::copy_file(tree_.path() / "sent" / (a_ + ".record." + pending[0].object.file), folder_ / "mark");
  std::string forged = text_of(folder_ / "mark");
  forged.replace(forged.find(pending[0].object.sha256), pending[0].object.sha256.size(), pending[1].object.sha256);
  write_text(tree_.path() / "sent" / (a_ + ".record." + pending[1].object.file), forged);
  ResultsTree reopened(tree_.path());
  ASSERT_EQ(reopened.pending().deliveries.size(), 2U);
  for (const Delivery& delivery : pending) EXPECT_TRUE(reopened.is_in_doubt(delivery));
  for (const Delivery& delivery : pending) {
    reopened.prepare_to_send(delivery);
    reopened.mark_sent(delivery, "");
  }
  EXPECT_THAT(reopened.pending().deliveries, IsEmpty());
  EXPECT_FALSE(reopened.is_in_doubt(pending[0]));
  EXPECT_EQ(lines_of("sent"), 3);  // each with a line of its own, the first behind the cut one
}

TEST_F(ResultsTreeTest, WhatAPeerConfirmedWhileTheLogCannotBeWrittenIsNotSentAgain) {
  tree_.release(a_, kDoe, {"record"});
  const Delivery sent = tree_.pending().deliveries[0];
  {
    const FileSizeLimit full(audit().size());
    tree_.prepare_to_send(sent);
    tree_.mark_sent(sent, "");
    EXPECT_EQ(tree_.pending().deliveries.size(), 1U);
    EXPECT_THROW(tree_.write_kept_audit(), Error);
  }
  tree_.write_kept_audit();
  EXPECT_EQ(lines_of("sent"), 1);
  EXPECT_EQ(ResultsTree(tree_.path()).pending().deliveries.size(), 1U);
}

TEST_F(ResultsTreeTest, AReleaseThatAnotherReplacedDoesNotCountAgain) {
  tree_.release(a_, kDoe, {"record"});
  const std::string first = text_of(released(a_));
  fs::remove(released(a_));
  tree_.release(a_, kDoe, {"archive"});
  replace_text(released(a_), first);
  EXPECT_THAT(tree_.pending().deliveries, IsEmpty());
  EXPECT_THAT(tree_.pending().refused[a_], HasSubstr("is not the newest release of session " + a_));
}

TEST_F(ResultsTreeTest, TheSitesRuleReleasesOnlyWhatWasAcceptedAndOnlyOnce) {
  const Releaser rule{.by = "automatic", .user = "isoshift", .sudo_user = "", .is_person = false};
  const std::string review = register_session(tree_, {"1.2.9"}, "review");
  const auto error_of = [&](const std::string& session) {
    try {
      tree_.release(session, rule, {"record"});
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(error_of(review), HasSubstr("its verdict is review: only a person can release it"));
  EXPECT_EQ(error_of(a_), "");
  fs::remove(released(a_));
  EXPECT_THAT(error_of(a_), HasSubstr("was released before, as audit.jsonl says"));
  EXPECT_FALSE(tree_.is_released(a_));
  EXPECT_TRUE(tree_.release(a_, kDoe, {"archive"}).is_again);
  EXPECT_THAT(audit(), HasSubstr("\"again\":true"));
}

TEST_F(ResultsTreeTest, ALineWithoutItsMarkIsInDoubt) {
  tree_.release(a_, kDoe, {"record"});
  const Delivery sent = tree_.pending().deliveries[0];
  tree_.prepare_to_send(sent);
  tree_.mark_sent(sent, "");
  EXPECT_FALSE(tree_.is_in_doubt(sent));
  fs::remove(tree_.path() / "sent" / (a_ + ".record." + sent.object.file));
  ResultsTree reopened(tree_.path());
  EXPECT_EQ(reopened.pending().deliveries.size(), 2U);
  EXPECT_TRUE(reopened.is_in_doubt(sent));  // the peer is asked first
}

TEST_F(ResultsTreeTest, AFolderInThePlaceOfAReleaseIsNamed) {
  fs::create_directory(released(a_));
  EXPECT_THAT(error_of_release(a_), HasSubstr(a_ + ".json: is a folder, expected a JSON file"));
  EXPECT_THAT(tree_.pending().refused[a_], HasSubstr(a_ + ".json: is a folder"));
}

TEST_F(ResultsTreeTest, AMarkOfAnotherObjectIsNoMark) {
  const std::string b = register_session(tree_, {"1.2.3"}, "review");
  tree_.release(a_, kDoe, {"record"});
  tree_.release(b, kDoe, {"record"});
  const std::vector<Delivery> pending = tree_.pending().deliveries;
  ASSERT_EQ(pending.size(), 3U);
  for (const Delivery& delivery : pending) {
    if (delivery.session != a_) continue;
    tree_.prepare_to_send(delivery);
    tree_.mark_sent(delivery, "");
  }
  fs::copy_file(tree_.path() / "sent" / (a_ + ".record.report.dcm"),
                tree_.path() / "sent" / (b + ".record.report.dcm"));
  EXPECT_EQ(tree_.pending().deliveries.size(), 1U);
}

TEST_F(ResultsTreeTest, ASessionIsReleasedOnce) {
  tree_.release(a_, kDoe, {"record"});
  EXPECT_THAT(error_of_release(a_), HasSubstr("has been released by J. Doe (user isoshift, sudo of doe) on "));
}

TEST_F(ResultsTreeTest, OfManyWhoReleaseAtTheSameTimeOneDoes) {
  std::atomic<int> released = 0, refused = 0;
  std::vector<std::jthread> people;
  for (int n = 0; n < 8; ++n)
    people.emplace_back([&, n] {
      ResultsTree tree(tree_.path());
      try {
        tree.release(a_, {.by = "Person " + std::to_string(n), .user = "u", .sudo_user = ""}, {"record"});
        ++released;
      } catch (const Error& error) {
        EXPECT_THAT(error.what(), HasSubstr("has been released by Person "));
        ++refused;
      }
    });
  people.clear();
  EXPECT_EQ(released, 1);
  EXPECT_EQ(refused, 7);
  EXPECT_EQ(lines_of("released"), 1);
}

TEST_F(ResultsTreeTest, WhatMayNotBeReleasedIsRefused) {
  EXPECT_THAT(error_of_release(register_session(tree_, {"1.2.3"}, "rejected")), HasSubstr("was rejected"));
  EXPECT_THAT(error_of_release("b"), HasSubstr("holds no session b"));
  EXPECT_THAT(error_of_release("../sessions/" + a_), HasSubstr("holds no session"));
  const std::string review = register_session(tree_, {"1.2.4"}, "review");
  EXPECT_EQ(tree_.release(review, kDoe, {"record"}).objects.size(), 1U);  // its report
}

// Where no watch runs that would compare them.
TEST_F(ResultsTreeTest, WhatWasRegisteredFromFilesThatHaveChangedIsNeitherReleasedNorSent) {
  const fs::path plan = folder_ / "plan.dcm", xray = folder_ / "xray.dcm";
  replace_text(plan, "the plan");
  replace_text(xray, "an X-ray");
  const StudyParts parts{.images = {xray}, .plan = plan};
  tree_.keep_order(a_, {.parts = parts});
  tree_.keep_inputs(a_, inputs_of(parts, FileContents()));
  replace_text(plan, "another plan of this name");
  EXPECT_THAT(error_of_release(a_), HasSubstr("session " + a_ + ": RT Plan changed after the registration"));
  replace_text(plan, "the plan");
  tree_.release(a_, kDoe, {"record"});
  const Delivery delivery = tree_.pending().deliveries.at(0);
  EXPECT_EQ(error_of_sending(delivery), "");
  replace_text(plan, "another plan of this name");
  EXPECT_THAT(error_of_sending(delivery), HasSubstr("RT Plan changed after the registration"));
  EXPECT_EQ(tree_.missing_input(a_), fs::path());
  fs::remove(plan);
  EXPECT_EQ(error_of_sending(delivery), "") << "files that were taken away tell nothing";
  EXPECT_EQ(tree_.missing_input(a_), plan);
}

// As by a tool that copies the time of writing, too, or on a disk that knows whole seconds only.
TEST_F(ResultsTreeTest, AFileOfTheSameSizeAndTimeOfWritingIsAnotherOne) {
  const fs::path plan = folder_ / "plan.dcm";
  replace_text(plan, "the plan");
  const auto written = fs::last_write_time(plan);
  const StudyParts parts{.plan = plan};
  tree_.keep_order(a_, {.parts = parts});
  tree_.keep_inputs(a_, inputs_of(parts, FileContents()));
  replace_text(plan, "not plan");
  fs::last_write_time(plan, written);
  EXPECT_THAT(error_of_release(a_), HasSubstr("RT Plan changed after the registration"));
}

TEST_F(ResultsTreeTest, AFolderThatIsNotWhatWasRegisteredIsNotReleased) {
  const std::string b = register_session(tree_, {"1.2.3"}, "accepted");
  const fs::path folder = tree_.session(a_), other = tree_.session(b), aside = folder_ / "aside";
  struct Attack {
    const char* reason;
    std::function<void()> change, restore;
  };
  const auto put = [&](const char* file, const std::string& text) { replace_text(folder / file, text); };
  const std::string report = text_of(folder / "report.dcm"), result = text_of(folder / "result.json");
  const auto move_back = [&] { fs::rename(aside, folder / "report.dcm"); };
  const std::array<Attack, 8> attacks = {
      {{"report.dcm: is not what was registered", [&] { put("report.dcm", text_of(other / "report.dcm")); },
        [&] { put("report.dcm", report); }},
       {"result.json: is not what was registered", [&] { put("result.json", result + " "); },
        [&] { put("result.json", result); }},
       {"extra.txt: was added", [&] { put("extra.txt", ""); }, [&] { fs::remove(folder / "extra.txt"); }},
       {".hidden: was added", [&] { put(".hidden", ""); }, [&] { fs::remove(folder / ".hidden"); }},
       {"report.dcm: is missing", [&] { fs::rename(folder / "report.dcm", aside); }, move_back},
       {"report.dcm: is not a plain file",
        [&] {
          fs::rename(folder / "report.dcm", aside);
          fs::create_symlink(aside, folder / "report.dcm");
        },
        move_back},
       {"is not a plain folder",
        [&] {
          fs::rename(folder, aside);
          fs::create_directory_symlink(aside, folder);
        },
        [&] {
          fs::remove(folder);
          fs::rename(aside, folder);
        }},
       {"report.dcm: is not what was registered",  // two sessions change their names
        [&] {
          fs::rename(folder, aside);
          fs::rename(other, folder);
        },
        [&] {
          fs::rename(folder, other);
          fs::rename(aside, folder);
        }}}};
  for (const Attack& attack : attacks) {
    attack.change();
    EXPECT_THAT(error_of_release(a_), AllOf(HasSubstr(attack.reason), HasSubstr("move the session's folder away")));
    EXPECT_FALSE(tree_.is_released(a_));
    attack.restore();
  }
  EXPECT_EQ(lines_of("released"), 0);
  EXPECT_EQ(error_of_release(a_), "");
}

TEST_F(ResultsTreeTest, AReleasedFolderThatWasChangedSinceIsNotSent) {
  tree_.release(a_, kDoe, {"record"});
  const Delivery delivery = tree_.pending().deliveries[0];
  EXPECT_EQ(error_of_sending(delivery), "");
  std::ofstream(tree_.session(a_) / "result.json", std::ios::app) << " ";
  EXPECT_THAT(error_of_sending(delivery), HasSubstr("result.json: is not what was registered"));
}

TEST_F(ResultsTreeTest, ACopiedSessionIsNotReleased) {
  tree_.release(a_, kDoe, {"record"});
  fs::copy(tree_.session(a_), tree_.session("b"));
  EXPECT_THAT(error_of_release("b"), HasSubstr("there is no record of its registration"));
  fs::copy_file(record(a_), record("b"));
  EXPECT_THAT(error_of_release("b"), HasSubstr("is not the record of the newest registration of session b"));
  std::string fitting = text_of(record(a_));
  fitting.replace(fitting.find(a_), a_.size(), "b");
  replace_text(record("b"), fitting);
  EXPECT_THAT(error_of_release("b"), HasSubstr("is not the record of the newest registration of session b"));
}

TEST_F(ResultsTreeTest, ARecordThatWasMadeToFitIsNotBelieved) {
  const std::string b = register_session(tree_, {"1.2.3"}, "accepted");
  fs::copy_file(tree_.session(b) / "report.dcm", tree_.session(a_) / "report.dcm",
                fs::copy_options::overwrite_existing);
  SessionRecord forged = read_session_record(record(a_));
  forged.files["report.dcm"] = read_session_record(record(b)).files["report.dcm"];
  replace_text(record(a_), json_of(forged));
  EXPECT_THAT(error_of_release(a_), HasSubstr("is not the record of the newest registration"));
}

TEST_F(ResultsTreeTest, AnObjectIsReleasedWithOneSessionOnly) {
  const std::string b = write_registering(tree_, {"1.2.3"}, "review");
  fs::copy_file(tree_.session(a_) / "report.dcm", tree_.registering(b) / "report.dcm",
                fs::copy_options::overwrite_existing);
  EXPECT_EQ(error_of_publishing(b), "");
  tree_.release(a_, kDoe, {"record"});
  EXPECT_THAT(error_of_release(b), HasSubstr("its report.dcm has already been released with session " + a_));
}

TEST_F(ResultsTreeTest, AResultOfOtherXraysIsNotRegistered) {
  const std::string b = write_registering(tree_, {"1.2.3"}, "accepted");
  const std::string c = write_registering(tree_, {"1.2.4"}, "accepted");
  replace_text(tree_.registering(b) / "result.json", text_of(tree_.registering(c) / "result.json"));
  EXPECT_THAT(error_of_publishing(b), HasSubstr("is the result of other X-rays: those of session " + c));
  EXPECT_FALSE(fs::exists(tree_.session(b)));
  EXPECT_EQ(lines_of("registered"), 1);
}

TEST_F(ResultsTreeTest, ASessionIsRegisteredOnce) {
  const std::string before = text_of(record(a_));
  write_registering(tree_, {"1.2.1", "1.2.2"}, "review");
  EXPECT_THAT(error_of_publishing(a_), HasSubstr(a_ + ": exists already"));
  EXPECT_EQ(text_of(record(a_)), before);
  EXPECT_EQ(error_of_release(a_), "");
}

TEST_F(ResultsTreeTest, NothingIsReleasedOrRegisteredWithoutItsLineInTheLog) {
  const std::string b = write_registering(tree_, {"1.2.3"}, "review");
  const fs::path log = tree_.path() / "audit.jsonl", aside = folder_ / "audit.jsonl";
  fs::rename(log, aside);
  EXPECT_THAT(error_of_release(a_), HasSubstr("audit.jsonl"));  // its registration is not proven any more
  fs::create_directory(log);
  EXPECT_THAT(error_of_release(a_), HasSubstr("audit.jsonl: cannot be"));
  EXPECT_THAT(error_of_publishing(b), HasSubstr("audit.jsonl: cannot be written"));
  EXPECT_FALSE(tree_.is_released(a_));
  EXPECT_FALSE(fs::exists(tree_.session(b)));
  fs::remove(log);
  fs::rename(aside, log);
  tree_.audit("started", nlohmann::ordered_json::object());
  EXPECT_EQ(lines_of("released"), 0);  // nor does what failed enter the log later
  EXPECT_EQ(lines_of("registered"), 1);
  EXPECT_EQ(error_of_release(a_), "");
  EXPECT_EQ(error_of_publishing(b), "");
}

TEST_F(ResultsTreeTest, AReleaseWhoseLineDoesNotFitOnTheDiskLeavesNothing) {
  std::ofstream(tree_.path() / "audit.jsonl", std::ios::app) << std::string(10'000, ' ') << '\n';
  const std::string before = audit();
  {
    const FileSizeLimit full(before.size() + 10);
    EXPECT_THAT(error_of_release(a_), AllOf(HasSubstr("is not released"), HasSubstr("audit.jsonl: cannot be written")));
  }
  EXPECT_TRUE(audit() == before);  // the 10 bytes that fitted are taken back
  EXPECT_TRUE(fs::is_empty(tree_.path() / "released"));
  EXPECT_EQ(error_of_release(a_), "");
}

TEST_F(ResultsTreeTest, AHandWrittenReleaseIsNotSent) {
  const std::string b = register_session(tree_, {"1.2.3"}, "accepted");
  tree_.release(a_, kDoe, {"record"});
  std::string forged = text_of(released(a_));
  forged.replace(forged.find(a_), a_.size(), b);
  write_text(released(b), forged);
  const ResultsTree::Pending pending = tree_.pending();
  for (const Delivery& delivery : pending.deliveries) EXPECT_EQ(delivery.session, a_);
  ASSERT_TRUE(pending.refused.contains(b));
  EXPECT_THAT(pending.refused.at(b), AllOf(HasSubstr(b + ".json: is not the newest release of session "),
                                           HasSubstr("Remove the file, and release the session")));
  EXPECT_THAT(error_of_release(b), HasSubstr("is not the newest release of session "));
  fs::remove(released(b));
  EXPECT_EQ(error_of_release(b), "");
}

TEST_F(ResultsTreeTest, AReleaseThatWasEditedIsNotSent) {
  tree_.release(a_, kDoe, {"record"});
  const Delivery delivery = tree_.pending().deliveries[0];
  std::string edited = text_of(released(a_));
  edited.replace(edited.find("\"record\"\n"), 8, "\"archive\"");
  replace_text(released(a_), edited);
  EXPECT_THAT(tree_.pending().deliveries, IsEmpty());
  EXPECT_THAT(tree_.pending().refused[a_], HasSubstr("it was changed since"));
  EXPECT_THAT(error_of_sending(delivery), HasSubstr("it was changed since"));
  fs::remove(released(a_));
  EXPECT_THAT(error_of_sending(delivery), HasSubstr("is not released any more"));
}

TEST_F(ResultsTreeTest, AReleaseHoldsForTheRegistrationThatWasReleased) {
  tree_.release(a_, kDoe, {"record"});
  fs::remove_all(tree_.session(a_));
  register_session(tree_, {"1.2.1", "1.2.2"}, "review");
  EXPECT_THAT(tree_.pending().deliveries, IsEmpty());
  EXPECT_THAT(tree_.pending().refused[a_], HasSubstr("releases an earlier registration"));
}

TEST_F(ResultsTreeTest, AnEarlierResultDoesNotComeBack) {
  fs::rename(tree_.session(a_), folder_ / "earlier");
  fs::rename(record(a_), folder_ / "earlier.json");
  register_session(tree_, {"1.2.1", "1.2.2"}, "review");
  fs::remove_all(tree_.session(a_));
  fs::rename(folder_ / "earlier", tree_.session(a_));
  EXPECT_THAT(error_of_release(a_), HasSubstr("is not what was registered"));
  fs::rename(folder_ / "earlier.json", record(a_));
  EXPECT_THAT(error_of_release(a_), HasSubstr("is not the record of the newest registration"));
}

TEST_F(ResultsTreeTest, AKilledRegistrationIsRegisteredAgain) {
  const std::string b = register_session(tree_, {"1.2.3"}, "accepted");
  fs::rename(tree_.session(b), tree_.registering(b));  // as before the last step: there is a record, and its line
  EXPECT_THAT(error_of_release(b), HasSubstr("holds no session"));
  tree_.clean();
  EXPECT_FALSE(fs::exists(tree_.registering(b)));
  EXPECT_EQ(register_session(tree_, {"1.2.3"}, "review"), b);
  EXPECT_EQ(error_of_release(b), "");
}

TEST_F(ResultsTreeTest, AKilledReleaseIsReleasedAgain) {
  tree_.release(a_, kDoe, {"record"});
  fs::rename(released(a_), tree_.path() / "released" / ("." + a_ + ".json"));  // as before the last step
  ResultsTree reopened(tree_.path());
  EXPECT_THAT(reopened.pending().deliveries, IsEmpty());
  EXPECT_THAT(reopened.pending().refused, IsEmpty());
  EXPECT_EQ(error_of_release(a_), "");
  EXPECT_EQ(lines_of("released"), 2);
  EXPECT_EQ(reopened.pending().deliveries.size(), 2U);
}

TEST_F(ResultsTreeTest, DamagedFilesAreNamed) {
  replace_text(record(a_), "{");
  EXPECT_THAT(error_of_release(a_), HasSubstr(a_ + ".json"));
  replace_text(record(a_), "{\"session\": 7}");
  EXPECT_THAT(error_of_release(a_), HasSubstr(a_ + ".json: is not a record of a registered session"));
  write_text(released(a_), "[]");
  EXPECT_THAT(tree_.pending().refused[a_], HasSubstr("released/" + a_ + ".json"));
}

TEST_F(ResultsTreeTest, WhatAKilledProcessLeftIsNoSession) {
  const std::string b = write_registering(tree_, {"1.2.3"}, "accepted");
  fs::create_directories(tree_.registering(b).string() + ".partial-xyz");
  EXPECT_EQ(tree_.sessions().size(), 1U);
  tree_.clean();
  EXPECT_EQ(std::distance(fs::directory_iterator(tree_.path() / "sessions"), {}), 1);
}

}  // namespace
}  // namespace isoshift::results_tree_test
