// A stereoscopic system of two imagers in floor and ceiling: from the example of docs/stereoscopic.md to a
// registration.

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/text_file.h"
#include "cli/console.h"
#include "geometry/image.h"
#include "geometry/xray_view.h"
#include "io/config/machine_profile.h"
#include "io/dicom/decode.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"
#include "workflow/register/truth.h"

namespace isoshift::stereoscopic_system_test {
namespace {

using testing::HasSubstr;
using testing::Not;
using Matrix34 = Eigen::Matrix<double, 3, 4>;

constexpr int kPixels = 512;  // of the example, along each edge
constexpr double kPixelMm = 0.4;

std::string page() { return text_of_file(std::string(ISOSHIFT_SOURCE_DIR) + "/docs/stereoscopic.md"); }
std::string profile() { return testdata("config/machine/stereo.json").string(); }

// The numbers of every row of the page's table whose header begins like this, without those of its first cell.
std::vector<std::vector<double>> numbers_below(const std::string& header) {
  const std::regex number("-?[0-9]+(\\.[0-9]+)?");
  std::vector<std::vector<double>> rows;
  std::istringstream lines(page());
  bool is_in_table = false;
  for (std::string line; std::getline(lines, line);) {
    const bool is_header = line.starts_with(header);
    is_in_table = is_header || (is_in_table && line.starts_with("|"));
    if (!is_in_table || is_header || line.starts_with("| ---")) continue;
    const std::string cells = line.substr(line.find('|', 1));
    rows.emplace_back();
    for (auto found = std::sregex_iterator(cells.begin(), cells.end(), number); found != std::sregex_iterator();
         ++found)
      rows.back().push_back(std::stod(found->str()));
  }
  return rows;
}

// Three rows of four numbers.
Matrix34 matrix_from(const std::vector<std::vector<double>>& rows, std::size_t first) {
  Matrix34 matrix;
  for (int row = 0; row < 3; ++row)
    matrix.row(row) = Eigen::RowVector4d(rows.at(first + static_cast<std::size_t>(row)).data());
  return matrix;
}

Eigen::Vector2d pixel_of(const Matrix34& matrix, const Eigen::Vector3d& point_room_mm) {
  return (matrix * point_room_mm.homogeneous()).hnormalized();
}

// Where the page says that source and receptor stand, in the room.
struct SurveyedImager {
  explicit SurveyedImager(const std::vector<double>& numbers)
      : source_mm(numbers.data()),
        center_mm(numbers.data() + 3),
        along_row(numbers.data() + 6),
        along_column(numbers.data() + 9) {}

  Eigen::Vector3d pixel_mm(double column, double row) const {
    constexpr double kMiddle = 0.5 * (kPixels - 1);
    return center_mm + kPixelMm * ((column - kMiddle) * along_row + (row - kMiddle) * along_column);
  }

