// deidentify and bundle: nothing tells who the patient is, and all of it registers as before.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "base/error.h"
#include "base/text_file.h"
#include "io/dicom/ct_series.h"
#include "io/study/files_below.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"
#include "workflow/register/truth.h"

namespace isoshift::deidentify_command_test {
namespace {

using testing::HasSubstr;
using testing::Not;

class DeidentifyCommandTest : public testing::Test {
 protected:
  DeidentifyCommandTest() {
    for (const std::filesystem::path& file : files_below({study_.path()})) {
      if (file.extension() != ".dcm") continue;
      edit(file, [&](DicomItem dataset) {
        dataset.put(DCM_PatientName, "Featherstone^Adalgunde");
        dataset.put(DCM_PatientID, "4711-0815");
        dataset.put(DCM_InstitutionName, "St. Elsewhere");
        dataset.put(DCM_StationName, "QUINCY7");
        if (dataset.has_value(DCM_RTImageLabel))
          dataset.put(DCM_RTImageLabel, "Featherst " + dataset.required_text(DCM_InstanceNumber));
        for (const DcmTagKey& tag : {DCM_SOPInstanceUID, DCM_StudyInstanceUID, DCM_FrameOfReferenceUID})
          if (dataset.has_value(tag)) uids_.insert(dataset.required_text(tag));
      });
    }
    std::filesystem::rename(study_.image(0), study_.path() / "RTIMAGE/Featherstone.dcm");
  }

  std::string path(const std::string& name) const { return (study_.path().parent_path() / name).string(); }

  void expect_tells_nothing(const std::filesystem::path& folder) const {
    std::size_t files = 0;
    for (const std::filesystem::path& file : files_below({folder})) {
      ++files;
      const std::string bytes = file.string().substr(folder.string().size()) + text_of_file(file);
      for (const char* told : {"Featherst", "Adalgunde", "4711-0815", "St. Elsewhere", "QUINCY7"})
        EXPECT_EQ(bytes.find(told), std::string::npos) << file << " tells " << told;
      for (const std::string& uid : uids_) EXPECT_EQ(bytes.find(uid), std::string::npos) << file << " tells " << uid;
    }
    EXPECT_GT(files, 20);
  }

