#include "serve/screen.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <thread>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/report/result_folder.h"
#include "io/study/session_files.h"
#include "tests/support/oblique_report.h"
#include "tests/support/results_tree.h"
#include "tests/support/small_study.h"

namespace isoshift::screen_test {
namespace {

using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

// A results tree with a session that was accepted, and users: one may look, one may also release, one also register,
// and one may nothing.
class ScreenTest : public testing::Test {
 protected:
  HttpRequest request(const std::string& user, const std::string& method, const std::string& path,
                      const std::string& body = "") {
    HttpRequest request{.method = method,
                        .path = path,
                        .headers = {{"x-remote-user", user}, {"x-isoshift-proxy", "word"}},
                        .body = body};
    if (method == "POST") request.headers["content-type"] = "application/json";
    return request;
  }
  HttpResponse get(const std::string& path, const std::string& user = "viewer") {
    return screen_.answer(request(user, "GET", path));
  }
  HttpResponse post(const std::string& user, const std::string& path, const Json& body) {
    HttpRequest post = request(user, "POST", path, body.dump());
    post.headers["x-isoshift-token"] = Json::parse(get("/api/me", user).body).at("token");
    return screen_.answer(post);
  }
  // A result of X-rays with these UIDs, as isoshift register would leave it.
  std::string register_result(const std::vector<std::string>& xrays, Verdict verdict = Verdict::kAccepted) {
    return register_result(oblique_report(verdict), xrays);
  }
  std::string register_result(SetupResult result, const std::vector<std::string>& xrays) {
    result.views.resize(xrays.size(), result.views.front());
    for (std::size_t n = 0; n < xrays.size(); ++n) result.views[n].sop_instance_uid = xrays[n];
    std::string name = session_name(std::set(xrays.begin(), xrays.end()));
    std::filesystem::create_directories(tree_.registering(name));
    write_result(result, tree_.registering(name));
    tree_.publish(name, sha256_of_folder(tree_.registering(name)));
    return name;
  }
  Json session() { return Json::parse(get("/api/sessions/" + a_).body); }
  // The answer once the study is not being read any more.
  HttpResponse wait_until_read(const std::string& path) {
    HttpResponse answer = get(path, "registrar");
    while (answer.status == 503) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      answer = get(path, "registrar");
    }
    return answer;
  }
  // What a person says who has looked at the session now.
  Json word() {
    const Json seen = session();
    return {{"record", seen.at("record")}, {"objection", seen.at("objection")}, {"despite", false}};
  }

