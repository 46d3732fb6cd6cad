#include "io/session_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isoshift {
namespace {

StudyFiles::Image image(const std::string& uid, const std::string& label, std::optional<double> at_s,
                        const std::string& patient = "P", const std::string& plan = "1") {
  return {
      .file = "/x/" + uid, .patient = patient, .sop_instance_uid = uid, .plan_uid = plan, .label = label, .at_s = at_s};
}

std::vector<std::size_t> sizes(const std::vector<StudyFiles::Image>& images) {
  StudyFiles files;
  files.images = images;
  std::vector<std::size_t> sizes;
  for (const SessionFiles& session : sessions_of(files, false)) sizes.push_back(session.images.size());
  return sizes;
}

TEST(Sessions, ArePatientsPlansAndMoments) {
  using testing::ElementsAre;
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 599)}), ElementsAre(2));
  EXPECT_THAT(sizes({image("2", "B", 601), image("1", "A", 0)}), ElementsAre(1, 1));
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 1, "Q")}), ElementsAre(1, 1));
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 1, "P", "2")}), ElementsAre(1, 1));
  // Taken again after a move: a label that comes again begins another session.
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 5), image("3", "A", 60), image("4", "B", 65)}),
              ElementsAre(2, 2));
  EXPECT_THAT(sizes({image("1", "A", 0), image("1", "A", 0)}), ElementsAre(1));  // twice the same
  EXPECT_THAT(sizes({image("1", "A", std::nullopt), image("2", "B", std::nullopt)}), ElementsAre(2));
}

TEST(Sessions, NamesFollowFromTheXraysAlone) {
  StudyFiles one, other;
  one.images = {image("1", "A", 0), image("2", "B", 5)};
  other.images = {image("2", "B", 5), image("1", "A", 0)};
  EXPECT_EQ(sessions_of(one, false)[0].name, sessions_of(other, false)[0].name);
  other.images[0].sop_instance_uid = "3";
  EXPECT_NE(sessions_of(one, false)[0].name, sessions_of(other, false)[0].name);
}

TEST(Sessions, AnAbsentIssuerIsTheOnlyOneThereIs) {
  StudyFiles files;
  files.images = {image("1", "A", 0)};
  files.images[0].patient = "7\\";
  const auto ct_of = [](const std::string& patient) {
    return StudyFiles::Ct{
        .patient = patient, .series_instance_uid = patient, .frame_of_reference_uid = "f", .files = {"a"}};
  };
  files.cts = {ct_of("7\\HOSPITAL"), ct_of("70\\HOSPITAL")};
  const auto own = [&] {
    std::vector<std::string> patients;
    for (const StudyFiles::Ct& ct : files_for(sessions_of(files, false)[0], files).cts) patients.push_back(ct.patient);
    return patients;
  };
  EXPECT_THAT(own(), testing::ElementsAre("7\\HOSPITAL"));
  files.cts.push_back(ct_of("7\\OTHER"));
  EXPECT_THAT(own(), testing::IsEmpty());
  files.cts.push_back(ct_of("7\\"));
  EXPECT_THAT(own(), testing::ElementsAre("7\\"));
  files.images[0].patient = "7\\OTHER";
  EXPECT_THAT(own(), testing::ElementsAre("7\\OTHER"));
}

TEST(Sessions, WhatIsReferredToAndNotThereIsMissing) {
  StudyFiles files;
  files.images = {image("1", "A", 0)};
  EXPECT_THAT(missing_parts(files), testing::ElementsAre("the CT", "the RT Plan 1"));
  files.plans = {
      {.file = "p", .patient = "P", .sop_instance_uid = "1", .frame_of_reference_uid = "f", .structure_set_uid = "s"}};
  files.cts = {{.patient = "P",
                .series_instance_uid = "c",
                .frame_of_reference_uid = "f",
                .files = {"a"},
                .sop_instance_uids = {"a"}}};
  EXPECT_THAT(missing_parts(files), testing::ElementsAre("the RT Structure Set s"));
  files.structures = {{.file = "r",
                       .patient = "P",
                       .sop_instance_uid = "s",
                       .ct_series_uids = {"c"},
                       .ct_sop_instance_uids = {"a", "b"},
                       .frame_of_reference_uids = {"f"}}};
  EXPECT_THAT(missing_parts(files), testing::ElementsAre("1 of the 2 CT images of the RT Structure Set"));
  files.cts[0].sop_instance_uids.insert("b");
  EXPECT_THAT(missing_parts(files), testing::IsEmpty());
}

}  // namespace
}  // namespace isoshift