  SmallStudy study_;
  std::set<std::string> uids_;
};

TEST_F(DeidentifyCommandTest, TheStudyRegistersAsBefore) {
  const CommandOutcome done = run_command({"deidentify", study_.path().string(), "-o", path("safe")});
  ASSERT_EQ(done.exit_status, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("RTIMAGE        2 files"));
  EXPECT_THAT(done.err, HasSubstr("CT: pixels stay as they are; from the CT of a head, the face can be drawn"));
  expect_tells_nothing(path("safe"));

  ASSERT_EQ(run_command({"register", study_.path().string(), "-o", path("before")}).exit_status, 0);
  const CommandOutcome again = run_command({"register", path("safe"), "-o", path("after")});
  ASSERT_EQ(again.exit_status, 0) << again.err;
  EXPECT_THAT(read_setup_error(path("after/result.json")),
              PoseNear(read_setup_error(path("before/result.json")), 1e-9, 1e-9));
}

// The frames of an Enhanced CT lie where they lay, and two stacks stay two.
TEST_F(DeidentifyCommandTest, AnEnhancedCtStaysTheSameVolume) {
  for (const auto& entry : std::filesystem::directory_iterator(study_.path() / "CT"))
    std::filesystem::remove(entry.path());
  const std::filesystem::path ct = study_.path() / "CT/enhanced.dcm";
  std::filesystem::copy_file(testdata("enhanced/plain.dcm"), ct);
  const auto first_frame = [](const DicomItem& d) {
    return d.items(DCM_PerFrameFunctionalGroupsSequence)[0].items(DCM_FrameContentSequence)[0];
  };
  edit(ct, [&](DicomItem d) {
    first_frame(d).put(DCM_StackID, "Adalgunde");
    first_frame(d).put(DCM_FrameComments, "Adalgunde");
  });
  const auto refusal_of = [](const std::filesystem::path& file) -> std::string {
    try {
      Notes notes;
      read_ct_series(std::array{file}, {}, notes, {});
      return "none";
    } catch (const Error& error) {
      return error.what();
    }
  };
  ASSERT_EQ(run_command({"deidentify", study_.path().string(), "-o", path("stacks")}).exit_status, 0);
  EXPECT_THAT(refusal_of(ct), HasSubstr("holds 2 volumes"));
  EXPECT_THAT(refusal_of(path("stacks/CT/00001.dcm")), HasSubstr("holds 2 volumes"));
  EXPECT_THAT(text_of_file(path("stacks/CT/00001.dcm")), Not(HasSubstr("Adalgunde")));

  edit(ct, [&](DicomItem d) { first_frame(d).put(DCM_StackID, "1"); });
  ASSERT_EQ(run_command({"deidentify", study_.path().string(), "-o", path("safe")}).exit_status, 0);
  Notes notes;
  const CtSeries before = read_ct_series(std::array{ct}, {}, notes, {}),
                 after = read_ct_series(std::array{std::filesystem::path(path("safe/CT/00001.dcm"))}, {}, notes, {});
  EXPECT_EQ(after.hu.voxels, before.hu.voxels);
  EXPECT_TRUE(after.hu.patient_from_voxel.isApprox(before.hu.patient_from_voxel));
}

TEST_F(DeidentifyCommandTest, NamesAndDatesThatAreTheSameStayTheSame) {
  edit(study_.plan(), [](DicomItem d) {
    d.put(DCM_PatientName, "FEATHERSTONE^ADALGUNDE^^");
    d.put(DCM_PatientBirthDate, "1950.01.02");
  });
  for (const std::filesystem::path& image : files_below({study_.path() / "RTIMAGE"}))
    edit(image, [](DicomItem d) { d.put(DCM_PatientBirthDate, "19500102"); });
  for (int k = 0; k < 36; ++k) edit(study_.ct_slice(k), [](DicomItem d) { d.put(DCM_PatientBirthDate, "19500102"); });
  ASSERT_EQ(run_command({"register", study_.path().string(), "-o", path("before")}).exit_status, 0);
  ASSERT_EQ(run_command({"deidentify", study_.path().string(), "-o", path("safe")}).exit_status, 0);
  EXPECT_EQ(run_command({"register", path("safe"), "-o", path("after")}).exit_status, 0);
}

TEST_F(DeidentifyCommandTest, WhatIsWrittenIsStillWholeDicom) {
  ASSERT_EQ(run_command({"deidentify", study_.path().string(), "-o", path("safe")}).exit_status, 0);
  // The phantom's plan and X-rays are short of some things, before and after.
  const auto errors_in = [](const std::filesystem::path& folder) {
    return run_shell(fmt::format("find {} -name '*.dcm' | xargs -n 1 dciodvfy -new 2>&1 | grep ^Error | sort",
                                 folder.string()))
        .out;
  };
  EXPECT_EQ(errors_in(path("safe")), errors_in(study_.path()));
}

TEST_F(DeidentifyCommandTest, BurntInTextIsWarnedOf) {
  edit(study_.image(1), [](DicomItem dataset) { dataset.put(DCM_BurnedInAnnotation, "YES"); });
  const CommandOutcome done = run_command({"deidentify", study_.path().string(), "-o", path("safe")});
  EXPECT_THAT(done.err, HasSubstr("RTIMAGE/00002.dcm: text is burnt into its pixels (BurnedInAnnotation (0028,0301) is "
                                  "YES)"));
}

TEST_F(DeidentifyCommandTest, AFileThatCannotBeReadStopsIt) {
  std::ofstream(study_.path() / "CT/broken.dcm") << "no DICOM";
  const CommandOutcome done = run_command({"deidentify", study_.path().string(), "-o", path("safe")});
  EXPECT_EQ(done.exit_status, 1);
  EXPECT_THAT(done.err, HasSubstr("broken.dcm"));
  EXPECT_FALSE(std::filesystem::exists(path("safe")));
}

TEST_F(DeidentifyCommandTest, WhatIsNoPartOfAStudyIsLeftAside) {
  std::filesystem::copy_file(testdata("results/0.1.0/accepted/report.dcm"), study_.path() / "report.dcm");
  const CommandOutcome done = run_command({"deidentify", study_.path().string(), "-o", path("safe")});
  EXPECT_EQ(done.exit_status, 0);
  EXPECT_THAT(done.err, HasSubstr("left aside: " + (study_.path() / "report.dcm").string()));
  EXPECT_EQ(run_command({"deidentify", (study_.path() / "report.dcm").string(), "-o", path("none")}).exit_status, 1);
  EXPECT_FALSE(std::filesystem::exists(path("none")));
}

class BundleCommandTest : public DeidentifyCommandTest {
 protected:
  BundleCommandTest() {
    EXPECT_EQ(run_command({"register", study_.path().string(), "-o", path("Featherstone"), "--seed", "3"}).exit_status,
              0);
  }
};

TEST_F(BundleCommandTest, TheResultIsFoundAgainFromIt) {
  const CommandOutcome done =
      run_command({"bundle", path("Featherstone"), study_.path().string(), "-o", path("bundle")});
  ASSERT_EQ(done.exit_status, 0) << done.err;
  expect_tells_nothing(path("bundle"));
  EXPECT_THAT(text_of_file(path("bundle/versions.txt")),
              testing::AllOf(HasSubstr("isoshift "), HasSubstr("libdcmdata")));
  EXPECT_THAT(text_of_file(path("bundle/README.txt")), HasSubstr("--seed 3"));
  const Eigen::Isometry3d found = read_setup_error(path("Featherstone/result.json"));
  EXPECT_THAT(read_setup_error(path("bundle/result/result.json")), PoseNear(found, 1e-9, 1e-9));
  ASSERT_EQ(run_command({"register", path("bundle/study"), "-o", path("again"), "--seed", "3"}).exit_status, 0);
  EXPECT_THAT(read_setup_error(path("again/result.json")), PoseNear(found, 1e-9, 1e-9));
  // Study and result belong together.
  const auto again = nlohmann::json::parse(text_of_file(path("again/result.json")));
  const auto bundled = nlohmann::json::parse(text_of_file(path("bundle/result/result.json")));
  EXPECT_EQ(again["references"]["images"], bundled["references"]["images"]);
  EXPECT_EQ(again["references"]["ct_series"], bundled["references"]["ct_series"]);
  EXPECT_EQ(again["patient"]["id"], bundled["patient"]["id"]);
  EXPECT_EQ(again["views"][0]["label"], bundled["views"][0]["label"]);
}

TEST_F(BundleCommandTest, AnotherCtOrObjectIsRefused) {
  const auto refused = [&] {
    const CommandOutcome outcome =
        run_command({"bundle", path("Featherstone"), study_.path().string(), "-o", path("bundle")});
    EXPECT_EQ(outcome.exit_status, 1);
    EXPECT_FALSE(std::filesystem::exists(path("bundle")));
    return outcome.err;
  };
  const std::filesystem::path object = path("Featherstone") + "/spatial_registration.dcm";
  std::filesystem::remove(object);
  std::filesystem::copy_file(testdata("registrations/HFS/spatial_registration.dcm"), object);
  EXPECT_THAT(refused(), HasSubstr("is not the registration object of the result"));
  for (int k = 0; k < 36; ++k)
    edit(study_.ct_slice(k), [](DicomItem dataset) { dataset.put(DCM_RescaleIntercept, -1000.0); });
  EXPECT_THAT(refused(), HasSubstr("the CT is not that which was registered: its SHA-256 is another"));
}

TEST_F(BundleCommandTest, WordsOfPeopleAreLeftOut) {
  edit(study_.image(1), [](DicomItem dataset) { dataset.put(DCM_AcquisitionTime, "113000"); });
  ASSERT_NE(run_command({"register", study_.path().string(), "-o", path("allowed"), "--allow",
                         "time-span=Featherstone coughed"})
                .exit_status,
            1);
  ASSERT_EQ(run_command({"bundle", path("allowed"), study_.path().string(), "-o", path("bundle")}).exit_status, 0);
  expect_tells_nothing(path("bundle"));
  EXPECT_THAT(text_of_file(path("bundle/result/result.json")), HasSubstr("(allowed by time-span)"));
}

// Who knows one date knows by how much all are moved.
TEST_F(BundleCommandTest, DatesAndMachinesInMessagesAreReplacedToo) {
  for (int k = 0; k < 36; ++k) edit(study_.ct_slice(k), [](DicomItem d) { d.put(DCM_AcquisitionDate, "20260401"); });
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_RadiationMachineName, "L9"); });
  ASSERT_NE(run_command({"register", study_.path().string(), "-o", path("warned")}).exit_status, 1);
  const std::string before = text_of_file(path("warned/result.json"));
  EXPECT_THAT(before, testing::AllOf(HasSubstr("20260401"), HasSubstr("20260301"), HasSubstr("\\\"L9\\\"")));
  ASSERT_EQ(run_command({"bundle", path("warned"), study_.path().string(), "-o", path("bundle")}).exit_status, 0);
  for (const std::filesystem::path& file : files_below({path("bundle")}))
    for (const char* told : {"20260401", "20260301", "2026-03-01", "\"L9", "L9\""})
      EXPECT_EQ(text_of_file(file).find(told), std::string::npos) << file << " tells " << told;
}