  Eigen::Vector3d source_mm, center_mm, along_row, along_column;
};

std::vector<SurveyedImager> surveyed_imagers() {
  std::vector<SurveyedImager> imagers;
  for (const std::vector<double>& numbers : numbers_below("| imager | source")) {
    EXPECT_EQ(numbers.size(), 12U);
    imagers.emplace_back(numbers);
  }
  return imagers;
}

std::vector<XrayView> views_of_profile() {
  std::vector<XrayView> views;
  for (const MachineProfile::Rule& rule : read_machine_profile(profile()).rules)
    views.push_back(xray_view_from_matrix(rule.pixel_from_room.value(), rule.switches.sid_mm.value(), rule.columns,
                                          rule.rows, Beam::kKilovoltage));
  return views;
}

TEST(StereoscopicPage, ShowsTheProfileOfTestdata) {
  const std::string text = page();
  const std::size_t begin = text.find("```json") + 7;
  const auto shown = nlohmann::json::parse(text.substr(begin, text.find("```", begin) - begin));
  EXPECT_EQ(shown, nlohmann::json::parse(text_of_file(profile())));

  const auto rows = numbers_below("| imager | row of the matrix");
  const MachineProfile read = read_machine_profile(profile());
  ASSERT_EQ(rows.size(), 6U);
  ASSERT_EQ(read.rules.size(), 2U);
  for (std::size_t n = 0; n < 2; ++n) EXPECT_TRUE(read.rules[n].pixel_from_room.value() == matrix_from(rows, 3 * n));
}

// The matrices have so many digits that source and pixels lie within a few hundredths of a millimeter.
TEST(StereoscopicPage, TheProgramPutsSourceAndPixelsWhereTheSurveyDoes) {
  const std::vector<SurveyedImager> imagers = surveyed_imagers();
  const std::vector<XrayView> views = views_of_profile();
  ASSERT_EQ(imagers.size(), 2U);
  for (std::size_t n = 0; n < 2; ++n) {
    EXPECT_THAT(views.at(n).source_room_mm, VectorNear(imagers[n].source_mm, 0.02));
    for (const auto& [column, row] : {std::pair(0.0, 0.0), {511.0, 0.0}, {0.0, 511.0}, {255.5, 255.5}})
      EXPECT_THAT(views[n].ray(column, row).pixel_room_mm, VectorNear(imagers[n].pixel_mm(column, row), 0.03));
  }
}

TEST(StereoscopicPage, TheProgramProjectsThePointsOfThePage) {
  const std::vector<XrayView> views = views_of_profile();
  const auto points = numbers_below("| point of the room");
  ASSERT_EQ(points.size(), 5U);
  for (const std::vector<double>& numbers : points) {
    ASSERT_EQ(numbers.size(), 7U);
    const Eigen::Vector3d point_mm(numbers.data());
    for (std::size_t n = 0; n < 2; ++n)
      EXPECT_THAT(views.at(n).project(point_mm).value(), VectorNear(Eigen::Vector2d(&numbers[3 + 2 * n]), 0.01))
          << "imager " << n + 1 << ", (" << point_mm.transpose() << ")";
  }
}

// The steps of the page, with numbers: its matrix of another vendor becomes that of the profile.
TEST(StereoscopicPage, AVendorsMatrixBecomesThatOfTheProfile) {
  const auto rows = numbers_below("| vendor's matrix");
  ASSERT_EQ(rows.size(), 3U);
  Eigen::Matrix3d pixel_from_vendor;
  pixel_from_vendor << 1, 0, -0.5, 0, -1, 511.5, 0, 0, 1;
  Eigen::Matrix4d vendor_from_room;
  vendor_from_room << 1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1;
  const Matrix34 matrix = pixel_from_vendor * matrix_from(rows, 0) * vendor_from_room;
  const XrayView expected = views_of_profile().front();
  for (const Eigen::Vector3d& point_mm :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(50, 0, 0), Eigen::Vector3d(-30, 40, 20)})
    EXPECT_THAT(pixel_of(matrix, point_mm), VectorNear(expected.project(point_mm).value(), 0.01));
}

// A head that lies off plan, in X-rays of the example's system as DX objects. The X-rays are made from the survey: no
// matrix, no view and no renderer has a part in them. Like real ones the files name the linac's gantry angle, which is
// no angle of these imagers, and know nothing of the table.
class StereoscopicSystemCommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    PhantomOptions options = small_phantom();
    options.voxel_mm = 2.0;
    options.image_pixels = 64;  // of the RT Images, which are replaced
    study_ = new SmallStudy(options);
    const std::vector<SurveyedImager> imagers = surveyed_imagers();
    ASSERT_EQ(imagers.size(), 2U);
    for (const int n : {0, 1}) {
      const std::vector<std::uint16_t> stored = xray_of(options, imagers[static_cast<std::size_t>(n)]);
      edit(study_->image(n), [&](DicomItem d) {
        for (const DcmTagKey& tag :
             {DCM_RTImageLabel, DCM_RTImagePlane, DCM_XRayImageReceptorTranslation, DCM_XRayImageReceptorAngle,
              DCM_RTImageOrientation, DCM_ImagePlanePixelSpacing, DCM_RTImagePosition, DCM_RadiationMachineSAD,
              DCM_RTImageSID, DCM_PatientSupportAngle, DCM_TableTopPitchAngle, DCM_TableTopRollAngle,
              DCM_ExposureSequence, DCM_ReportedValuesOrigin, DCM_ReferencedRTPlanSequence})
          d.erase(tag);
        d.put(DCM_SOPClassUID, UID_DigitalXRayImageStorageForProcessing);
        d.put(DCM_Modality, "DX");
        d.put(DCM_GantryAngle, 0.0);
        d.put(DCM_DetectorID, fmt::format("PANEL {}", n + 1));
        put_pixel_format(d, {.columns = kPixels, .rows = kPixels});
        d.put_pixels(stored);
      });
    }
  }
  static void TearDownTestSuite() { delete study_; }

  // Stored values proportional to the intensity behind the phantom, of photons of 60 keV.
  static std::vector<std::uint16_t> xray_of(const PhantomOptions& options, const SurveyedImager& imager) {
    constexpr double kWaterPerMm = 0.02059, kBonePerMm = 0.06044, kOpen = 50000.0;
    const std::vector<Shape> shapes = phantom_of(options).in_xrays;
    const Eigen::Vector3d source_mm = options.placement.patient_from_fixed(imager.source_mm);
    Image<std::uint16_t> stored(kPixels, kPixels);
    parallel_for(0, kPixels, [&](int row) {
      for (int column = 0; column < kPixels; ++column) {
        const Eigen::Vector3d pixel_mm = options.placement.patient_from_fixed(imager.pixel_mm(column, row));
        double line_integral = 0.0;
        for (const Shape& shape : shapes)
          line_integral +=
              shape.chord_mm(source_mm, pixel_mm) * (kWaterPerMm * shape.added.water + kBonePerMm * shape.added.bone);
        stored.at(column, row) = static_cast<std::uint16_t>(std::lround(kOpen * std::exp(-line_integral)));
      }
    });
    return stored.pixels;
  }

  static CommandOutcome registered(const std::string& machine = profile()) {
    return register_study(*study_, {"--machine", machine, "--overwrite"});
  }
  // With the page's profile, its rules changed.
  static CommandOutcome registered_with(const std::function<void(nlohmann::json&)>& change) {
    nlohmann::json changed = nlohmann::json::parse(text_of_file(profile()));
    change(changed["images"]);
    const std::filesystem::path path = study_->path().parent_path() / "changed.json";
    std::ofstream(path, std::ios::trunc) << changed.dump();
    return registered(path.string());
  }
  static nlohmann::json result() { return result_of(*study_); }

  static SmallStudy* study_;
};

