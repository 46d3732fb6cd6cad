// Registration by hand: what the page asks for, and the whole in a browser.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <thread>

#include "serve/view_screen.h"
#include "tests/support/command.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"
#include "workflow/register/truth.h"

namespace isoshift::view_test {
namespace {

using Json = nlohmann::json;
using namespace std::chrono_literals;

const Json kEverything = {{"part", nullptr}, {"boxes", {nullptr, nullptr}}};

class ViewTest : public testing::Test {
 protected:
  ViewTest() {
    HttpResponse opened = screen_.answer({.method = "GET", .path = "/open/word"});
    for (const auto& [name, value] : opened.headers)
      if (name == "Set-Cookie") cookie_ = value.substr(0, value.find(';'));
  }
  HttpResponse get(const std::string& path) {
    return screen_.answer({.method = "GET", .path = path, .headers = {{"cookie", cookie_}}});
  }
  HttpResponse post(const std::string& path, const Json& body) {
    return screen_.answer({.method = "POST",
                           .path = path,
                           .headers = {{"cookie", cookie_},
                                       {"content-type", "application/json"},
                                       {"x-isoshift-token", Json::parse(get("/api/me").body).at("token")}},
                           .body = body.dump()});
  }
  static Json pose(double x_mm) {
    return {{"translation_mm", {x_mm, 0, 0}}, {"rotation_matrix", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
  }
  static StudyOptions options_of(const SmallStudy& study) {
    StudyOptions options;
    options.parts.study = study.path();
    return options;
  }
  Json end_of_registration() {
    for (;;) {
      const Json state = Json::parse(get("/api/manual/state").body);
      if (state.at("state") != "runs") return state;
      std::this_thread::sleep_for(20ms);
    }
  }

  SmallStudy files_;
  Observer nobody_;
  LiveStudy study_{options_of(files_), nobody_};
  ManualRegistration registration_{{.parts = options_of(files_).parts, .flags = {"--preset=fast"}}, files_.output()};
  ManualScreen manual_{study_, registration_};
  ServeFile serve_{.roles = {{"doe", {Role::kView, Role::kRegister}}}};
  SystemClock clock_;
  bool is_used_ = false;
  SignIns sign_ins_{serve_, clock_, [this](const std::string&, const std::string& password) {
                      return password == "word" && !std::exchange(is_used_, true);
                    }};
  ViewScreen screen_{manual_, sign_ins_, "doe"};
  std::string cookie_;
};

TEST_F(ViewTest, TheAddressOpensOnceAndNothingElseDoes) {
  EXPECT_FALSE(cookie_.empty());
  EXPECT_EQ(get("/").status, 200);
  EXPECT_EQ(screen_.answer({.method = "GET", .path = "/open/word"}).status, 403);
  EXPECT_EQ(screen_.answer({.method = "GET", .path = "/open/other"}).status, 403);
  for (const char* path : {"/", "/manual.js", "/api/me", "/api/manual/study", "/api/manual/xrays", "/api/manual/state"})
    EXPECT_EQ(screen_.answer({.method = "GET", .path = path}).status, 403) << path;
  EXPECT_EQ(screen_
                .answer({.method = "POST",
                         .path = "/api/manual/begin",
                         .headers = {{"cookie", cookie_}, {"content-type", "application/json"}},
                         .body = Json{{"setup_error", pose(0)}, {"searched", true}, {"region", kEverything}}.dump()})
                .status,
            403)
      << "without the token";
  EXPECT_EQ(get("/api/manual/other").status, 404);
}

TEST_F(ViewTest, TheViewsArePicturesOfTheXraysAndSayWhereTheRoomLies) {
  const Json study = Json::parse(get("/api/manual/study").body);
  ASSERT_EQ(study.at("views").size(), 2U);
  const Json& front = study.at("views")[0];
  EXPECT_EQ(front.at("sizes"), Json({{96, 96}, {48, 48}, {24, 24}}));
  // Gantry 0: x of the room to the right on the picture, y up, and z not at all.
  const Json& step = front.at("px_per_mm");
  EXPECT_GT(step[0][0], 0.1);
  EXPECT_NEAR(step[0][1], 0.0, 1e-9);
  EXPECT_LT(step[1][1], -0.1);
  EXPECT_NEAR(step[0][2].get<double>() + step[1][2].get<double>(), 0.0, 1e-6);
  EXPECT_NEAR(front.at("from_source")[2], -1.0, 1e-9);
  EXPECT_EQ(get("/api/manual/xrays").body.size(), 2U * 96 * 96);
  EXPECT_EQ(study.at("start"), pose(0));
}

TEST_F(ViewTest, TheDrrsFollowThePose) {
  const HttpResponse still = post("/api/manual/drrs", {{"setup_error", pose(0)}, {"detail", 0}});
  ASSERT_EQ(still.body.size(), 2U * 96 * 96);
  EXPECT_EQ(post("/api/manual/drrs", {{"setup_error", pose(0)}, {"detail", 2}}).body.size(), 2U * 24 * 24);
  const HttpResponse moved = post("/api/manual/drrs", {{"setup_error", pose(20)}, {"detail", 0}});
  // To the right in the first view, toward the source of the second: seen by the mean column of bright pixels.
  const auto mean_column = [](const std::string& bytes) {
    double sum = 0.0, weights = 0.0;
    for (std::size_t n = 0; n < std::size_t{96} * 96; ++n) {
      const auto gray = static_cast<unsigned char>(bytes[n]);
      sum += gray * static_cast<double>(n % 96);
      weights += gray;
    }
    return sum / weights;
  };
  const Json study = Json::parse(get("/api/manual/study").body);
  const double expected = 20.0 * study.at("views")[0].at("px_per_mm")[0][0].get<double>();
  EXPECT_NEAR(mean_column(moved.body) - mean_column(still.body), expected, 0.2 * expected);
}

TEST_F(ViewTest, WhatIsNoPoseIsRefused) {
  for (const Json& wrong : {Json{}, Json{{"translation_mm", {1, 2}}}, Json{{"translation_mm", {1, 2, 3}}}})
    EXPECT_EQ(post("/api/manual/drrs", {{"setup_error", wrong}, {"detail", 0}}).status, 400) << wrong;
  Json sheared = pose(0);
  sheared["rotation_matrix"][0][1] = 0.5;
  EXPECT_EQ(post("/api/manual/drrs", {{"setup_error", sheared}, {"detail", 0}}).status, 409);
  EXPECT_EQ(post("/api/manual/drrs", {{"setup_error", pose(1e6)}, {"detail", 0}}).status, 409);
  EXPECT_EQ(post("/api/manual/drrs", {{"setup_error", pose(0)}, {"detail", 7}}).status, 400);
}

TEST_F(ViewTest, ARegistrationRunsFromThePoseAndTellsHowFarItIs) {
  EXPECT_EQ(Json::parse(get("/api/manual/state").body).at("state"), "idle");
  EXPECT_EQ(post("/api/manual/begin", {{"setup_error", pose(3)}, {"searched", true}, {"region", kEverything}}).status,
            200);
  EXPECT_EQ(post("/api/manual/begin", {{"setup_error", pose(3)}, {"searched", true}, {"region", kEverything}}).status,
            409)
      << "one at a time";
  std::set<std::string> steps;
  Json state = Json::parse(get("/api/manual/state").body);
  for (; state.at("state") == "runs"; state = Json::parse(get("/api/manual/state").body)) {
    steps.insert(state.at("step").get<std::string>());
    std::this_thread::sleep_for(5ms);
  }
  EXPECT_EQ(state.at("state"), "ended") << state;
  EXPECT_TRUE(steps.contains("Registering")) << testing::PrintToString(steps);
  EXPECT_EQ(get("/api/manual/results/1/report.html").status, 200);
  EXPECT_EQ(Json::parse(get("/api/manual/state").body).at("folder"), (files_.output() / "1").string());
  EXPECT_EQ(post("/api/manual/begin", {{"setup_error", pose(3)}, {"searched", false}, {"region", kEverything}}).status,
            200);
  state = end_of_registration();
  EXPECT_EQ(state.at("verdict"), "review");
  EXPECT_EQ(state.at("folder"), (files_.output() / "2").string());
  EXPECT_NEAR(read_setup_error(files_.output() / "2" / "result.json").translation().x(), 3.0, 1e-9);
}

TEST_F(ViewTest, OnlyAPartAndABoxAreRegistered) {
  const Json study = Json::parse(get("/api/manual/study").body);
  ASSERT_EQ(study.at("parts").at(4), "body 5: bone");  // of the skull
  const Json region = {{"part", 4}, {"boxes", {{4, 6, 90, 92}, nullptr}}};
  EXPECT_EQ(post("/api/manual/begin", {{"setup_error", pose(0)}, {"searched", true}, {"region", region}}).status, 200);
  const Json end = end_of_registration();
  ASSERT_EQ(end.at("state"), "ended") << end;
  const Json result = Json::parse(std::ifstream(files_.output() / "1" / "result.json"));
  const std::string label = study.at("views")[0].at("label");
  EXPECT_THAT(result.at("region").dump(), testing::HasSubstr("body 5, margin 5 mm"));
  EXPECT_THAT(result.at("region").dump(), testing::HasSubstr("rectangle " + label + "=4,6,90,92"));
  const Json wrong = {{"part", 1000}, {"boxes", Json::array()}};
  EXPECT_EQ(post("/api/manual/begin", {{"setup_error", pose(0)}, {"searched", true}, {"region", wrong}}).status, 409);
}

TEST_F(ViewTest, OutlinesMoveWithThePatient) {
  const auto first_column = [&](double x_mm) {
    const HttpResponse answer = post("/api/manual/outlines", {{"setup_error", pose(x_mm)}, {"part", 0}});
    EXPECT_EQ(answer.status, 200) << answer.body;
    double least = 1e9;
    const Json views = Json::parse(answer.body).at("views");
    for (const Json& polygon : views.at(0))
      for (const Json& point : polygon) least = std::min(least, point.at(0).get<double>());
    return least;
  };
  const double px_per_mm = study_.views()[0].px_per_mm(0, 0);
  EXPECT_NEAR(first_column(10.0) - first_column(0.0), 10.0 * px_per_mm, 1.5);
  EXPECT_EQ(post("/api/manual/outlines", {{"setup_error", pose(0)}, {"part", 1000}}).status, 400);
}

TEST(LiveStudyTest, PartsAreTheStructuresOfTheCtAndItsBodies) {
  StudyOptions options;
  options.parts.study = testdata("head");
  Observer nobody;
  const LiveStudy study(options, nobody);
  const auto& parts = study.parts();
  const auto first_body = std::ranges::find_if(parts, [](const auto& part) { return part.words.starts_with("body "); });
  ASSERT_NE(first_body, parts.begin()) << "no structure";
  ASSERT_NE(first_body, parts.end());
  EXPECT_EQ(parts[0].words, "structure " + parts[0].flags[1]);
  EXPECT_EQ(parts[0].flags[0], "--structure");
  EXPECT_EQ(first_body->flags, (std::vector<std::string>{"--body", "1"}));
  for (std::size_t part = 0; part < parts.size(); ++part)
    EXPECT_EQ(study.outlines_of(part, Eigen::Isometry3d::Identity()).size(), study.views().size());
}

TEST_F(ViewTest, LandmarksGiveAPose) {
  Json xrays = Json::array(), drrs = Json::array();
  for (const XrayView& camera : study_.cameras()) {
    const Eigen::Vector2d moved = camera.project({15, 5, 5}).value(), still = camera.project({5, 5, 5}).value();
    xrays.push_back({moved.x(), moved.y()});
    drrs.push_back({still.x(), still.y()});
  }
  const HttpResponse answer =
      post("/api/manual/landmarks", {{"setup_error", pose(2)}, {"landmarks", {{{"xrays", xrays}, {"drrs", drrs}}}}});
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_NEAR(Json::parse(answer.body).at("setup_error").at("translation_mm").at(0).get<double>(), 12.0, 1e-6);
  drrs[1] = nullptr;
  EXPECT_EQ(
      post("/api/manual/landmarks", {{"setup_error", pose(2)}, {"landmarks", {{{"xrays", xrays}, {"drrs", drrs}}}}})
          .status,
      409);
  EXPECT_EQ(post("/api/manual/landmarks", {{"setup_error", pose(2)}}).status, 400);
}

TEST_F(ViewTest, WhatIsCancelledLeavesNothing) {
  EXPECT_EQ(post("/api/manual/begin", {{"setup_error", pose(0)}, {"searched", true}, {"region", kEverything}}).status,
            200);
  EXPECT_EQ(Json::parse(post("/api/manual/cancel", Json::object()).body).at("state"), "idle");
  EXPECT_TRUE(std::filesystem::is_empty(files_.output()));
}

TEST(View, IsUsedInABrowser) {
  if (!std::filesystem::exists("/usr/bin/chromedriver")) GTEST_SKIP() << "chromium-driver is not installed";
  const TemporaryFolder work;
  const CommandOutcome used = run_shell(fmt::format("/usr/bin/python3 {}/tests/serve/view_in_browser.py {} {}",
                                                    ISOSHIFT_SOURCE_DIR, ISOSHIFT_PROGRAM, (work / "").string()));
  EXPECT_EQ(used.exit_status, 0) << used.out;
}

}  // namespace
}  // namespace isoshift::view_test