TEST_F(BundleCommandTest, WhatIsEmptyStaysEmpty) {
  ASSERT_EQ(run_command({"bundle", path("Featherstone"), study_.path().string(), "-o", path("bundle")}).exit_status, 0);
  const auto views_of = [&](const char* folder) {
    return nlohmann::json::parse(text_of_file(path(folder) + "/result.json"))["views"];
  };
  EXPECT_EQ(views_of("bundle/result")[0]["irradiated_field"]["doubt"],
            views_of("Featherstone")[0]["irradiated_field"]["doubt"]);
}

// Of several structure sets that which was registered, with no name left in the result.
TEST_F(BundleCommandTest, TheStructureSetIsThatOfTheResult) {
  const std::vector<Eigen::Vector3d> square = rectangle(small_phantom().placement.isocenter_patient_mm, 60, 60);
  draw(study_, {{"Featherstone PTV", {square}}, {"Featherstone cord", {square}}});
  const std::filesystem::path other = study_.path() / "other.dcm";
  std::filesystem::copy_file(study_.structures(), other);
  edit(other, [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "1.2.3.4.5");
    for (DicomItem roi : d.items(DCM_StructureSetROISequence)) roi.put(DCM_ROIName, "of another set");
  });
  ASSERT_NE(run_command({"register", study_.path().string(), "-o", path("drawn"), "--structures",
                         study_.structures().string(), "--target", "Featherstone PTV"})
                .exit_status,
            1);
  ASSERT_EQ(run_command({"bundle", path("drawn"), study_.path().string(), "-o", path("bundle")}).exit_status, 0);
  expect_tells_nothing(path("bundle"));
  EXPECT_THAT(text_of_file(path("bundle/result/result.json")), HasSubstr("\"Structure 1\""));
  EXPECT_EQ(files_below({path("bundle/study/RTSTRUCT")}).size(), 1U);

  std::filesystem::remove(study_.structures());
  const CommandOutcome without = run_command({"bundle", path("drawn"), study_.path().string(), "-o", path("none")});
  EXPECT_EQ(without.exit_status, 1);
  EXPECT_THAT(without.err, HasSubstr("the study does not hold the structure set of the result"));
}