  TemporaryFolder folder_;
  ResultsTree tree_{folder_ / "results"};
  ServeFile serve_{.watch = {.results = tree_.path(), .site = {.name = "Linac 3"}, .peers = {{.name = "record"}}},
                   .proxy = ServeFile::Proxy{.header = "x-remote-user", .secret = "word"},
                   .roles = {{"viewer", {Role::kView}},
                             {"releaser", {Role::kView, Role::kRelease}},
                             {"registrar", {Role::kView, Role::kRegister}}}};
  const std::string a_ = register_result({"1.2.1", "1.2.2"});
  SystemClock clock_;
  Room room_{serve_.watch, clock_};
  SignIns sign_ins_{serve_, clock_, [](const std::string&, const std::string&) { return false; }};
  Desk desk_{room_, clock_, [](const std::vector<std::string>&) { return RegisterOptions(); }};
  Screen screen_{room_, desk_, sign_ins_, clock_, true};
};

TEST_F(ScreenTest, NothingIsShownToStrangers) {
  for (const std::string& path :
       std::vector<std::string>{"/", "/room.js", "/session/" + a_, "/session.js", "/api/me", "/api/room", "/api/events",
                                "/api/sessions/" + a_, "/api/sessions/" + a_ + "/report.html"}) {
    const HttpResponse response = get(path, "stranger");
    EXPECT_GE(response.status, 401) << path;
    EXPECT_FALSE(response.events) << path;
    EXPECT_THAT(response.body, Not(HasSubstr(a_))) << path;
  }
  HttpRequest forged = request("releaser", "GET", "/api/room");
  forged.headers["x-isoshift-proxy"] = "guess";
  EXPECT_EQ(screen_.answer(forged).status, 403);
  EXPECT_EQ(get("/sign-in", "stranger").status, 403) << "the proxy signs in";
  EXPECT_EQ(screen_.answer(request("stranger", "POST", "/api/sign-in", R"({"user": "a", "password": "b"})")).status,
            403);
  EXPECT_EQ(text_of(tree_.path() / "audit.jsonl").find("sign-in"), std::string::npos);
}

TEST_F(ScreenTest, TheListSaysWhatThereIs) {
  const Json list = Json::parse(get("/api/room").body);
  EXPECT_EQ(list.at("site"), "Linac 3");
  EXPECT_EQ(list.at("engine"), "stopped");
  ASSERT_EQ(list.at("sessions").size(), 1U);
  EXPECT_EQ(list.at("sessions")[0].at("session"), a_);
  EXPECT_EQ(list.at("sessions")[0].at("verdict"), "accepted");
  EXPECT_EQ(list.at("sessions")[0].at("state"), "held");
  EngineFile(tree_.path(), clock_)
      .update({.waiting = {{.name = "b", .patient_id = "8", .why = "1 of 2 X-rays"}},
               .troubles = {"receiving: no answer"}});
  const std::string other = register_result({"1.2.3", "1.2.4"}, Verdict::kReview);
  (void)session();  // looks at once
  const Json now = Json::parse(get("/api/room").body);
  EXPECT_EQ(now.at("engine"), "runs");
  EXPECT_EQ(now.at("waiting")[0].at("state"), "1 of 2 X-rays");
  EXPECT_EQ(now.at("troubles")[0], "receiving: no answer");
  EXPECT_EQ(now.at("sessions").size(), 2U);
  EXPECT_NE(now.at("version"), list.at("version"));
}

TEST_F(ScreenTest, WhatIsOnTheScreenIsReleasedByWhoMay) {
  const Json word = this->word();
  EXPECT_EQ(post("viewer", "/api/sessions/" + a_ + "/release", word).status, 403);
  EXPECT_FALSE(tree_.is_released(a_));
  const HttpResponse response = post("releaser", "/api/sessions/" + a_ + "/release", word);
  ASSERT_EQ(response.status, 200) << response.body;
  EXPECT_THAT(session().at("state").get<std::string>(), HasSubstr("released by releaser (user "));
  EXPECT_EQ(tree_.release_of(a_)->releaser.by, "releaser");
  EXPECT_EQ(tree_.release_of(a_)->peers, std::vector<std::string>{"record"});
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release", word).status, 409) << "twice";
}

TEST_F(ScreenTest, AnotherRecordThanTheOneOnTheScreenIsNotReleased) {
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release",
                 {{"record", std::string(64, '0')}, {"objection", ""}, {"despite", false}})
                .status,
            409);
  const Json word = this->word();
  std::ofstream(tree_.session(a_) / "result.json", std::ios::app) << " ";
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release", word).status, 409);
  EXPECT_FALSE(tree_.is_released(a_));
}

TEST_F(ScreenTest, AReleaseDespiteOtherXraysNeedsAWord) {
  tree_.keep_objections({{a_, {.words = "there are newer X-rays"}}});
  EXPECT_EQ(session().at("objection"), "there are newer X-rays");
  Json word = this->word();
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release", word).status, 409);
  word["despite"] = true;
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release", word).status, 200);
  EXPECT_EQ(tree_.release_of(a_)->despite, "there are newer X-rays");
}

TEST_F(ScreenTest, WhatOtherXraysSayMustHaveBeenOnTheScreen) {
  Json word = this->word();
  word["despite"] = true;
  tree_.keep_objections({{a_, {.words = "there are newer X-rays", .newer_have_results = true}}});
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release", word).status, 409) << "they came after the look";
  EXPECT_FALSE(tree_.is_released(a_));
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release", this->word()).status, 200);
}