SmallStudy* StereoscopicSystemCommandTest::study_ = nullptr;

TEST_F(StereoscopicSystemCommandTest, IsRegisteredByTheProfileOfThePage) {
  const CommandOutcome outcome = registered();
  EXPECT_EQ(outcome.exit_status, kExitAccepted) << outcome.out << outcome.err;
  EXPECT_THAT(read_setup_error(study_->output() / "result.json"),
              PoseNear(read_setup_error(study_->truth()), 0.3, 0.3));
  const nlohmann::json views = result()["views"];
  for (const nlohmann::json& view : views) EXPECT_TRUE(view["gantry_deg"].is_null());
  EXPECT_THAT(outcome.out, Not(HasSubstr("gantry 0.0 deg")));
}

// The labels of DX objects are the names of their files: only the matrix tells that a view comes twice.
TEST_F(StereoscopicSystemCommandTest, AViewTakenTwiceNeedsAReview) {
  const std::filesystem::path again = study_->path() / "RTIMAGE" / "AGAIN.dcm";
  std::filesystem::copy_file(study_->image(1), again);
  edit(again, [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "1.2.3.4");
    d.put(DCM_AcquisitionTime, "101530");
  });
  const CommandOutcome outcome = registered();
  std::filesystem::remove(again);
  EXPECT_EQ(outcome.exit_status, kExitReview) << outcome.out << outcome.err;
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("KV_G090 and AGAIN show the same view"));
}

// What the page says that wrong matrices look like.
TEST_F(StereoscopicSystemCommandTest, ExchangedImagersAreRejected) {
  const CommandOutcome outcome =
      registered_with([](nlohmann::json& rules) { rules[0]["pixel_from_room"].swap(rules[1]["pixel_from_room"]); });
  EXPECT_EQ(outcome.exit_status, kExitRejected) << outcome.out << outcome.err;
}

TEST_F(StereoscopicSystemCommandTest, MirroredColumnsOfOneImagerAreNamed) {
  const CommandOutcome outcome = registered_with([](nlohmann::json& rules) {
    nlohmann::json& matrix = rules[1]["pixel_from_room"];
    for (std::size_t n = 0; n < 4; ++n)
      matrix[0][n] = (kPixels - 1) * matrix[2][n].get<double>() - matrix[0][n].get<double>();
  });
  EXPECT_EQ(outcome.exit_status, kExitReview) << outcome.out << outcome.err;
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("with KV_G090 mirrored the images match better"));
}

TEST_F(StereoscopicSystemCommandTest, AMatrixThatCountsTheRoomInCentimetersIsAnError) {
  const CommandOutcome outcome = registered_with([](nlohmann::json& rules) {
    for (nlohmann::json& row : rules[0]["pixel_from_room"])
      for (std::size_t n = 0; n < 3; ++n) row[n] = 0.1 * row[n].get<double>();
  });
  EXPECT_EQ(outcome.exit_status, kExitFailed);
  EXPECT_THAT(outcome.err, HasSubstr("put the isocenter not between source and receptor"));
}

TEST_F(StereoscopicSystemCommandTest, InspectShowsSourceReceptorAndIsocenter) {
  const CommandOutcome outcome = run_command({"inspect", study_->image(1).string(), "--machine", profile()});
  EXPECT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("by the profile's projection matrix"));
  EXPECT_THAT(outcome.out, HasSubstr("(-1213.35, 1213.35, -1439.84) mm"));
  EXPECT_THAT(outcome.out, HasSubstr("(245.49, 260.51) column, row"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("gantry angle")));
}

}  // namespace
}  // namespace isoshift::stereoscopic_system_test