TEST_F(BundleCommandTest, AReportDoesNotReplaceTheBundleAroundItsResult) {
  ASSERT_EQ(run_command({"bundle", path("Featherstone"), study_.path().string(), "-o", path("bundle")}).exit_status, 0);
  const CommandOutcome outcome = run_command({"report", path("bundle/result"), "-o", path("bundle"), "--overwrite"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("holds " + path("bundle/result") + ", which is read"));
  EXPECT_TRUE(std::filesystem::exists(path("bundle/study/CT/00001.dcm")));
}

TEST_F(BundleCommandTest, AnotherStudyIsRefused) {
  edit(study_.image(1), [](DicomItem dataset) { dataset.put(DCM_GantryAngle, 91.0); });
  const CommandOutcome changed =
      run_command({"bundle", path("Featherstone"), study_.path().string(), "-o", path("bundle")});
  EXPECT_EQ(changed.exit_status, 1);
  EXPECT_THAT(changed.err, HasSubstr("is not the file that was registered: its SHA-256 is another"));
  std::filesystem::remove(study_.image(1));
  const CommandOutcome without =
      run_command({"bundle", path("Featherstone"), study_.path().string(), "-o", path("bundle")});
  EXPECT_THAT(without.err, HasSubstr("the study does not hold the X-ray"));
  EXPECT_FALSE(std::filesystem::exists(path("bundle")));
}

}  // namespace
}  // namespace isoshift::deidentify_command_test