TEST_F(ScreenTest, WhoMayReleaseDecidesWithAReason) {
  const std::string address = "/api/sessions/" + a_ + "/decide";
  const Json rejected = {{"decision", "rejected"}, {"record", session().at("record")}, {"reason", "he coughed"}};
  EXPECT_EQ(post("viewer", address, rejected).status, 403);
  Json odd = rejected;
  odd["reason"] = "";
  EXPECT_EQ(post("releaser", address, odd).status, 400);
  odd["reason"] = std::string(1001, 'a');
  EXPECT_EQ(post("releaser", address, odd).status, 400);
  odd = rejected;
  odd["decision"] = "maybe";
  EXPECT_EQ(post("releaser", address, odd).status, 400);
  odd = rejected;
  odd["record"] = std::string(64, '0');
  EXPECT_EQ(post("releaser", address, odd).status, 409) << "of another result";
  EXPECT_EQ(session().at("decision"), nullptr);
  EXPECT_EQ(post("releaser", address, rejected).status, 200);
  EXPECT_THAT(session().at("state").get<std::string>(), HasSubstr("held; rejected by releaser on "));
  EXPECT_EQ(session().at("decision").at("kind"), "rejected");
  EXPECT_NE(session().at("obstacle"), "");
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/release", word()).status, 409);
}

TEST_F(ScreenTest, ATrendHasAllResultsOfThePatientAndCountsTheFirstOfEveryDay) {
  int number = 0;
  const auto add = [&](const std::string& acquired, double x_mm, Verdict verdict, const std::string& issuer = "here") {
    SetupResult result = oblique_report(verdict);
    result.identity.patient_id_issuer = issuer;
    result.setup_error = Eigen::Translation3d(x_mm, 0.0, 0.0);
    for (auto& view : result.views) view.acquired = acquired;
    const std::string uid = "1.2.9." + std::to_string(++number);
    return register_result(result, {uid, uid + ".1"});
  };
  const std::string third = add("2026-03-03 10:00:00", 3.0, Verdict::kReview);
  const std::string first = add("2026-03-01 10:00:00", 1.0, Verdict::kAccepted);
  const std::string again = add("2026-03-01 10:05:00", 0.2, Verdict::kAccepted);
  add("2026-03-02 10:00:00", 9.0, Verdict::kAccepted, "elsewhere");
  const std::string rejected = add("2026-03-04 10:00:00", 20.0, Verdict::kRejected);
  const auto trend = [&] { return Json::parse(get("/api/sessions/" + first + "/trend").body); };
  Json now = trend();
  ASSERT_EQ(now.at("results").size(), 4U);
  std::vector<std::string> order;
  for (const Json& result : now.at("results")) order.push_back(result.at("session"));
  EXPECT_EQ(order, (std::vector<std::string>{first, again, third, rejected}));
  EXPECT_EQ(now.at("results")[0].at("left_out"), "");
  EXPECT_EQ(now.at("results")[1].at("left_out"), "an earlier result of this day counts");
  EXPECT_THAT(now.at("results")[2].at("left_out").get<std::string>(), HasSubstr("nobody has released it"));
  EXPECT_EQ(now.at("results")[3].at("left_out"), "it was rejected");
  EXPECT_EQ(now.at("errors").at("fractions"), 1);
  EXPECT_EQ(now.at("errors").at("random"), nullptr);
  tree_.release(third, kDoe, {"record"});
  now = trend();
  EXPECT_EQ(now.at("results")[2].at("left_out"), "");
  EXPECT_EQ(now.at("errors").at("fractions"), 2);
  EXPECT_NEAR(now.at("errors").at("systematic")[0], 2.0, 1e-9);
  EXPECT_NEAR(now.at("errors").at("random")[0], std::sqrt(2.0), 1e-9);
  tree_.decide({.kind = DecisionKind::kRejected,
                .session = first,
                .record = tree_.registered(first).sha256,
                .reason = "wrong patient",
                .by = "jdoe"});
  now = trend();
  EXPECT_EQ(now.at("results")[0].at("left_out"), "a person has decided against it");
  EXPECT_EQ(now.at("results")[1].at("left_out"), "") << "the first that stands";
  std::ofstream(tree_.session(third) / "result.json", std::ios::app) << " ";
  EXPECT_THAT(trend().at("results")[2].at("left_out").get<std::string>(), HasSubstr("result.json"));
  EXPECT_EQ(get("/api/sessions/none/trend").status, 404);
}

