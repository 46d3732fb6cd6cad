#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <vector>

#include "io/dicom/rt_plan.h"
#include "tests/support/couch_by_hand.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"

namespace isoshift::check_command_test {
namespace {

using testing::HasSubstr;
using testing::Not;

const char* const kAxes[] = {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg", "pitch_deg", "roll_deg"};

class CheckCommandTest : public testing::Test {
 protected:
  // An object that isoshift wrote, and its plan: a head in HFS, couch at 0.
  static std::string ours() { return testdata("registrations/HFS/spatial_registration.dcm").string(); }
  static std::string plan() { return testdata("registrations/HFS/RTPLAN.dcm").string(); }
  const Eigen::Vector3d isocenter_ = small_phantom().placement.isocenter_patient_mm;

  static DicomItem matrix_item(const DicomItem& d) {
    return d.items(DCM_RegistrationSequence)[1].items(DCM_MatrixRegistrationSequence)[0].items(DCM_MatrixSequence)[0];
  }
  Eigen::Matrix4d our_matrix() const {
    const DicomFile file = DicomFile::read(ours(), DicomFile::Extent::kWhole);
    return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(
        matrix_item(file.dataset()).required_numbers(DCM_FrameOfReferenceTransformationMatrix, 16).data());
  }

  // A changed copy.
  std::string copy_of(const std::string& path, const std::string& name, const std::function<void(DicomItem)>& change) {
    const std::filesystem::path copy = folder_ / name;
    std::filesystem::copy_file(path, copy, std::filesystem::copy_options::overwrite_existing);
    edit(copy, change);
    return copy.string();
  }
  // A copy of ours that takes another frame to the CT.
  std::string ours_from(const std::string& frame, const Eigen::Matrix4d& matrix, const std::string& name,
                        const std::string& manufacturer) {
    return copy_of(ours(), name, [&](DicomItem d) {
      const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = matrix;
      d.put(DCM_Manufacturer, manufacturer);
      d.items(DCM_RegistrationSequence)[1].put(DCM_FrameOfReferenceUID, frame);
      matrix_item(d).put(DCM_FrameOfReferenceTransformationMatrix, std::span(rows.data(), 16));
    });
  }
  std::string inverted() { return ours_from("1.2.3.4", our_matrix().inverse(), "inverted.dcm", "isoshift"); }

  // As plastimatch and SlicerRT write it: no images listed, a source frame that begins 12.4 mm from the isocenter.
  std::string foreign() {
    Eigen::Matrix4d back = Eigen::Matrix4d::Identity();
    back.topRightCorner<3, 1>() = -Eigen::Vector3d(9.0, -5.0, 6.9);
    return ours_from("1.2.3.4", our_matrix() * back, "foreign.dcm", "Plastimatch");
  }

  // An object from the room's axes, of a patient found at R x + t from the couch's angles.
  std::string from_room(const Eigen::Matrix3d& r, const Eigen::Vector3d& t, const Eigen::Matrix3d& couch,
                        const std::string& name = "from_room.dcm") {
    Eigen::Isometry3d room_from_patient = Eigen::Isometry3d::Identity();
    room_from_patient.linear() = r * couch * fixed_from_patient();
    room_from_patient.translation() = t - room_from_patient.linear() * isocenter_;
    return ours_from("1.2.840.10008.1.4.3.1", room_from_patient.inverse().matrix(), name, "Somebody");
  }

  static nlohmann::json checked(const CommandOutcome& outcome, std::size_t n = 0) {
    return nlohmann::json::parse(outcome.out)["registrations"][n];
  }
  static void expect_shift(const nlohmann::json& registration, const std::array<double, 6>& expected,
                           double tolerance) {
    for (std::size_t n = 0; n < 6; ++n)
      EXPECT_NEAR(registration["couch_shift"][kAxes[n]].get<double>(), expected[n], tolerance) << kAxes[n];
  }
  static void expect_same_shift(const nlohmann::json& one, const nlohmann::json& other) {
    for (const char* axis : kAxes)
      EXPECT_NEAR(one["couch_shift"][axis].get<double>(), other["couch_shift"][axis].get<double>(), 1e-6) << axis;
  }

  TemporaryFolder folder_;
};

TEST_F(CheckCommandTest, OneWrittenNowPassesAndMeansTheShiftOfTheReport) {
  const SmallStudy study;
  ASSERT_EQ(register_study(study).exit_status, 0);
  const std::string written = (study.output() / "spatial_registration.dcm").string();
  const CommandOutcome outcome = run_command({"check", written, "--plan", study.plan().string(), "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_TRUE(checked(outcome)["passes"].get<bool>());
  std::ifstream file(study.output() / "result.json");
  expect_same_shift(checked(outcome), nlohmann::json::parse(file));
  EXPECT_THAT(run_command({"check", written}).out, HasSubstr("spatial_registration.dcm: passes"));
}

TEST_F(CheckCommandTest, AnInvertedOneIsFoundByThePlanAndByItsPair) {
  const CommandOutcome by_plan = run_command({"check", inverted(), "--plan", plan()});
  EXPECT_EQ(by_plan.exit_status, 1);
  EXPECT_THAT(by_plan.out, HasSubstr("the matrix looks inverted"));
  const CommandOutcome by_pair = run_command({"check", ours(), inverted()});
  EXPECT_EQ(by_pair.exit_status, 1);
  EXPECT_THAT(by_pair.out, HasSubstr("the second object looks inverted"));
}

TEST_F(CheckCommandTest, OneFromTheRoomMeansTheSameShift) {
  const SmallStudy study;
  ASSERT_EQ(register_study(study).exit_status, 0);
  const std::string from_room = (folder_ / "from_room").string();
  ASSERT_EQ(run_command({"register", study.path().string(), "-o", from_room, "--source-for", "iec-fixed"}).exit_status,
            0);
  const CommandOutcome outcome = run_command({"check", (study.output() / "spatial_registration.dcm").string(),
                                              from_room + "/spatial_registration.dcm", "--plan", study.plan().string(),
                                              "--couch-angle", "0", "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.out << outcome.err;
  expect_same_shift(checked(outcome, 0), checked(outcome, 1));
  const auto difference = nlohmann::json::parse(outcome.out)["difference"];
  EXPECT_NEAR(difference["translation_mm"].get<double>(), 0.0, 1e-6);
  EXPECT_NEAR(difference["rotation_deg"].get<double>(), 0.0, 1e-5);
}

TEST_F(CheckCommandTest, OneFromTheRoomIsNotTurnedByAGuess) {
  const std::string theirs = from_room(Eigen::Matrix3d::Identity(), {1, 2, 3}, Eigen::Matrix3d::Identity());
  const CommandOutcome shift = run_command({"check", theirs, "--plan", plan()});
  EXPECT_EQ(shift.exit_status, 1);
  EXPECT_THAT(shift.out, HasSubstr("Supply it: --couch-angle DEG"));
  EXPECT_THAT(shift.out, Not(HasSubstr("a couch shift of")));
  const CommandOutcome pair = run_command({"check", ours(), theirs});
  EXPECT_EQ(pair.exit_status, 1);
  EXPECT_THAT(pair.out, HasSubstr("difference: not known\n  error  " + theirs + " starts from the axes of the room"));
  EXPECT_THAT(pair.out,
              HasSubstr("--plan FILE, or --isocenter X,Y,Z and --patient-position HFS, and --couch-angle DEG"));
}

// docs/dicom.md 5.1, with the couch at 10 degrees.
TEST_F(CheckCommandTest, TheShiftFromTheRoomIsThatOfDicomMd51) {
  const std::string theirs = from_room(turned_deg(1, -0.5, 0.8), {3, -2, 1.5}, turned_deg(10, 0, 0));
  const CommandOutcome outcome = run_command(
      {"check", theirs, "--plan", plan(), "--couch-angle", "10", "--couch-pitch", "0", "--couch-roll", "0", "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.out << outcome.err;
  expect_shift(checked(outcome), {-2.607127, 2.490560, -1.5, 9.006284 - 10.0, 0.368649, -0.868385}, 2e-6);
}

TEST_F(CheckCommandTest, CouchPitchAndRollAtImagingEnterTheShift) {
  // A patient exactly as planned on a couch that is pitched and rolled.
  const std::string on_plan = from_room(Eigen::Matrix3d::Identity(), {0, 0, 0}, turned_deg(10, 2, -1.5));
  const std::vector<std::string> pitched = {"--plan", plan(),         "--couch-angle", "10",    "--couch-pitch",
                                            "2",      "--couch-roll", "-1.5",          "--json"};
  const auto check = [&](const std::string& file) {
    std::vector<std::string> arguments = {"check", file};
    arguments.insert(arguments.end(), pitched.begin(), pitched.end());
    const CommandOutcome outcome = run_command(arguments);
    EXPECT_EQ(outcome.exit_status, 0) << outcome.out << outcome.err;
    return checked(outcome);
  };
  expect_shift(check(on_plan), {0, 0, 0, 0, 0, 0}, 1e-6);
  EXPECT_THAT(check(on_plan)["findings"].dump(), Not(HasSubstr("taken as 0")));

  const Eigen::Matrix3d r = turned_deg(1.4, -2.1, 1.8);
  const Eigen::Vector3d t(4.3, -6.1, 3.2);
  expect_shift(check(from_room(r, t, turned_deg(10, 2, -1.5))), shift_by_hand(r, t, 10, 2, -1.5), 1e-6);

  // Ours starts from the axes of the patient as set up, which turn with the couch.
  const Eigen::Matrix3d set_up = turned_deg(10, 2, -1.5) * fixed_from_patient();
  const Eigen::Isometry3d treatment_from_ct = Eigen::Isometry3d(our_matrix()).inverse();
  expect_shift(check(ours()),
               shift_by_hand(set_up * treatment_from_ct.linear() * set_up.transpose(),
                             set_up * (treatment_from_ct * isocenter_), 10, 2, -1.5),
               1e-6);
}

// As consoles show it whose couch turns first: step 3 of docs/console-shifts.md.
TEST_F(CheckCommandTest, TheShiftOfACouchThatTurnsFirstIsSaidToo) {
  const Eigen::Isometry3d moved = Eigen::Translation3d(3.0, -4.0, 5.0) *
                                  Eigen::AngleAxisd(rad_from_deg(3.0), Eigen::Vector3d(1, 2, 2).normalized());
  const Eigen::Vector3d isocenter(-12.5, 38.0, -410.0);
  const Eigen::Isometry3d matrix = Eigen::Translation3d(isocenter) * moved;
  const CommandOutcome outcome = run_command({"check", ours_from("1.2.3.4", matrix.matrix(), "turned.dcm", "isoshift"),
                                              "--isocenter", "-12.5,38,-410", "--patient-position", "HFS", "--json"});
  const auto first = checked(outcome)["couch_shift_turned_first"];  // HFS: lateral x, longitudinal z, vertical -y
  EXPECT_NEAR(first["lateral_mm"].get<double>(), 3.0, 1e-3);
  EXPECT_NEAR(first["longitudinal_mm"].get<double>(), 5.0, 1e-3);
  EXPECT_NEAR(first["vertical_mm"].get<double>(), 4.0, 1e-3);
}

// docs/console-shifts.md, whose tables are made without any code of isoshift: the shift about each of its points, and
// by it anatomy that lay there comes back to where it was planned.
TEST_F(CheckCommandTest, TheShiftAboutAnyPointIsThatOfTheDocument) {
  std::ifstream page(ISOSHIFT_SOURCE_DIR "/docs/console-shifts.md");
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  const std::string number = " *([-+.0-9]+) *";
  const auto rows = [&](const std::string& pattern) {
    const std::regex row(pattern);
    return std::vector<std::smatch>(std::sregex_iterator(text.begin(), text.end(), row), std::sregex_iterator());
  };
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  const auto of_matrix = rows("\n\\| +\\|" + number + "\\|" + number + "\\|" + number + "\\|" + number + "\\|");
  ASSERT_EQ(of_matrix.size(), 3U);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) matrix(i, j) = std::stod(of_matrix[i][j + 1]);

  const Eigen::Vector3d isocenter(-12.5, 38.0, -410.0);
  const std::string object = ours_from("1.2.3.4", matrix, "of_page.dcm", "isoshift");
  const auto points = rows("\n\\| [^|]+\\| \\(" + number + "," + number + "," + number + "\\) \\|" + number + "\\|" +
                           number + "\\|" + number + "\\|");
  ASSERT_EQ(points.size(), 5U);
  for (const std::smatch& point : points) {
    const auto value = [&](int n) { return std::stod(point[n]); };
    const Eigen::Vector3d place(value(1), value(2), value(3)), shift(value(4), value(5), value(6));
    const CommandOutcome outcome =
        run_command({"check", object, "--isocenter", "-12.5,38,-410", "--patient-position", "HFS", "--about",
                     fmt::format("{},{},{}", place.x(), place.y(), place.z()), "--json"});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.err << outcome.out;
    const auto about = checked(outcome)["couch_shift_about"];
    EXPECT_NEAR(about["lateral_mm"].get<double>(), shift.x(), 0.06) << point[0];
    EXPECT_NEAR(about["longitudinal_mm"].get<double>(), shift.y(), 0.06) << point[0];
    EXPECT_NEAR(about["vertical_mm"].get<double>(), shift.z(), 0.06) << point[0];
    const Eigen::Vector3d lies =
        fixed_from_patient() * (Eigen::Affine3d(matrix).inverse() * place);  // in the room, from the isocenter
    EXPECT_THAT(Eigen::Vector3d(lies + shift), VectorNear(fixed_from_patient() * (place - isocenter), 0.06))
        << point[0];
  }
}

TEST_F(CheckCommandTest, AnglesThatNobodySaidAreToldToBe0) {
  const CommandOutcome neither = run_command({"check", ours(), "--plan", plan()});
  EXPECT_THAT(neither.out, HasSubstr("note   couch pitch and roll at imaging taken as 0: --couch-pitch DEG and "
                                     "--couch-roll DEG if the couch stood otherwise"));
  const CommandOutcome one = run_command({"check", ours(), "--plan", plan(), "--couch-pitch", "1", "--json"});
  const nlohmann::json registration = checked(one);
  EXPECT_THAT(registration["findings"].dump(), HasSubstr("couch roll at imaging taken as 0: --couch-roll DEG"));
  EXPECT_EQ(registration["couch_at_imaging"]["pitch_deg"], 1.0);
  EXPECT_FALSE(registration["couch_at_imaging"]["pitch_taken_as_0"].get<bool>());
  EXPECT_TRUE(registration["couch_at_imaging"]["roll_taken_as_0"].get<bool>());
}

// The frame of images may begin anywhere: without the isocenter in it nothing is told, with it the same shift.
TEST_F(CheckCommandTest, OneFromTheImagesFrameNeedsTheirIsocenter) {
  const SmallStudy with_frame;
  for (const int n : {0, 1})
    edit(with_frame.image(n), [](DicomItem d) {
      d.put(DCM_FrameOfReferenceUID, "1.2.3.4");
      d.put(DCM_IsocenterPosition, std::array{20.0, -50.0, 60.0});
    });
  ASSERT_EQ(register_study(with_frame).exit_status, 0);
  const std::string theirs = (with_frame.output() / "spatial_registration.dcm").string();
  const CommandOutcome without = run_command({"check", theirs, "--plan", with_frame.plan().string()});
  EXPECT_EQ(without.exit_status, 1);
  EXPECT_THAT(without.out, HasSubstr("its source frame 1.2.3.4 is that of the images it lists"));
  EXPECT_THAT(without.out, Not(HasSubstr("a couch shift of")));

  const CommandOutcome with =
      run_command({"check", theirs, "--plan", with_frame.plan().string(), "--source-isocenter", "20,-50,60", "--json"});
  EXPECT_EQ(with.exit_status, 0) << with.out << with.err;
  std::ifstream file(with_frame.output() / "result.json");
  expect_same_shift(checked(with), nlohmann::json::parse(file));
}

TEST_F(CheckCommandTest, OneOfAnotherProgramNeedsItsIsocenterWithoutImagesToo) {
  const CommandOutcome without = run_command({"check", foreign(), "--plan", plan(), "--json"});
  EXPECT_EQ(without.exit_status, 1);
  EXPECT_FALSE(checked(without)["passes"].get<bool>());
  EXPECT_TRUE(checked(without)["couch_shift"].is_null());
  EXPECT_TRUE(checked(without)["source_isocenter_mm"].is_null());
  EXPECT_THAT(checked(without)["findings"].dump(),
              HasSubstr("the couch shift is not known: its source frame 1.2.3.4 is one of another program, which may "
                        "begin anywhere. Say where the machine's isocenter lies in that frame: --source-isocenter"));

  const CommandOutcome with =
      run_command({"check", ours(), foreign(), "--plan", plan(), "--source-isocenter", "9,-5,6.9", "--json"});
  EXPECT_EQ(with.exit_status, 0) << with.out << with.err;
  expect_same_shift(checked(with, 0), checked(with, 1));
  EXPECT_EQ(checked(with, 0)["source_isocenter_mm"], (nlohmann::json{0.0, 0.0, 0.0}));
  EXPECT_EQ(checked(with, 1)["source_isocenter_mm"], (nlohmann::json{9.0, -5.0, 6.9}));
  EXPECT_THAT(checked(with, 1)["findings"].dump(), HasSubstr("lies at (9.000, -5.000, 6.900) mm of its source frame"));
  EXPECT_NEAR(nlohmann::json::parse(with.out)["difference"]["translation_mm"].get<double>(), 0.0, 1e-6);
}

// The object itself is right: only what was asked about it cannot be told.
TEST_F(CheckCommandTest, OneOfAnotherProgramPassesOnItsOwn) {
  const CommandOutcome outcome = run_command({"check", foreign()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("note   its source frame 1.2.3.4 is one of another program"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("the machine's isocenter at (")));
  EXPECT_THAT(run_command({"check", foreign(), "--source-isocenter", "9,-5,6.9"}).out,
              HasSubstr("has    the machine's isocenter at ("));
}

TEST_F(CheckCommandTest, AnIsocenterThatContradictsWhatIsKnownIsRefused) {
  const CommandOutcome of_ours = run_command({"check", ours(), "--source-isocenter", "1,2,3"});
  EXPECT_EQ(of_ours.exit_status, 2);
  EXPECT_THAT(of_ours.err, HasSubstr("--source-isocenter 1,2,3: " + ours() + ": isoshift wrote it"));
  const std::string theirs = from_room(Eigen::Matrix3d::Identity(), {1, 2, 3}, Eigen::Matrix3d::Identity());
  const CommandOutcome of_theirs = run_command({"check", theirs, "--source-isocenter", "1,2,3"});
  EXPECT_EQ(of_theirs.exit_status, 2);
  EXPECT_THAT(of_theirs.err, HasSubstr("IEC 61217 Fixed"));
  EXPECT_EQ(run_command({"check", ours(), "--source-isocenter", "0,0,0"}).exit_status, 0);  // as is known
}

TEST_F(CheckCommandTest, ThePlanOfAnotherPatientIsRefused) {
  const std::string other = copy_of(plan(), "other.dcm", [](DicomItem d) {
    d.put(DCM_PatientID, "SOMEONE ELSE");
    d.put(DCM_PatientName, "Other^Person");
  });
  const CommandOutcome outcome = run_command({"check", ours(), "--plan", other});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("error  the couch shift is not known: " + other +
                                     ": PatientID (0010,0020) differs from that of " + ours() +
                                     ": the inputs are of different patients"));
  EXPECT_THAT(outcome.out, HasSubstr("PatientName (0010,0010) differs"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("Other^Person")));
  EXPECT_THAT(outcome.out, Not(HasSubstr("a couch shift of")));
}

TEST_F(CheckCommandTest, ThePlanOfAnotherFrameIsRefusedAndOneWithoutIsNoted) {
  const std::string registered = read_rt_plan(plan()).frame_of_reference_uid.value();
  const std::string elsewhere =
      copy_of(plan(), "elsewhere.dcm", [](DicomItem d) { d.put(DCM_FrameOfReferenceUID, "1.2.3"); });
  const CommandOutcome outcome = run_command({"check", ours(), "--plan", elsewhere});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, HasSubstr(elsewhere + ": FrameOfReferenceUID (0020,0052) is 1.2.3, that of " + ours() +
                                     ", the registered frame, is " + registered));
  EXPECT_THAT(outcome.out, Not(HasSubstr("a couch shift of")));

  const std::string silent = copy_of(plan(), "silent.dcm", [](DicomItem d) {
    d.erase(DCM_FrameOfReferenceUID);
    d.put(DCM_RTPlanGeometry, "PATIENT");
  });
  const CommandOutcome noted = run_command({"check", ours(), "--plan", silent});
  EXPECT_EQ(noted.exit_status, 0) << noted.out;
  EXPECT_THAT(noted.out, HasSubstr("note   " + silent + ": FrameOfReferenceUID (0020,0052) is missing"));
  EXPECT_THAT(noted.out, HasSubstr("a couch shift of"));
}

TEST_F(CheckCommandTest, TheSameTwiceDoesNotDiffer) {
  const CommandOutcome outcome = run_command({"check", ours(), ours()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("difference: 0.000 mm at the isocenter, 0.000 deg"));
}

TEST_F(CheckCommandTest, TwoThatCannotBeComparedAreAnError) {
  const std::string of_other_ct = copy_of(ours(), "other_ct.dcm", [](DicomItem d) {
    d.put(DCM_FrameOfReferenceUID, "1.2.3");
    d.items(DCM_RegistrationSequence)[0].put(DCM_FrameOfReferenceUID, "1.2.3");
  });
  const CommandOutcome cts = run_command({"check", ours(), of_other_ct});
  EXPECT_EQ(cts.exit_status, 1);
  EXPECT_THAT(cts.out, HasSubstr("they register different frames (FrameOfReferenceUID (0020,0052)): " + ours() +
                                 " registers " + read_rt_plan(plan()).frame_of_reference_uid.value() + ", " +
                                 of_other_ct + " registers 1.2.3. Compare registrations of one planning CT only"));
  const CommandOutcome as_json = run_command({"check", ours(), of_other_ct, "--json"});
  EXPECT_EQ(as_json.exit_status, 1);
  const auto difference = nlohmann::json::parse(as_json.out)["difference"];
  EXPECT_TRUE(difference["translation_mm"].is_null());
  EXPECT_THAT(difference["reason"].get<std::string>(), HasSubstr("they register different frames"));

  const std::string of_other_patient =
      copy_of(ours(), "other_patient.dcm", [](DicomItem d) { d.put(DCM_PatientID, "SOMEONE ELSE"); });
  const CommandOutcome patients = run_command({"check", ours(), of_other_patient});
  EXPECT_EQ(patients.exit_status, 1);
  EXPECT_THAT(patients.out, HasSubstr("Compare registrations of one patient only"));

  const CommandOutcome origins = run_command({"check", ours(), foreign()});
  EXPECT_EQ(origins.exit_status, 1);
  EXPECT_THAT(origins.out, HasSubstr("difference: not known\n  error  " + foreign() + ": its source frame 1.2.3.4"));

  const std::string without_matrix = copy_of(ours(), "without.dcm", [](DicomItem d) {
    d.items(DCM_RegistrationSequence)[1].erase(DCM_MatrixRegistrationSequence);
  });
  const CommandOutcome matrices = run_command({"check", ours(), without_matrix});
  EXPECT_EQ(matrices.exit_status, 1);
  EXPECT_THAT(matrices.out, HasSubstr(without_matrix + ": holds no rigid matrix from one frame to another"));
}

TEST_F(CheckCommandTest, WithoutAPatientIdTheNameStillTellsPatientsApart) {
  const std::string nameless = copy_of(ours(), "no_id.dcm", [](DicomItem d) { d.put(DCM_PatientID, ""); });
  const CommandOutcome same = run_command({"check", ours(), nameless});
  EXPECT_EQ(same.exit_status, 0) << same.out;
  EXPECT_THAT(same.out, HasSubstr("note   a PatientID (0010,0020) is empty"));
  const std::string other = copy_of(nameless, "other.dcm", [](DicomItem d) { d.put(DCM_PatientName, "Other^Person"); });
  const CommandOutcome outcome = run_command({"check", ours(), other});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("PatientName (0010,0010) differs"));
  EXPECT_THAT(outcome.out, HasSubstr("difference: not known"));
}

TEST_F(CheckCommandTest, WhatContradictsThePlanIsRefused) {
  const CommandOutcome isocenter = run_command({"check", ours(), "--plan", plan(), "--isocenter", "1,2,3"});
  EXPECT_EQ(isocenter.exit_status, 2);
  EXPECT_THAT(isocenter.err, HasSubstr("--isocenter (1.000, 2.000, 3.000) contradicts the plan"));
  const CommandOutcome position = run_command({"check", ours(), "--plan", plan(), "--patient-position", "FFS"});
  EXPECT_EQ(position.exit_status, 2);
  EXPECT_THAT(position.err, HasSubstr("--patient-position FFS contradicts the plan, which says HFS"));
  EXPECT_EQ(run_command({"check", ours(), "--plan", plan(), "--patient-position", "HFS"}).exit_status, 0);
}

TEST_F(CheckCommandTest, OfAPlanWithTwoIsocentersOneIsNamed) {
  const std::string two = copy_of(plan(), "two.dcm", [](DicomItem d) {
    DicomItem beam = d.append_item(DCM_BeamSequence);
    beam.put(DCM_BeamNumber, 9.0);
    beam.append_item(DCM_ControlPointSequence).put(DCM_IsocenterPosition, "1\\2\\3");
  });
  EXPECT_THAT(run_command({"check", ours(), "--plan", two}).err, HasSubstr("beams have different isocenters"));
  const std::string isocenter = fmt::format("{},{},{}", isocenter_.x(), isocenter_.y(), isocenter_.z());
  const CommandOutcome named = run_command({"check", ours(), "--plan", two, "--isocenter", isocenter});
  EXPECT_EQ(named.exit_status, 0) << named.err;
  EXPECT_EQ(named.out, run_command({"check", ours(), "--plan", plan()}).out);
}

TEST_F(CheckCommandTest, APlanThatLiesNowhereGivesNoShift) {
  const std::string nowhere =
      copy_of(plan(), "nowhere.dcm", [](DicomItem d) { d.erase(DCM_FrameOfReferenceUID); });  // TREATMENT_DEVICE
  const CommandOutcome outcome = run_command({"check", ours(), "--plan", nowhere});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("nothing says where its isocenter lies in the registered frame"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("a couch shift of")));
}

// Two frames that coincide: the machine's isocenter lies where it lies in the source frame.
TEST_F(CheckCommandTest, AnIdentityIsAMatrix) {
  const std::string file = ours_from("1.2.3.4", Eigen::Matrix4d::Identity(), "identity.dcm", "Somebody");
  const std::string isocenter = fmt::format("{},{},{}", isocenter_.x(), isocenter_.y(), isocenter_.z());
  const CommandOutcome outcome =
      run_command({"check", file, "--plan", plan(), "--source-isocenter", isocenter, "--json"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
  expect_shift(checked(outcome), {0, 0, 0, 0, 0, 0}, 1e-9);
}

TEST_F(CheckCommandTest, AnObjectThatMeansSeveralThingsGivesNoNumber) {
  const std::string ct = read_rt_plan(plan()).frame_of_reference_uid.value();
  const std::string itself = ours_from(ct, our_matrix(), "itself.dcm", "Somebody");
  const std::string twice = copy_of(foreign(), "twice.dcm", [](DicomItem d) {
    d.items(DCM_RegistrationSequence)[1].append_item(DCM_MatrixRegistrationSequence);
  });
  const std::string room = copy_of(foreign(), "room.dcm", [](DicomItem d) {
    d.put(DCM_FrameOfReferenceUID, "1.2.840.10008.1.4.3.1");
    d.items(DCM_RegistrationSequence)[0].put(DCM_FrameOfReferenceUID, "1.2.840.10008.1.4.3.1");
  });
  for (const auto& [file, why] : {std::pair(itself, "moves the registered frame against itself"),
                                  std::pair(twice, "MatrixRegistrationSequence (0070,0309) has 2 items, expected 1"),
                                  std::pair(room, "registers the room (IEC 61217 Fixed)")}) {
    const CommandOutcome outcome = run_command({"check", file, "--source-isocenter", "9,-5,6.9"});
    EXPECT_EQ(outcome.exit_status, 1) << file;
    EXPECT_THAT(outcome.out, HasSubstr(why));
    EXPECT_THAT(outcome.out, Not(HasSubstr("the origin at")));
    EXPECT_THAT(outcome.out, Not(HasSubstr("the machine's isocenter at (")));
  }
}

TEST_F(CheckCommandTest, AnInvertedOneIsFoundNearTheOriginOfTheCtToo) {
  Eigen::Matrix4d matrix = our_matrix();
  matrix.topRightCorner<3, 1>() = Eigen::Vector3d(22.0, -20.0, 18.0);
  const std::string file = ours_from("1.2.3.4", matrix.inverse(), "near.dcm", "isoshift");
  const CommandOutcome outcome = run_command({"check", file, "--isocenter", "20,-19,17", "--patient-position", "HFS"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("the matrix looks inverted"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("a couch shift of")));
}

TEST_F(CheckCommandTest, APatientWhoWouldBeTurnedFarIsAnError) {
  const std::string theirs = from_room(Eigen::Matrix3d::Identity(), {1, 2, 3}, Eigen::Matrix3d::Identity());
  const CommandOutcome outcome = run_command({"check", theirs, "--plan", plan(), "--couch-angle", "90"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("the patient would be turned by 90 degrees"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("a couch shift of")));
}

TEST_F(CheckCommandTest, AnotherIsocenterOfTheSameFrameIsNoted) {
  const auto checked_at = [&](double off_mm) {
    const std::string isocenter = fmt::format("{},{},{}", isocenter_.x(), isocenter_.y(), isocenter_.z() + off_mm);
    return run_command({"check", ours(), "--isocenter", isocenter, "--patient-position", "HFS"});
  };
  EXPECT_THAT(checked_at(60.0).out, HasSubstr("mm from the planned isocenter: compare that of the plan"));
  const CommandOutcome far = checked_at(150.0);
  EXPECT_EQ(far.exit_status, 1);
  EXPECT_THAT(far.out, HasSubstr("it is of another isocenter or another frame"));
}

TEST_F(CheckCommandTest, AnObjectThatWasNotAcceptedSaysSo) {
  const std::string review = testdata("registrations/review/spatial_registration.dcm").string();
  EXPECT_THAT(run_command({"check", review}).out, HasSubstr("\"NOT ACCEPTED: REVIEW\": a person has to decide"));
}

TEST_F(CheckCommandTest, OneIsocenterIsNotTakenForTwoFrames) {
  const std::string first = foreign();
  const std::string second = ours_from("1.2.3.5", our_matrix(), "second.dcm", "Plastimatch");
  const CommandOutcome outcome = run_command({"check", first, second, "--source-isocenter", "9,-5,6.9"});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("start from different frames"));
}

TEST_F(CheckCommandTest, AnglesThatNoCouchHasAreRefused) {
  const CommandOutcome outcome = run_command({"check", ours(), "--plan", plan(), "--couch-angle", "1000"});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--couch-angle: 1000, expected degrees from -360 to 360"));
  EXPECT_EQ(run_command({"check", ours(), "--plan", plan(), "--couch-roll", "50"}).exit_status, 2);
}

TEST_F(CheckCommandTest, TheShiftNeedsIsocenterAndPosition) {
  const CommandOutcome outcome = run_command({"check", ours(), "--isocenter", "1,2,3"});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--patient-position"));
  EXPECT_EQ(run_command({"check", plan()}).exit_status, 1);
  const CommandOutcome endless = run_command({"check", ours(), "--isocenter", "nan,2,3", "--patient-position", "HFS"});
  EXPECT_EQ(endless.exit_status, 2);
  EXPECT_THAT(endless.err, HasSubstr("--isocenter: nan is not a finite number"));
  EXPECT_EQ(run_command({"check", ours(), "--source-isocenter", "nan,2,3"}).exit_status, 2);
  EXPECT_EQ(run_command({"check", ours(), "--plan", plan(), "--couch-roll", "inf"}).exit_status, 2);
  const CommandOutcome unused = run_command({"check", ours(), "--couch-pitch", "1"});
  EXPECT_EQ(unused.exit_status, 2);
  EXPECT_THAT(unused.err, HasSubstr("--couch-pitch is used only for a couch shift: add --plan FILE"));
}

}  // namespace
}  // namespace isoshift::check_command_test
