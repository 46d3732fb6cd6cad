#include "io/config/machine_profile.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_folder.h"
#include "geometry/rotation.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "workflow/register/truth.h"

namespace isoshift::machine_profile_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class MachineProfileTest : public testing::Test {
 protected:
  MachineProfile profile(const nlohmann::json& images) {
    write(images);
    return read_machine_profile(path_);
  }

  void write(const nlohmann::json& images) {
    std::filesystem::remove(path_);
    write_text(path_, nlohmann::json{{"machine_profile", 1}, {"name", "Linac 3"}, {"images", images}}.dump());
  }

  std::string error_of(const nlohmann::json& images) {
    try {
      profile(images);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  RtImage image(int n = 0) { return read_rt_images(study_.image(n), notes_).front(); }

  SmallStudy study_;
  std::filesystem::path path_ = study_.path() / ".." / "machine.json";
  Notes notes_;
};

TEST_F(MachineProfileTest, SuppliesWhatFilesLack) {
  for (const int n : {0, 1})
    edit(study_.image(n), [](DicomItem d) {
      for (const DcmTagKey& tag :
           {DCM_RadiationMachineSAD, DCM_RTImageSID, DCM_RTImagePosition, DCM_PatientSupportAngle,
            DCM_PixelIntensityRelationship, DCM_PixelIntensityRelationshipSign})
        d.erase(tag);
    });
  const RtImage lacking = image();
  EXPECT_EQ(missing_attributes(lacking).size(), 5U);
  const RtImage supplied = with_machine(lacking,
                                        profile({{{"sad_mm", 1000},
                                                  {"sid_mm", 1500},
                                                  {"assume_centered", true},
                                                  {"couch_angle_deg", 0},
                                                  {"couch_pitch_deg", 1.5},
                                                  {"couch_roll_deg", -0.5},
                                                  {"intensity", "LIN+"},
                                                  {"beam", "kv"}}}),
                                        {}, notes_);
  EXPECT_TRUE(missing_attributes(supplied).empty());
  EXPECT_EQ(supplied.table.pitch_deg, 1.5);
  EXPECT_EQ(supplied.table.roll_deg, -0.5);
  const SmallStudy whole;
  const RtImage expected = read_rt_images(whole.image(0), notes_).front();
  EXPECT_TRUE(xray_view(supplied, Beam::kKilovoltage, notes_)
                  .pixel_from_room.isApprox(xray_view(expected, Beam::kKilovoltage, notes_).pixel_from_room, 1e-12));
  EXPECT_THAT(
      notes_.overrides,
      testing::Contains(HasSubstr("RTImageSID (3002,0026): supplied by machine profile \"Linac 3\", as by --sid")));
}

TEST_F(MachineProfileTest, TheGantryAngleMayBeThatOfTheOtherArm) {
  const RtImage turned = with_machine(image(), profile({{{"gantry_angle_offset_deg", 90}}}), {}, notes_);
  EXPECT_EQ(turned.gantry_angle_deg, 90.0);
  EXPECT_THAT(notes_.overrides, ElementsAre(HasSubstr("GantryAngle (300A,011E) +90 degrees by machine profile")));
}

// PS3.3 C.8.8.2.3 and docs/dicom.md 2.6: spacing in the plane of the axis is SAD/SID of that on the receptor.
TEST_F(MachineProfileTest, SpacingMayCountAtTheAxis) {
  const RtImage expected = image();
  edit(study_.image(0), [](DicomItem d) {
    for (const DcmTagKey& tag : {DCM_ImagePlanePixelSpacing, DCM_RTImagePosition}) {
      std::vector<double> values = d.numbers(tag);
      for (double& value : values) value *= 1000.0 / 1500.0;
      d.put(tag, values);
    }
  });
  const RtImage found = with_machine(image(), profile({{{"spacing_plane", "SAD"}}}), {}, notes_);
  EXPECT_TRUE(found.pixel_spacing_mm->isApprox(*expected.pixel_spacing_mm, 1e-9));
  EXPECT_TRUE(found.position_mm->isApprox(*expected.position_mm, 1e-9));
}

// What isoshift qa geometry --json says of an imager: here a panel that lies 1.5 mm off along x and is rolled by 0.2
// degrees.
nlohmann::json imager_errors() {
  nlohmann::json errors;
  for (const ImagerParameterInfo& info : imager_parameters())
    errors[std::string(info.key)] = {{"value", nullptr}, {"sigma", 0.1}, {"is_determined", false}};
  errors["shift_x_mm"]["value"] = 1.5;
  errors["roll_deg"]["value"] = 0.2;
  return errors;
}

TEST_F(MachineProfileTest, KnownErrorsOfAnImagerCorrectNothing) {
  const RtImage found = with_machine(image(), profile({{{"imager_errors", imager_errors()}}}), {}, notes_);
  EXPECT_TRUE(xray_view(found, Beam::kKilovoltage, notes_)
                  .pixel_from_room.isApprox(xray_view(image(), Beam::kKilovoltage, notes_).pixel_from_room));
  EXPECT_NEAR(found.imager.value().left()[0], std::hypot(1.5, 0.1), 1e-12);
  EXPECT_TRUE(notes_.overrides.empty());
}

// By a signature alone: one of the file as it is, by the key that is named.
TEST_F(MachineProfileTest, OnlyASignedProfileCorrects) {
  const nlohmann::json images = {{{"imager_errors", imager_errors()}, {"correct_imager", true}}};
  EXPECT_THAT(error_of(images), HasSubstr("must be signed"));
  const auto make_key = [&](const std::string& name) {
    const std::filesystem::path file = path_.parent_path() / name;
    replace_text(file, new_signing_key());
    std::filesystem::permissions(file, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    const std::string command =
        fmt::format("openssl pkey -in '{}' -pubout -out '{}.pub' 2>/dev/null", file.string(), file.string());
    EXPECT_EQ(std::system(command.c_str()), 0);
    return file;
  };
  const std::filesystem::path key = make_key("release.key"), other = make_key("other.key");
  const VerifyingKey pub(key.string() + ".pub"), other_pub(other.string() + ".pub");
  const auto error_with = [&](const VerifyingKey& with) -> std::string {
    try {
      read_machine_profile(path_, with);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(error_with(pub), HasSubstr("machine.json.sig: cannot be read"));
  const std::string command =
      fmt::format("openssl pkeyutl -sign -rawin -inkey '{0}' -in '{1}' -out '{1}.sig'", key.string(), path_.string());
  ASSERT_EQ(std::system(command.c_str()), 0);
  EXPECT_THAT(error_with(other_pub), HasSubstr("is not the signature"));

  const RtImage found = with_machine(image(), read_machine_profile(path_, pub), {}, notes_);
  EXPECT_THAT(notes_.overrides, ElementsAre(HasSubstr("receptor corrected (shift x +1.50 mm, roll (about the central "
                                                      "ray) +0.200 deg) by machine profile")));
  const XrayView view = xray_view(found, Beam::kKilovoltage, notes_),
                 as_filed = xray_view(image(), Beam::kKilovoltage, notes_);
  const ImagerModel model(as_filed, rad_from_deg(image().gantry_angle_deg.value()), image().sid_mm.value());
  EXPECT_THAT(view.project(Eigen::Vector3d(10, 20, 30)).value(),
              VectorNear(model.pixel_of({10, 20, 30}, found.imager->values), 1e-9));
  EXPECT_NEAR(found.imager->left()[0], 0.1, 1e-12);

  replace_text(path_, [&] {
    std::ifstream file(path_);
    return std::string{std::istreambuf_iterator<char>(file), {}} + " ";
  }());
  EXPECT_THAT(error_with(pub), HasSubstr("was changed after it was signed"));
}

// The SID may come from the command line: what rules make of it must not depend on where it comes from.
TEST_F(MachineProfileTest, RulesCountWithTheSidOfTheCommandLine) {
  RtImage lacking = image();
  lacking.sid_mm.reset();
  const MachineProfile rules = profile({{{"spacing_plane", "SAD"}}});
  const RtImage found = with_machine(lacking, rules, {.sid_mm = 1600.0}, notes_);
  EXPECT_TRUE(found.pixel_spacing_mm->isApprox(1.6 * *lacking.pixel_spacing_mm, 1e-9));
}

TEST_F(MachineProfileTest, TheFirstRuleThatFitsCounts) {
  const MachineProfile rules = profile({{{"where", {{"RadiationMachineName", "OTHER"}}}, {"sad_mm", 900}},
                                        {{"where", {{"RTImageLabel", "KV_G090"}}}, {"sad_mm", 1100}},
                                        {{"sad_mm", 1200}}});
  EXPECT_EQ(with_machine(image(0), rules, {}, notes_).sad_mm, 1200.0);
  EXPECT_EQ(with_machine(image(1), rules, {}, notes_).sad_mm, 1100.0);
}

TEST_F(MachineProfileTest, AnImageThatNoRuleFitsIsRefused) {
  const MachineProfile rules = profile({{{"where", {{"StationName", "ROOM 2"}}}}});
  EXPECT_THROW(
      {
        try {
          with_machine(image(), rules, {}, notes_);
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("no rule of machine profile \"Linac 3\" fits this image"));
          EXPECT_THAT(error.what(), HasSubstr("RadiationMachineName=\"PHANTOM\""));
          throw;
        }
      },
      Error);
}

TEST_F(MachineProfileTest, MistakesAreNamed) {
  EXPECT_THAT(error_of({{{"sidd_mm", 1500}}}), HasSubstr("images[0]: there is no key sidd_mm; the keys are where"));
  EXPECT_THAT(error_of({{{"sid_mm", "1500"}}}), HasSubstr("images[0]: sid_mm is \"1500\", expected a number"));
  EXPECT_THAT(error_of({{{"sid_mm", -3}}}), HasSubstr("images[0]: sid_mm is -3, expected 1 to 5000"));
  EXPECT_THAT(error_of({{{"intensity", "DARK"}}}), HasSubstr("intensity is \"DARK\", expected LIN+, LIN-, LOG+ or"));
  EXPECT_THAT(error_of({{{"where", {{"PatientName", "X"}}}}}), HasSubstr("images are not told apart by PatientName"));
  EXPECT_THAT(error_of({{{"pixel_from_room", {{1, 0, 0}}}, {"columns", 1}, {"rows", 1}}}),
              HasSubstr("expected three rows of four finite numbers"));
  EXPECT_THAT(error_of({{{"correct_imager", true}}}), HasSubstr("imager_errors is missing"));
  nlohmann::json errors = imager_errors();
  errors.erase("distance_mm");
  EXPECT_THAT(error_of({{{"imager_errors", errors}}}), HasSubstr("imager_errors: distance_mm is missing"));
  errors = imager_errors();
  errors["roll_deg"] = {{"value", 0.1}};
  EXPECT_THAT(error_of({{{"imager_errors", errors}}}), HasSubstr("imager_errors: roll_deg: sigma is missing"));
  EXPECT_THAT(error_of({{{"pixel_from_room", {{1, 0, 0}}}, {"columns", 96.7}, {"rows", 1}}}), HasSubstr("expected"));
  EXPECT_THAT(error_of(nlohmann::json::array()), HasSubstr("images is empty, expected a list of rules"));
}

TEST_F(MachineProfileTest, AKeySaidTwiceIsNamed) {
  std::ofstream(path_) << R"({"machine_profile": 1, "name": "A", "images": [{"sid_mm": 1500, "sid_mm": 1000}]})";
  EXPECT_THROW(
      {
        try {
          read_machine_profile(path_);
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("says sid_mm twice"));
          throw;
        }
      },
      Error);
}

// The examples of docs/machine-profile.md are profiles, and the matrix in them is that of the camera they tell of.
TEST_F(MachineProfileTest, TheExamplesInTheDocumentationAreProfiles) {
  std::ifstream page(std::string(ISOSHIFT_SOURCE_DIR) + "/docs/machine-profile.md");
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  std::vector<MachineProfile> examples;
  for (std::size_t begin = text.find("```json"); begin != std::string::npos; begin = text.find("```json", begin + 7)) {
    std::ofstream(path_, std::ios::trunc) << text.substr(begin + 7, text.find("```", begin + 7) - begin - 7);
    examples.push_back(read_machine_profile(path_));
  }
  ASSERT_EQ(examples.size(), 3U);
  EXPECT_DOUBLE_EQ(examples[1].rules.front().imager.value().values[0], 0.42);
  const MachineProfile::Rule& rule = examples[2].rules.front();
  const XrayView view = xray_view_from_matrix(rule.pixel_from_room.value(), rule.switches.sid_mm.value(), rule.columns,
                                              rule.rows, Beam::kKilovoltage);
  EXPECT_THAT(view.source_room_mm, VectorNear(Eigen::Vector3d(1344, 0, -1792), 0.05));
  EXPECT_THAT(view.project(Eigen::Vector3d::Zero()).value(), VectorNear(Eigen::Vector2d(511.5, 511.5), 1e-6));
  EXPECT_NEAR((view.ray(1, 0).pixel_room_mm - view.ray(0, 0).pixel_room_mm).norm(), 0.4, 1e-4);
}

// The phantom's images as DX objects, which say nothing of geometry, and their matrices in a profile.
class OtherXrayTest : public MachineProfileTest {
 protected:
  OtherXrayTest() {
    nlohmann::json rules = nlohmann::json::array();
    for (const int n : {0, 1}) {
      const RtImage original = image(n);
      const XrayView view = xray_view(original, Beam::kKilovoltage, notes_);
      nlohmann::json matrix = nlohmann::json::array();
      for (int row = 0; row < 3; ++row) {
        matrix.push_back(nlohmann::json::array());
        for (int column = 0; column < 4; ++column)
          matrix.back().push_back(-2.5 * view.pixel_from_room(row, column));  // its scale and sign mean nothing
      }
      rules.push_back({{"where", {{"DetectorID", fmt::format("DETECTOR {}", n)}}},
                       {"pixel_from_room", matrix},
                       {"columns", view.columns},
                       {"rows", view.rows},
                       {"sid_mm", 1500},
                       {"couch_angle_deg", 0}});
      edit(study_.image(n), [&](DicomItem d) {
        for (const DcmTagKey& tag :
             {DCM_RTImageLabel, DCM_RTImagePlane, DCM_XRayImageReceptorTranslation, DCM_XRayImageReceptorAngle,
              DCM_RTImageOrientation, DCM_ImagePlanePixelSpacing, DCM_RTImagePosition, DCM_RadiationMachineSAD,
              DCM_RTImageSID, DCM_GantryAngle, DCM_PatientSupportAngle, DCM_ExposureSequence, DCM_ReportedValuesOrigin,
              DCM_ReferencedRTPlanSequence})
          d.erase(tag);
        d.put(DCM_SOPClassUID, UID_DigitalXRayImageStorageForProcessing);
        d.put(DCM_Modality, "DX");
        d.put(DCM_DetectorID, fmt::format("DETECTOR {}", n));
      });
    }
    write(rules);
  }
};

TEST_F(OtherXrayTest, TheirMatricesMakeTheSameViews) {
  const SmallStudy rt_images;
  const MachineProfile profile = read_machine_profile(path_);
  for (const int n : {0, 1}) {
    const RtImage expected = read_rt_images(rt_images.image(n), notes_).front();
    const XrayView by_attributes = xray_view(expected, Beam::kKilovoltage, notes_);
    const XrayView by_matrix = xray_view(with_machine(image(n), profile, {}, notes_), Beam::kKilovoltage, notes_);
    EXPECT_TRUE(by_matrix.pixel_from_room.isApprox(by_attributes.pixel_from_room, 1e-9));
    EXPECT_THAT(by_matrix.source_room_mm, VectorNear(by_attributes.source_room_mm, 1e-6));
    EXPECT_THAT(by_matrix.ray(10, 80).pixel_room_mm, VectorNear(by_attributes.ray(10, 80).pixel_room_mm, 1e-6));
  }
}

TEST_F(OtherXrayTest, AGantryAngleForThemIsRefused) {
  const RtImage supplied = with_machine(image(0), read_machine_profile(path_), {}, notes_);
  EXPECT_THROW(with_switches(supplied, {.gantry_angle_deg = {{supplied.label, 45.0}}}, notes_), UsageError);
}

TEST_F(OtherXrayTest, AreRegisteredAsRtImagesAre) {
  const CommandOutcome outcome = register_study(study_, {"--machine", path_.string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  const SmallStudy rt_images;
  register_study(rt_images);
  EXPECT_THAT(read_setup_error(study_.output() / "result.json"),
              PoseNear(read_setup_error(rt_images.output() / "result.json"), 0.02, 0.02));
  EXPECT_THAT(outcome.out, HasSubstr("Machine profile          \"Linac 3\"; SHA-256"));
  const CommandOutcome checked =
      run_shell(fmt::format("/usr/bin/python3 -m jsonschema -i {} {}/docs/result.schema.json",
                            (study_.output() / "result.json").string(), ISOSHIFT_SOURCE_DIR));
  EXPECT_EQ(checked.exit_status, 0) << checked.out;
}

// What tells two imagers apart may stand in any of these attributes.
TEST_F(OtherXrayTest, AreToldApartByWhatTheirFilesSayOfDetectorProtocolOrView) {
  for (const auto& [keyword, tag] : {std::pair("DetectorDescription", DCM_DetectorDescription),
                                     {"ProtocolName", DCM_ProtocolName},
                                     {"ViewPosition", DCM_ViewPosition}}) {
    const DcmTagKey& told_by = tag;
    edit(study_.image(1), [&](DicomItem d) { d.put(told_by, "OBLIQUE 2"); });
    const MachineProfile rules =
        profile({{{"where", {{keyword, "OBLIQUE 2"}}}, {"couch_pitch_deg", 2}}, {{"couch_pitch_deg", 1}}});
    EXPECT_EQ(with_machine(image(0), rules, {}, notes_).table.pitch_deg, 1.0) << keyword;
    EXPECT_EQ(with_machine(image(1), rules, {}, notes_).table.pitch_deg, 2.0) << keyword;
  }
}

TEST_F(OtherXrayTest, AnIsocenterOutsideTheImageIsToldInPixels) {
  std::ifstream file(path_);
  nlohmann::json images = nlohmann::json::parse(file)["images"];
  nlohmann::json& matrix = images[0]["pixel_from_room"];
  for (int column = 0; column < 4; ++column)
    matrix[0][column] = matrix[0][column].get<double>() + 200.0 * matrix[2][column].get<double>();
  write(images);
  const CommandOutcome outcome = register_study(study_, {"--machine", path_.string()});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("the projection matrix puts the isocenter at column 247.5, row 47.5, outside the "
                                     "image of 96 x 96 pixels"));
}

TEST_F(OtherXrayTest, WithoutAProfileTheErrorNamesTheSwitch) {
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("For X-rays of other classes their geometry is needed: --machine FILE"));
}

TEST_F(OtherXrayTest, AMatrixThatCannotBeIsRefused) {
  const auto error_of_matrix = [&](const Eigen::Matrix<double, 3, 4>& matrix) -> std::string {
    try {
      xray_view_from_matrix(matrix, 1500.0, 96, 96, Beam::kKilovoltage);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  Eigen::Matrix<double, 3, 4> matrix = Eigen::Matrix<double, 3, 4>::Zero();
  EXPECT_THAT(error_of_matrix(matrix), HasSubstr("has no source"));
  matrix << 1500, 0, 0, 0, 0, 1500, 0, 0, 0, 0, 1, 2000;  // the isocenter lies 2 m from the source
  EXPECT_THAT(error_of_matrix(matrix), HasSubstr("put the isocenter not between source and receptor"));
}

}  // namespace
}  // namespace isoshift::machine_profile_test