TEST_F(ScreenTest, WhoMayRegisterChoosesWhereTheFilesDoNotTell) {
  EngineFile(tree_.path(), clock_)
      .update({.waiting = {{.name = "b",
                            .patient_id = "8",
                            .why = "2 RT Plans found",
                            .options = {.own_xrays = {{"1.2.7", "AP 10:15:00"}, {"1.2.8", "LAT 10:15:10"}},
                                        .other_xrays = {},
                                        .patients = {},
                                        .plans = {{"1.3.1", "the RT Plan A"}, {"1.3.2", "the RT Plan B"}},
                                        .cts = {}}},
                           {.name = "c", .patient_id = "9", .why = "waits for the CT", .options = {}}},
               .troubles = {}});
  const Json list = Json::parse(get("/api/room").body);
  EXPECT_EQ(list.at("waiting")[0].at("has_options"), true);
  EXPECT_EQ(list.at("waiting")[1].at("has_options"), false);
  EXPECT_EQ(get("/session/b/choose").status, 200);
  EXPECT_EQ(Json::parse(get("/api/sessions/b/options").body).at("plans")[1].at("words"), "the RT Plan B");
  EXPECT_EQ(get("/api/sessions/" + a_ + "/options").status, 404) << "it has a result";
  Json chosen = {
      {"xrays", {"1.2.7", "1.2.8"}}, {"patient", ""}, {"plan", "1.3.2"}, {"ct", ""}, {"reason", "asked the clinic"}};
  EXPECT_EQ(post("releaser", "/api/sessions/b/choose", chosen).status, 403);
  const HttpResponse answer = post("registrar", "/api/sessions/b/choose", chosen);
  ASSERT_EQ(answer.status, 200) << answer.body;
  const std::string name = session_name({"1.2.7", "1.2.8"});
  EXPECT_EQ(Json::parse(answer.body).at("session"), name);
  EXPECT_EQ(tree_.choice(name)->plan.words, "the RT Plan B");
  EXPECT_EQ(tree_.choice(name)->by, "registrar");
  EXPECT_THAT(text_of(tree_.path() / "audit.jsonl"), HasSubstr(R"("event":"chosen")"));
  EXPECT_THAT(text_of(tree_.path() / "audit.jsonl"), Not(HasSubstr("1.2.7"))) << "no UIDs";
  EXPECT_EQ(tree_.choice(name)->patient_id, "8");
  EXPECT_EQ(post("releaser", "/api/sessions/" + name + "/withdraw-choice", {{"reason", "wrong"}}).status, 403);
  EXPECT_EQ(post("registrar", "/api/sessions/" + name + "/withdraw-choice", {{"reason", "  "}}).status, 400);
  EXPECT_EQ(post("registrar", "/api/sessions/" + name + "/withdraw-choice", {{"reason", "wrong"}}).status, 200);
  EXPECT_TRUE(tree_.choice(name)->is_withdrawn);
  EXPECT_EQ(post("registrar", "/api/sessions/" + name + "/withdraw-choice", {{"reason", "wrong"}}).status, 409);
  chosen["plan"] = "1.3.3";
  EXPECT_EQ(post("registrar", "/api/sessions/b/choose", chosen).status, 409) << "nobody offered it";
  chosen["plan"] = "1.3.1";
  chosen["reason"] = "";
  EXPECT_EQ(post("registrar", "/api/sessions/b/choose", chosen).status, 400);
  EXPECT_EQ(post("registrar", "/api/sessions/b/choose", {{"xrays", "1.2.7"}}).status, 400);
}

