#include "io/config/site_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::site_file_test {
namespace {

using testing::HasSubstr;

class SiteFileTest : public testing::Test {
 protected:
  SiteFile read(const std::string& json) {
    std::ofstream(path_, std::ios::trunc) << json;
    return read_site_file(path_);
  }
  std::string error_of(const std::string& more) {
    try {
      read("{\"site_file\": 1, \"name\": \"A\", " + more + "}");
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "site.json";
};

// The example of docs/site-file.md is one, and fits the schema.
TEST_F(SiteFileTest, TheExampleInTheDocumentationIsRead) {
  std::ifstream page(std::string(ISOSHIFT_SOURCE_DIR) + "/docs/site-file.md");
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  const auto begin = text.find("```json") + 7;
  const SiteFile site = read(text.substr(begin, text.find("```", begin) - begin));
  EXPECT_EQ(site.name, "Linac 3");
  EXPECT_EQ(action_level(site, "")->translation_mm, 3.0);
  EXPECT_EQ(action_level(site, "head")->rotation_deg, 1.0);
  EXPECT_FALSE(action_level(site, "head")->vector_mm);
  EXPECT_EQ(site.couch_dof, CouchDof::kFour);
  EXPECT_EQ(site.couch_scale->scale, CouchScale::kVarianIec);
  EXPECT_EQ(site.couch_scale->validated_by, "J. Doe");
  EXPECT_EQ(site.length_unit, LengthUnit::kMm);
  EXPECT_FALSE(site.automatic_release);
  EXPECT_EQ(site.sha256.size(), 64U);
  const CommandOutcome checked = run_shell(fmt::format("/usr/bin/python3 -m jsonschema -i {} {}/docs/site.schema.json",
                                                       path_.string(), ISOSHIFT_SOURCE_DIR));
  EXPECT_EQ(checked.exit_status, 0) << checked.out;
}

TEST_F(SiteFileTest, MistakesAreNamed) {
  EXPECT_THAT(error_of("\"couch\": {\"degrees_of_freedom\": 5}"),
              HasSubstr("couch: degrees_of_freedom is 5, expected 3, 4 or 6"));
  EXPECT_THAT(error_of("\"couch\": {\"scale\": {\"name\": \"Varian IEC\"}}"),
              HasSubstr("scale: validated_by is missing"));
  EXPECT_THAT(error_of("\"couch\": {\"scale\": {\"name\": \"Elekta\"}}"),
              HasSubstr("name is \"Elekta\", expected \"IEC 61217\""));
  EXPECT_THAT(error_of("\"action_levels\": {\"head\": {}}"), HasSubstr("action_levels: head: is empty"));
  EXPECT_THAT(error_of("\"action_levels\": {\"head\": {\"translation_mm\": -1}}"),
              HasSubstr("translation_mm is -1, expected 0 to 100"));
  EXPECT_THAT(error_of("\"action_levels\": {\"head\": {\"mm\": 1}}"), HasSubstr("there is no key mm"));
  EXPECT_THAT(error_of("\"length_unit\": \"inch\""), HasSubstr("length_unit is \"inch\", expected mm or cm"));
  EXPECT_THAT(error_of("\"release\": {\"rule\": \"automatic\"}"), HasSubstr("release: by is missing"));
  EXPECT_THAT(error_of("\"release\": {\"rule\": \"automatic\", \"by\": \"A\", \"on\": \"today\"}"),
              HasSubstr("on is \"today\", expected a day"));
  EXPECT_THAT(error_of("\"releases\": 1"), HasSubstr("there is no key releases"));
}

TEST_F(SiteFileTest, LocalizationLimitsHaveBothNumbers) {
  const auto with = [](const std::string& limits) {
    return R"({"site_file": 1, "name": "A", "localization_limits": )" + limits + "}";
  };
  const SiteFile site = read(with(R"({"translation_mm": 1, "rotation_deg": 0.5})"));
  EXPECT_EQ(site.localization_limits->translation_mm, 1.0);
  EXPECT_EQ(site.localization_limits->rotation_deg, 0.5);
  EXPECT_THROW(read(with(R"({"translation_mm": 1})")), Error);
  EXPECT_THROW(read(with(R"({"translation_mm": 11, "rotation_deg": 0.5})")), Error);
}

TEST_F(SiteFileTest, TargetsAreOfAnatomies) {
  const SiteFile site = read(R"({"site_file": 1, "name": "A", "targets": {"head": "PTV 60", "default": "isocenter"}})");
  EXPECT_EQ(target_named(site, "head"), "PTV 60");
  EXPECT_EQ(target_named(site, ""), "isocenter");
  EXPECT_EQ(target_named(site, "pelvis"), "isocenter");
  EXPECT_FALSE(action_level(site, "head"));  // known by its target
  EXPECT_EQ(target_named(read(R"({"site_file": 1, "name": "A"})"), "head"), "");
  EXPECT_THAT(error_of("\"targets\": {\"head\": \" \"}"), HasSubstr("targets: head is empty"));
}

TEST_F(SiteFileTest, SurrogatesAreOfAnatomies) {
  const SiteFile site = read(R"({"site_file": 1, "name": "A", "surrogates": {"prostate": "Pelvis"}})");
  EXPECT_EQ(surrogate_named(site, "prostate"), "Pelvis");
  EXPECT_EQ(surrogate_named(site, "head"), "");
  EXPECT_EQ(surrogate_named(site, ""), "");
  EXPECT_FALSE(action_level(site, "prostate"));  // known by its surrogate
  EXPECT_THAT(error_of("\"surrogates\": {\"prostate\": \"\"}"), HasSubstr("surrogates: prostate is empty"));
}

TEST_F(SiteFileTest, AnAnatomyItDoesNotKnowIsRefused) {
  const SiteFile site = read(R"({"site_file": 1, "name": "A", "action_levels": {"head": {"vector_mm": 2}}})");
  EXPECT_FALSE(action_level(site, ""));
  EXPECT_THROW(
      {
        try {
          action_level(site, "pelvis");
        } catch (const UsageError& error) {
          EXPECT_THAT(
              error.what(),
              HasSubstr("--anatomy pelvis: site file \"A\" has this anatomy neither in action_levels nor in targets or "
                        "surrogates. It has: head"));
          throw;
        }
      },
      UsageError);
}

}  // namespace
}  // namespace isoshift::site_file_test
