#include "io/objects/pseudonyms.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isoshift::pseudonyms_test {
namespace {

TEST(Pseudonyms, AreTheSameForTheSame) {
  Pseudonyms pseudonyms;
  const std::string uid = pseudonyms.uid("1.2.3");
  EXPECT_NE(uid, "1.2.3");
  EXPECT_EQ(pseudonyms.uid("1.2.3"), uid);
  EXPECT_NE(pseudonyms.uid("1.2.4"), uid);
  EXPECT_EQ(pseudonyms.text("Machine", "TB1"), "Machine 1");
  EXPECT_EQ(pseudonyms.text("Machine", "TB2"), "Machine 2");
  EXPECT_EQ(pseudonyms.text("Machine", "TB1"), "Machine 1");
  EXPECT_EQ(pseudonyms.text("Structure", "PTV"), "Structure 1");
  EXPECT_EQ(pseudonyms.text("Structure", "ptv"), "Structure 2");
  EXPECT_EQ(pseudonyms.patient_name("Smith^John"), "Patient 1");
  EXPECT_EQ(pseudonyms.patient_name("SMITH^JOHN"), "Patient 1");
  EXPECT_EQ(pseudonyms.patient_name("Smith^John^^ "), "Patient 1");
  EXPECT_EQ(pseudonyms.patient_name("Smith^Jane"), "Patient 2");
  EXPECT_EQ(pseudonyms.birth_date("19570301"), "18500101");
  EXPECT_EQ(pseudonyms.birth_date("19570302"), "18500102");
  EXPECT_EQ(pseudonyms.birth_date("1957.03.02"), "18500102");
  EXPECT_EQ(pseudonyms.birth_date("19570301"), "18500101");
  EXPECT_NE(Pseudonyms().uid("1.2.3"), uid);
}

TEST(Pseudonyms, AnIdOfTwoIssuersIsOfTwoPatients) {
  Pseudonyms pseudonyms;
  EXPECT_EQ(pseudonyms.patient_id("7", "St. Elsewhere"), "ANON 1");
  EXPECT_EQ(pseudonyms.patient_id("7", "Princeton"), "ANON 2");
  EXPECT_EQ(pseudonyms.patient_id("7", "St. Elsewhere"), "ANON 1");
  EXPECT_EQ(pseudonyms.patient_id("8", ""), "ANON 3");
  EXPECT_EQ(pseudonyms.patient_id("8", "Princeton"), "ANON 3");
  EXPECT_EQ(pseudonyms.patient_id("8", "St. Elsewhere"), "ANON 4");
  EXPECT_EQ(pseudonyms.patient_id("9", "Princeton"), "ANON 5");
  EXPECT_EQ(pseudonyms.patient_id("9", ""), "ANON 5");
}

TEST(Pseudonyms, DatesMoveTogetherAndKeepTheirForm) {
  const Pseudonyms pseudonyms;
  const std::string moved = pseudonyms.date("20260301");
  ASSERT_EQ(moved.size(), 8);
  EXPECT_LT(moved, "20260301");
  EXPECT_EQ(pseudonyms.date("2026.03.01"), moved.substr(0, 4) + "." + moved.substr(4, 2) + "." + moved.substr(6));
  EXPECT_EQ(pseudonyms.date("2026-03-01T10:16:02+0100"),
            moved.substr(0, 4) + "-" + moved.substr(4, 2) + "-" + moved.substr(6) + "T10:16:02+0100");
  EXPECT_EQ(pseudonyms.date("20260301101602.5"), moved + "101602.5");
  for (const char* none : {"", "yesterday", "2026", "20261301", "2026-3-1", "Smith 20260301"})
    EXPECT_EQ(pseudonyms.date(none), "") << none;
}

TEST(Pseudonyms, ReplaceWordsOfSentences) {
  Pseudonyms pseudonyms;
  pseudonyms.text("Image", "KV1");
  pseudonyms.text("Image", "KV1_G090");
  pseudonyms.text("Image", "0");
  pseudonyms.uid("1.2.3");
  pseudonyms.stands_for("exported/Smith/a.dcm", "CT/00001.dcm");
  EXPECT_EQ(pseudonyms.in("exported/Smith/a.dcm: KV1_G090, KV1 and kv1 at 0 1.2.3"),
            "CT/00001.dcm: Image 2, Image 1 and kv1 at 0 " + pseudonyms.uid("1.2.3"));
  EXPECT_EQ(pseudonyms.in("MKV1"), "MKV1");
  EXPECT_EQ(pseudonyms.in("0"), "Image 3");
  EXPECT_EQ(pseudonyms.in("0 is \"0\""), "0 is \"Image 3\"");
}

TEST(Pseudonyms, NothingStandsForNothing) {
  Pseudonyms pseudonyms;
  pseudonyms.patient_id("7", "");
  EXPECT_EQ(pseudonyms.in(""), "");
}

TEST(Pseudonyms, DatesOfSentencesAreMoved) {
  const Pseudonyms pseudonyms;
  const std::string day = pseudonyms.date("20260301"), other_day = pseudonyms.date("2026-04-01");
  EXPECT_EQ(pseudonyms.in("taken on 20260301, before the CT of 2026-04-01 10:15:00"),
            "taken on " + day + ", before the CT of " + other_day + " 10:15:00");
  EXPECT_EQ(pseudonyms.in("2026-04-01T10:15:00"), other_day + "T10:15:00");
  for (const char* none : {"1.2.20260301.4", "20260301.5 mm", "120260301", "20261301", "a20260301"})
    EXPECT_EQ(pseudonyms.in(none), none);
}

}  // namespace
}  // namespace isoshift::pseudonyms_test