TEST_F(ScreenTest, WhoMayRegisterDoesSoByHand) {
  const std::string address = "/api/sessions/" + a_ + "/manual/study";
  EXPECT_EQ(get(address, "stranger").status, 403);
  EXPECT_EQ(get(address, "registrar").status, 409) << "nobody kept how it was registered";
  EXPECT_EQ(get("/api/sessions/none/manual/study", "registrar").status, 404);
  tree_.keep_order(a_, {.parts = {.study = folder_ / "nowhere"}});
  const HttpResponse failed = wait_until_read(address);
  EXPECT_EQ(failed.status, 409) << failed.body;
  EXPECT_THAT(failed.body, HasSubstr("nowhere"));
  EXPECT_EQ(wait_until_read(address).status, 409) << "read again";
}

TEST_F(ScreenTest, AStudyIsReadOnceForAllWhoWorkOnIt) {
  const SmallStudy study;
  tree_.keep_order(a_, {.parts = {.study = study.path()}});
  const std::string address = "/api/sessions/" + a_ + "/manual/";
  const HttpResponse read = wait_until_read(address + "study");
  ASSERT_EQ(read.status, 200) << read.body;
  EXPECT_EQ(Json::parse(read.body).at("views").size(), 2U);
  EXPECT_EQ(get(address + "xrays", "registrar").status, 200) << "at once";
  EXPECT_EQ(post("registrar", address + "hand-over", {{"folder", "x"}}).status, 409) << "there is no result";
  EXPECT_THAT(text_of(tree_.path() / "audit.jsonl"), HasSubstr(R"("event":"opened by hand","by":"registrar")"));
  // Who may only look sees everything and registers nothing.
  EXPECT_EQ(get(address + "study", "viewer").status, 200);
  EXPECT_THAT(text_of(tree_.path() / "audit.jsonl"), HasSubstr(R"("event":"viewed","by":"viewer")"));
  const Json pose = {{"translation_mm", {0, 0, 0}}, {"rotation_matrix", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
  EXPECT_EQ(post("viewer", address + "drrs", {{"setup_error", pose}, {"detail", 2}}).status, 200);
  for (const char* what : {"begin", "cancel", "hand-over"})
    EXPECT_EQ(post("viewer", address + what, {{"setup_error", pose}, {"searched", true}}).status, 403) << what;
}

// A page that was loaded before shows another plan, other X-rays, or another start.
TEST_F(ScreenTest, AStudyIsReadAgainAfterAnotherResultOrOrder) {
  const SmallStudy study;
  tree_.keep_order(a_, {.parts = {.study = study.path()}});
  const std::string address = "/api/sessions/" + a_ + "/manual/";
  const std::string before = Json::parse(wait_until_read(address + "study").body).at("id");
  EXPECT_EQ(Json::parse(wait_until_read(address + "study").body).at("id"), before);
  tree_.keep_order(a_, {.parts = {.study = study.path()}, .flags = {"--preset", "fast"}});
  const Json pose = {{"translation_mm", {0, 0, 0}}, {"rotation_matrix", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
  const Json begin = {
      {"setup_error", pose}, {"searched", false}, {"region", {{"part", nullptr}, {"boxes", Json::array()}}}};
  const HttpResponse refused = post("registrar", address + "begin", begin);
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, HasSubstr("Load it again"));
  const std::string after = Json::parse(wait_until_read(address + "study").body).at("id");
  EXPECT_NE(after, before);
  HttpRequest of_old_page = request("viewer", "GET", address + "xrays");
  of_old_page.headers["x-isoshift-study"] = before;
  EXPECT_EQ(screen_.answer(of_old_page).status, 409);
  of_old_page.headers["x-isoshift-study"] = after;
  EXPECT_EQ(screen_.answer(of_old_page).status, 200);
}

// Of an engine that was killed, or of another version.
TEST_F(ScreenTest, WithoutASignOfTheEngineSessionsAreShownAllTheSame) {
  std::ofstream(tree_.path() / "engine.json") << "{";
  EXPECT_EQ(session().at("obstacle"), "");
  EXPECT_EQ(session().at("can_choose"), false);
}

TEST_F(ScreenTest, ALostDecisionCanBeTakenBack) {
  const Json agreed = {{"decision", "agreed"}, {"record", session().at("record")}, {"reason", ""}};
  ASSERT_EQ(post("releaser", "/api/sessions/" + a_ + "/decide", agreed).status, 200);
  std::filesystem::remove(tree_.path() / "decided" / (a_ + ".1.json"));
  EXPECT_EQ(session().at("decision").at("kind"), "lost");
  EXPECT_NE(session().at("obstacle"), "");
  const Json taken_back = {{"decision", "reopened"}, {"record", session().at("record")}, {"reason", "it was lost"}};
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/decide", taken_back).status, 200);
  EXPECT_EQ(session().at("decision"), nullptr);
  EXPECT_EQ(session().at("obstacle"), "");
}

TEST_F(ScreenTest, TheListSaysThatTheAuditLogIsNotWhole) {
  EXPECT_THAT(Json::parse(get("/api/room").body).at("troubles"), testing::IsEmpty());
  std::filesystem::resize_file(tree_.path() / "audit.jsonl", 10);
  std::this_thread::sleep_for(std::chrono::milliseconds(600));  // the list is kept for half a second
  EXPECT_THAT(Json::parse(get("/api/room").body).at("troubles"), Not(testing::IsEmpty()));
}

// Moved away and registered again, with nobody looking in between.
TEST_F(ScreenTest, ASessionThatWasRegisteredAgainIsShownAsItIsNow) {
  const std::string record = session().at("record");
  std::filesystem::remove_all(tree_.session(a_));
  EXPECT_EQ(register_result({"1.2.1", "1.2.2"}, Verdict::kReview), a_);
  EXPECT_EQ(session().at("verdict"), "review");
  EXPECT_NE(session().at("record"), record);
}

TEST_F(ScreenTest, ABadFileHidesNoOther) {
  std::filesystem::create_directories(tree_.path() / "sessions" / "bad" / "result.json");
  std::ofstream(tree_.path() / "objections.json") << "what";
  const Json list = Json::parse(get("/api/room").body);
  EXPECT_EQ(list.at("sessions").size(), 1U);
  EXPECT_EQ(list.at("troubles").size(), 2U);
}

// A page of another site can send a form, with the user's cookie or by the user's proxy; it cannot know the token.
TEST_F(ScreenTest, RequestsOfOtherSitesChangeNothing) {
  const std::string body = word().dump();
  HttpRequest forged = request("releaser", "POST", "/api/sessions/" + a_ + "/release", body);
  EXPECT_EQ(screen_.answer(forged).status, 403);
  forged.headers["x-isoshift-token"] = Json::parse(get("/api/me", "viewer").body).at("token");
  EXPECT_EQ(screen_.answer(forged).status, 403) << "the token of another user";
  forged.headers["x-isoshift-token"] = Json::parse(get("/api/me", "releaser").body).at("token");
  forged.headers["content-type"] = "text/plain";
  EXPECT_EQ(screen_.answer(forged).status, 415);
  EXPECT_FALSE(tree_.is_released(a_));
}

TEST_F(ScreenTest, OnlyFilesOfTheRecordAreShown) {
  for (const std::string& path : std::vector<std::string>{"../audit.jsonl", "../../registered/" + a_ + ".json",
                                                          "result.json", "report.html/", "nothing"})
    EXPECT_EQ(get("/api/sessions/" + a_ + "/" + path).status, 404) << path;
  EXPECT_EQ(get("/api/sessions/..").status, 404);
  EXPECT_EQ(get("/api/sessions/").status, 404);
}

TEST_F(ScreenTest, TheReportComesAsRegisteredAndIsNotedAsViewed) {
  const HttpResponse report = get("/api/sessions/" + a_ + "/report.html");
  ASSERT_EQ(report.status, 200);
  EXPECT_EQ(report.body, text_of(tree_.session(a_) / "report.html"));
  EXPECT_THAT(report.headers.front().second, HasSubstr("sandbox allow-scripts"));
  EXPECT_THAT(text_of(tree_.path() / "audit.jsonl"), HasSubstr("\"event\":\"viewed\""));
  EXPECT_THAT(text_of(tree_.path() / "audit.jsonl"), HasSubstr("\"by\":\"viewer\""));
  std::ofstream(tree_.session(a_) / "report.html") << "<p>another</p>";
  EXPECT_EQ(get("/api/sessions/" + a_ + "/report.html").status, 409);
}

TEST_F(ScreenTest, OtherMethodsAndAddressesAreRefused) {
  EXPECT_EQ(screen_.answer(request("viewer", "DELETE", "/api/sessions/" + a_)).status, 405);
  EXPECT_EQ(get("/elsewhere").status, 404);
  EXPECT_EQ(post("releaser", "/api/sessions/" + a_ + "/explode", {}).status, 404);
}

// With passwords instead of a proxy.
class ScreenWithPasswords : public testing::Test {
 protected:
  HttpResponse sign_in(const std::string& user, const std::string& password) {
    return screen_.answer({.method = "POST",
                           .path = "/api/sign-in",
                           .headers = {{"content-type", "application/json"}},
                           .body = Json{{"user", user}, {"password", password}}.dump(),
                           .from = "127.0.0.1",
                           .is_encrypted = true});
  }

  TemporaryFolder folder_;
  ServeFile serve_{.watch = {.results = folder_ / "results", .site = {.name = "Linac 3"}},
                   .pam_service = "isoshift",
                   .roles = {{"doe", {Role::kView}}}};
  SystemClock clock_;
  Room room_{serve_.watch, clock_};
  SignIns sign_ins_{serve_, clock_,
                    [](const std::string&, const std::string& password) { return password == "right"; }};
  Desk desk_{room_, clock_, [](const std::vector<std::string>&) { return RegisterOptions(); }};
  Screen screen_{room_, desk_, sign_ins_, clock_, false};
};

TEST_F(ScreenWithPasswords, OpenWithACookieThatNoOtherHostCanPlant) {
  EXPECT_EQ(screen_.answer({.method = "GET", .path = "/"}).status, 303);
  EXPECT_EQ(screen_.answer({.method = "GET", .path = "/sign-in"}).status, 200);
  EXPECT_EQ(sign_in("doe", "wrong").status, 403);
  const HttpResponse in = sign_in("doe", "right");
  ASSERT_EQ(in.status, 200);
  const std::string cookie = in.headers.front().second;
  EXPECT_THAT(cookie, testing::StartsWith("__Host-isoshift="));
  EXPECT_THAT(cookie, HasSubstr("; Path=/; HttpOnly; SameSite=Strict; Secure"));
  const HttpRequest list{.method = "GET",
                         .path = "/api/room",
                         .headers = {{"cookie", cookie.substr(0, cookie.find(';'))}},
                         .is_encrypted = true};
  EXPECT_EQ(screen_.answer(list).status, 200);
  const std::string audit = text_of(folder_ / "results" / "audit.jsonl");
  EXPECT_THAT(audit, HasSubstr("\"event\":\"sign-in refused\""));
  EXPECT_THAT(audit, HasSubstr("\"event\":\"signed in\""));
}

// Bytes that are no UTF-8 had kept the audit log locked.
TEST_F(ScreenWithPasswords, NamesThatNobodyHasAreNotEvenLogged) {
  for (const std::string& name : {std::string(), std::string(65, 'a'), std::string(63, 'a') + "\xc3\xa9",
                                  std::string("root\0x", 6), std::string("a b"), std::string("a\nb")})
    EXPECT_EQ(sign_in(name, "x").status, 400) << name;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "results" / "audit.jsonl"));
}

}  // namespace
}  // namespace isoshift::screen_test
