#include "io/dicom/rt_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/rotation.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"

namespace isoshift::rt_image_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class RtImageTest : public testing::Test {
 protected:
  RtImage changed(const std::function<void(DicomItem)>& change) {
    edit(study_.image(0), change);
    return read_rt_images(study_.image(0), notes_).front();
  }

  std::vector<std::string> missing_tags(const RtImage& image) {
    std::vector<std::string> tags;
    for (const MissingAttribute& missing : missing_attributes(image)) tags.push_back(described(missing.tag));
    return tags;
  }

  // The first pixel as intensity or line integral, for a stored value of 1000.
  float first_pixel(const std::function<void(DicomItem)>& change) {
    const RtImage image = changed([&](DicomItem d) {
      d.put_pixels(std::vector<std::uint16_t>(96 * 96, 1000));
      change(d);
    });
    return read_xray_image(DicomFile::read(image.path, DicomFile::Extent::kWhole), image,
                           xray_view(image, Beam::kKilovoltage, notes_))
        .values.at(0, 0);
  }

  std::string error_of_reading(const std::function<void(DicomItem)>& change) {
    try {
      changed(change);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::string error_of_geometry(const RtImage& image) {
    try {
      rt_image_findings(image);
      carm_geometry(image, notes_);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  SmallStudy study_;
  Notes notes_;
};

TEST_F(RtImageTest, ReadsTheGeometry) {
  const RtImage image = read_rt_images(study_.image(1), notes_).front();
  EXPECT_EQ(image.label, "KV_G090");
  EXPECT_TRUE(missing_attributes(image).empty());
  EXPECT_TRUE(rt_image_findings(image).empty());
  const XrayView view = make_xray_view(carm_geometry(image, notes_), Beam::kKilovoltage);
  EXPECT_THAT(view.source_room_mm, VectorNear(Eigen::Vector3d(1000, 0, 0), 1e-9));
  EXPECT_THAT(view.project(Eigen::Vector3d::Zero()).value(), VectorNear(Eigen::Vector2d(47.5, 47.5), 1e-9));
  EXPECT_EQ(notes_.warnings.size(), 0U);
}

TEST_F(RtImageTest, NamesAllThatIsMissingAtOnce) {
  const RtImage image = changed([](DicomItem d) {
    d.erase(DCM_RadiationMachineSAD);
    d.put(DCM_RTImageSID, "");
    d.put(DCM_RTImagePosition, "");
    d.erase(DCM_GantryAngle);
    d.erase(DCM_PatientSupportAngle);
    d.erase(DCM_PixelIntensityRelationshipSign);
  });
  EXPECT_THAT(missing_tags(image),
              ElementsAre("RTImagePosition (3002,0012)", "RadiationMachineSAD (3002,0022)", "RTImageSID (3002,0026)",
                          "GantryAngle (300A,011E)", "PatientSupportAngle (300A,0122)",
                          "PixelIntensityRelationshipSign (0028,1041)"));
}

TEST_F(RtImageTest, SwitchesSupplyWhatIsMissingAndAreNoted) {
  const RtImage image = changed([](DicomItem d) {
    for (const DcmTagKey& tag : {DCM_RadiationMachineSAD, DCM_RTImageSID, DCM_RTImagePosition, DCM_GantryAngle,
                                 DCM_PatientSupportAngle, DCM_PixelIntensityRelationship, DCM_PatientPosition})
      d.erase(tag);
  });
  RtImageSwitches switches;
  switches.gantry_angle_deg["KV_G000"] = 0;
  switches.couch_angle_deg = 5;
  switches.sad_mm = 1000;
  switches.sid_mm = 1500;
  switches.assume_centered = true;
  switches.intensity = pixel_intensity_from("LIN+");
  switches.patient_position = PatientPosition::kHfs;
  const RtImage supplied = with_switches(image, switches, notes_);
  EXPECT_TRUE(missing_attributes(supplied).empty());
  EXPECT_EQ(notes_.overrides.size(), 7U);
  EXPECT_EQ(notes_.overrides[0], "KV_G000: GantryAngle (300A,011E): supplied by --gantry-angle KV_G000=0");
  const XrayView view = make_xray_view(carm_geometry(supplied, notes_), Beam::kKilovoltage);
  EXPECT_THAT(view.project(Eigen::Vector3d::Zero()).value(), VectorNear(Eigen::Vector2d(47.5, 47.5), 1e-9));
}

TEST_F(RtImageTest, ASwitchReplacesAValueAndSaysSo) {
  RtImageSwitches switches;
  switches.sid_mm = 1400;
  const RtImage image = with_switches(read_rt_images(study_.image(0), notes_).front(), switches, notes_);
  EXPECT_EQ(image.sid_mm, 1400);
  EXPECT_THAT(notes_.overrides, ElementsAre("KV_G000: RTImageSID (3002,0026): replaced by --sid 1400"));
}

TEST_F(RtImageTest, TheExposuresAngleWinsOverTheTopLevels) {
  const RtImage image = changed([](DicomItem d) { d.items(DCM_ExposureSequence).front().put(DCM_GantryAngle, 12.5); });
  EXPECT_EQ(image.gantry_angle_deg, 12.5);
}

TEST_F(RtImageTest, AnExposureThatContradictsTheTopLevelIsToldOf) {
  const RtImage image = changed([](DicomItem d) {
    DicomItem exposure = d.items(DCM_ExposureSequence).front();
    d.put(DCM_TableTopPitchAngle, 0.0);
    exposure.put(DCM_TableTopPitchAngle, 2.0);
    exposure.put(DCM_GantryAngle, 359.95);
  });
  EXPECT_EQ(image.table.pitch_deg, 2.0);
  EXPECT_THAT(image.contradictions,
              ElementsAre(HasSubstr("TableTopPitchAngle (300A,0140) is 0, and 2 in its ExposureSequence (3002,0030)")));
}

TEST_F(RtImageTest, AnExposureOfAnotherFrameIsNotTaken) {
  edit(study_.image(0), [](DicomItem d) { d.items(DCM_ExposureSequence).front().put(DCM_ReferencedFrameNumber, "2"); });
  EXPECT_TRUE(read_rt_images(study_.image(0), notes_).empty());
  EXPECT_THAT(notes_.warnings, ElementsAre(HasSubstr("frame 1 was left aside")));
}

TEST_F(RtImageTest, AnglesAreModulo360) {
  const RtImage image = changed([](DicomItem d) {
    d.put(DCM_PatientSupportAngle, 359.998);
    d.put(DCM_TableTopPitchAngle, 359.998);
  });
  const TableAngles table = table_angles(std::span(&image, 1), notes_);
  EXPECT_NEAR(deg_from_rad(table.support_rad), -0.002, 1e-9);
  EXPECT_NEAR(deg_from_rad(table.pitch_rad), -0.002, 1e-4);
}

TEST_F(RtImageTest, AReadOutOfMoreThanATurnIsNoAngle) {
  for (const DcmTagKey& tag : {DCM_GantryAngle, DCM_PatientSupportAngle, DCM_XRayImageReceptorAngle,
                               DCM_TableTopPitchAngle, DCM_BeamLimitingDeviceAngle}) {
    EXPECT_THAT(error_of_reading([&](DicomItem d) { d.put(tag, 1e9); }),
                HasSubstr(described(tag) + " is 1000000000 degrees, expected -360 to 360"));
    edit(study_.image(0), [&](DicomItem d) { d.put(tag, -360.0); });
    EXPECT_NO_THROW(read_rt_images(study_.image(0), notes_));
  }
}

TEST_F(RtImageTest, AnotherModalityIsRefused) {
  EXPECT_THAT(error_of_reading([](DicomItem d) { d.put(DCM_Modality, "DX"); }),
              HasSubstr("Modality (0008,0060) is DX, expected RTIMAGE"));
}

TEST_F(RtImageTest, NumbersOfBeamsAreWhole) {
  for (const char* number : {"-1e308", "1.5"})
    EXPECT_THAT(error_of_reading([&](DicomItem d) { d.put(DCM_ReferencedBeamNumber, number); }),
                HasSubstr("ReferencedBeamNumber (300C,0006) is "));
}

TEST_F(RtImageTest, OfTwoValuesNoneIsChosen) {
  EXPECT_THAT(error_of_reading([](DicomItem d) { d.put(DCM_GantryAngle, "0\\90"); }),
              HasSubstr("GantryAngle (300A,011E) has 2 values, expected 1"));
}

TEST_F(RtImageTest, IntensityFollowsRelationshipAndSign) {
  // Stored value 1000 of at most 65535 (docs/conventions.md, "Pixel values").
  EXPECT_EQ(first_pixel([](DicomItem) {}), 1000);
  EXPECT_EQ(first_pixel([](DicomItem d) { d.put(DCM_PixelIntensityRelationshipSign, -1); }), 64535);
  EXPECT_EQ(first_pixel([](DicomItem d) { d.put(DCM_PixelIntensityRelationship, "LOG"); }), 1000);
  EXPECT_EQ(first_pixel([](DicomItem d) { d.put(DCM_PixelIntensityRelationshipSign, 1); }), -1000);
}

TEST_F(RtImageTest, ANegativeSlopeTurnsTheRescaledValue) {
  // Varian's integrated images: stored inverted, calibrated units proportional to the dose.
  const auto inverted = [](DicomItem d) {
    d.put(DCM_RescaleSlope, -0.5);
    d.put(DCM_RescaleIntercept, 600.0);
    d.put(DCM_PixelIntensityRelationshipSign, -1);
  };
  EXPECT_EQ(first_pixel(inverted), 100);
}

// Stored values fall with the rescaled ones, and may be above or below that of no intensity.
TEST_F(RtImageTest, NegativePixelsWhoseZeroNobodyKnowsAreRefused) {
  const auto negative = [](DicomItem d) {
    d.put(DCM_PixelRepresentation, 1);
    d.put(DCM_RescaleSlope, -1.0);
    d.put_pixels(std::vector<std::uint16_t>(96 * 96, 65000));
  };
  EXPECT_THAT([&] { first_pixel(negative); },
              testing::ThrowsMessage<Error>(HasSubstr("which of them stands for no intensity is not known")));
}

TEST_F(RtImageTest, PaddingIsNoPixel) {
  const RtImage image = changed([](DicomItem d) {
    std::vector<std::uint16_t> pixels(96 * 96, 1000);
    pixels[5] = 65535;
    pixels[6] = 400;
    d.put_pixels(pixels);
    d.put(DCM_PixelPaddingValue, 65535);
  });
  const auto read = [&] {
    return read_xray_image(DicomFile::read(image.path, DicomFile::Extent::kWhole), image,
                           xray_view(image, Beam::kKilovoltage, notes_));
  };
  const XrayImage xray = read();
  EXPECT_EQ(xray.values.at(5, 0), 400.0F);
  ASSERT_TRUE(xray.padding);
  EXPECT_EQ(std::ranges::count(xray.padding->pixels, 1), 1);
  EXPECT_EQ(xray.padding->at(5, 0), 1);
  edit(study_.image(0), [](DicomItem d) {
    d.put(DCM_PixelPaddingValue, 0);
    d.put_pixels(std::vector<std::uint16_t>(96 * 96, 0));
  });
  EXPECT_THAT(read, testing::ThrowsMessage<Error>(HasSubstr("all pixels are padding (PixelPaddingValue (0028,0120))")));
}

TEST_F(RtImageTest, WhyATimeIsUnknownIsSaid) {
  const auto why = [&](const DcmTagKey& tag, const char* value) {
    return why_time_is_unknown(changed([&](DicomItem d) {
      d.put(DCM_AcquisitionDate, "20260301");
      d.put(DCM_AcquisitionTime, "101500");
      d.put(tag, value);
    }));
  };
  EXPECT_EQ(why(DCM_AcquisitionTime, "10 15"), "AcquisitionTime (0008,0032) is \"10 15\", expected HHMMSS");
  EXPECT_EQ(why(DCM_AcquisitionDate, ""), "AcquisitionDate (0008,0022) is missing");
  EXPECT_EQ(why(DCM_AcquisitionDate, "20260231"), "AcquisitionDate (0008,0022) is \"20260231\", expected YYYYMMDD");
}

TEST_F(RtImageTest, BeamQualityComesFromKvpElseFromTheImageType) {
  RtImage image = read_rt_images(study_.image(0), notes_).front();
  EXPECT_EQ(beam_of(image, notes_), Beam::kKilovoltage);
  image.kvp = 6000;
  EXPECT_EQ(beam_of(image, notes_), Beam::kMegavoltage);
  EXPECT_TRUE(notes_.warnings.empty());
  image.kvp.reset();
  image.image_type = "PORTAL";
  EXPECT_EQ(beam_of(image, notes_), Beam::kMegavoltage);
  EXPECT_THAT(notes_.warnings, ElementsAre(HasSubstr("taken as MV from image type PORTAL")));
  EXPECT_FALSE(changed([](DicomItem d) {
                 d.put(DCM_KVP, 0.0);
                 d.items(DCM_ExposureSequence).front().put(DCM_KVP, 0.0);
               }).kvp);
}

TEST_F(RtImageTest, ADrrIsOneInAnyValueAndEitherCase) {
  for (const auto& [written, type] :
       {std::pair(R"(DERIVED\SECONDARY\PORTAL\drr)", "DRR"), std::pair(R"(ORIGINAL\PRIMARY\PORTAL\ACQUIRED)", "PORTAL"),
        std::pair(R"(DERIVED\DRR)", "")})
    EXPECT_EQ(changed([&](DicomItem d) { d.put(DCM_ImageType, written); }).image_type, type) << written;
}

TEST_F(RtImageTest, PlannedAnglesAndDrrsAreFindings) {
  RtImage image = read_rt_images(study_.image(0), notes_).front();
  image.image_type = "DRR";
  image.reported_values_origin = "OPERATOR";
  const auto findings = rt_image_findings(image);
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].key, "drr");
  EXPECT_EQ(findings[1].key, "planned-geometry");
}

TEST_F(RtImageTest, RefusesWhatItCannotPlace) {
  const RtImage good = read_rt_images(study_.image(0), notes_).front();
  RtImage image = good;
  image.receptor_translation_mm = Eigen::Vector3d(0, 0, -480);
  EXPECT_THAT(error_of_geometry(image), HasSubstr("has z = -480 mm, expected SAD - SID = -500 mm"));
  image = good;
  image.gantry_pitch_angle_deg = 3.0;
  EXPECT_THAT(error_of_geometry(image), HasSubstr("a tilted gantry is not supported"));
  image = good;
  image.patient_position = "SITTING";
  EXPECT_THAT(error_of_geometry(image), HasSubstr("is SITTING; expected HFS"));
  image = good;
  image.sid_mm = 100.0;
  EXPECT_THAT(error_of_geometry(image), HasSubstr("RTImageSID (3002,0026) is 100, expected between 500 and 5000"));
  image = good;
  image.orientation = {1, 0, 0, 0.5, -1, 0};
  EXPECT_THAT(error_of_geometry(image), HasSubstr("is not a pair of perpendicular unit vectors"));
  image = good;
  image.image_type = "FLUENCE";
  EXPECT_THAT(error_of_geometry(image), HasSubstr("says \"FLUENCE\""));
}

TEST_F(RtImageTest, AReceptorTranslationMovesTheCentralPixel) {
  const RtImage image = changed([](DicomItem d) { d.put(DCM_XRayImageReceptorTranslation, "20\\-30\\-500"); });
  const XrayView view = make_xray_view(carm_geometry(image, notes_), Beam::kKilovoltage);
  const double pixel_mm = 410.0 / 96;
  // The panel moved by (+20, -30) mm: the isocenter's shadow moves the other way on it, rows counting downward.
  EXPECT_THAT(view.project(Eigen::Vector3d::Zero()).value(),
              VectorNear(Eigen::Vector2d(47.5 - 20 / pixel_mm, 47.5 - 30 / pixel_mm), 1e-6));
}

// What a tilted plane means: XrayView.HandlesTheNonNormalPlaneOfDicomMd24.
TEST_F(RtImageTest, ATiltedPlaneIsReadWithItsOrientation) {
  const std::vector<double> tilted = {std::cos(rad_from_deg(5)), 0, std::sin(rad_from_deg(5)), 0, -1, 0};
  const RtImage image = changed([&](DicomItem d) {
    d.put(DCM_RTImagePlane, "NON_NORMAL");
    d.put(DCM_RTImageOrientation, tilted);
  });
  const CarmGeometry geometry = carm_geometry(image, notes_);
  EXPECT_FALSE(geometry.normal_plane);
  EXPECT_THAT(geometry.row_direction, VectorNear(Eigen::Vector3d(tilted.data()), 1e-12));
  // The plane is turned about the receptor's origin, which the isocenter's ray meets.
  EXPECT_THAT(make_xray_view(geometry, Beam::kKilovoltage).project(Eigen::Vector3d::Zero()).value(),
              VectorNear(Eigen::Vector2d(47.5, 47.5), 1e-6));
  RtImage without = image;
  without.orientation.reset();
  EXPECT_THAT(error_of_geometry(without), HasSubstr("RTImageOrientation (3002,0010) is missing"));
  RtImage normal = image;
  normal.plane = "NORMAL";
  EXPECT_THAT(error_of_geometry(normal),
              HasSubstr("in the receptor's plane, as RTImagePlane (3002,000C) NORMAL needs"));
}

TEST_F(RtImageTest, EveryFrameHasTheAnglesOfItsExposure) {
  join_images(study_);
  const std::vector<RtImage> frames = read_rt_images(study_.image(0), notes_);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].label, "KV_G000#1");
  EXPECT_EQ(frames[1].label, "KV_G000#2");
  EXPECT_EQ(frames[0].gantry_angle_deg, 0.0);
  EXPECT_EQ(frames[1].gantry_angle_deg, 90.0);
  EXPECT_EQ(frames[1].kvp, 120.0);
  const SmallStudy single;
  const RtImage second = read_rt_images(single.image(1), notes_).front();
  EXPECT_EQ(read_xray_image(DicomFile::read(frames[1].path, DicomFile::Extent::kWhole), frames[1],
                            xray_view(frames[1], Beam::kKilovoltage, notes_))
                .values.pixels,
            read_xray_image(DicomFile::read(second.path, DicomFile::Extent::kWhole), second,
                            xray_view(second, Beam::kKilovoltage, notes_))
                .values.pixels);
}

// Which exposure counts for an image must not be guessed.
TEST_F(RtImageTest, ExposuresOfOneImageMustAgree) {
  const auto with_exposures = [&](std::initializer_list<double> gantry_angles_deg) {
    edit(study_.image(0), [&](DicomItem d) {
      d.erase(DCM_ExposureSequence);
      d.append_item(DCM_ExposureSequence).put(DCM_KVP, 120.0);
      for (const double angle_deg : gantry_angles_deg)
        d.append_item(DCM_ExposureSequence).put(DCM_GantryAngle, angle_deg);
    });
    return read_rt_images(study_.image(0), notes_).front();
  };
  const RtImage agreeing = with_exposures({30.0, 30.005});
  EXPECT_EQ(agreeing.gantry_angle_deg, 30.0);
  EXPECT_EQ(agreeing.kvp, 120.0);
  EXPECT_THROW(
      {
        try {
          with_exposures({100.0, 90.0});
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("GantryAngle (300A,011E) is 100 in one exposure and 90 in another"));
          throw;
        }
      },
      Error);
}

TEST_F(RtImageTest, ExposuresThatNameNoFrameAreNotTakenForAll) {
  join_images(study_);
  edit(study_.image(0), [](DicomItem d) {
    for (DicomItem& exposure : d.items(DCM_ExposureSequence)) exposure.erase(DCM_ReferencedFrameNumber);
  });
  EXPECT_THROW(read_rt_images(study_.image(0), notes_), Error);
}

TEST_F(RtImageTest, TableAnglesAreThoseOfTheFirstViewThatSays) {
  std::vector<RtImage> images = {read_rt_images(study_.image(0), notes_).front(),
                                 read_rt_images(study_.image(1), notes_).front()};
  images[0].table.pitch_deg.reset();
  images[1].table.pitch_deg = 3.0;
  images[1].table.roll_deg = images[0].table.roll_deg = std::nullopt;
  EXPECT_NEAR(table_angles(images, notes_).pitch_rad, rad_from_deg(3.0), 1e-12);
  EXPECT_THAT(notes_.warnings,
              testing::Contains(HasSubstr("TableTopRollAngle (300A,0144) is missing in all X-rays, taken as 0; "
                                          "--couch-roll DEG supplies it")));
}

// The last column of docs/dicom.md 2.4: gantry 30, couch 10, pitch 2, roll -1.5.
TEST_F(RtImageTest, CouchPitchAndRollBySwitchesAreThoseOfDicomMd24) {
  RtImage image = changed([](DicomItem d) {
    d.put(DCM_GantryAngle, 30.0);
    d.erase(DCM_TableTopPitchAngle);
    d.put(DCM_RTImagePosition, std::array{-204.6, 204.6});
    d.put(DCM_ImagePlanePixelSpacing, std::array{0.4, 0.4});
  });
  image.columns = image.rows = 1024;
  RtImageSwitches switches;
  switches.couch_angle_deg = 10;
  switches.couch_pitch_deg = 2;
  switches.couch_roll_deg = -1.5;
  image = with_switches(image, switches, notes_);
  EXPECT_THAT(notes_.overrides, ElementsAre("KV_G000: PatientSupportAngle (300A,0122): replaced by --couch-angle 10",
                                            "KV_G000: TableTopPitchAngle (300A,0140): supplied by --couch-pitch 2",
                                            "KV_G000: TableTopRollAngle (300A,0144): replaced by --couch-roll -1.5"));
  const TableAngles table = table_angles(std::span(&image, 1), notes_);
  EXPECT_TRUE(notes_.warnings.empty()) << notes_.warnings.front();
  const Eigen::Isometry3d room_from_patient =
      planned_room_from_patient(PatientPosition::kHfs, table, Eigen::Vector3d(10, -150, -420));
  const XrayView view = make_xray_view(carm_geometry(image, notes_), Beam::kKilovoltage);
  EXPECT_THAT(view.project(room_from_patient * Eigen::Vector3d(40, -180, -370)).value(),
              VectorNear(Eigen::Vector2d(516.583896, 303.965280), 1e-5));
}

TEST_F(RtImageTest, AFrameThatNoExposureNamesIsLeftOut) {
  join_images(study_);
  edit(study_.image(0), [](DicomItem d) { d.items(DCM_ExposureSequence).front().put(DCM_ReferencedFrameNumber, "3"); });
  const std::vector<RtImage> frames = read_rt_images(study_.image(0), notes_);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames.front().frame, 1);
  EXPECT_THAT(notes_.warnings,
              ElementsAre(HasSubstr("frame 1 was left aside: no item of ExposureSequence (3002,0030)")));
}

TEST_F(RtImageTest, AFrameWithoutItsIncrementHasNoTimeOfItsOwn) {
  join_images(study_);
  const std::vector<RtImage> untold = read_rt_images(study_.image(0), notes_);
  EXPECT_TRUE(untold[0].has_own_time);
  EXPECT_FALSE(untold[1].has_own_time);
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_FrameTime, 2500.0); });
  const std::vector<RtImage> told = read_rt_images(study_.image(0), notes_);
  ASSERT_TRUE(told[1].has_own_time);
  for (const double no_step_ms : {0.0, -100.0}) {
    edit(study_.image(0), [&](DicomItem d) { d.put(DCM_FrameTime, no_step_ms); });
    EXPECT_FALSE(read_rt_images(study_.image(0), notes_)[1].has_own_time) << no_step_ms;
  }
  EXPECT_NEAR(*acquisition_seconds(told[1]) - *acquisition_seconds(told[0]), 2.5, 1e-6);
}

TEST_F(RtImageTest, DateAndTimeInOneAttributeAreRead) {
  const auto of = [&](const char* text) {
    return changed([&](DicomItem d) {
      for (const DcmTagKey& tag : {DCM_AcquisitionTime, DCM_ContentTime}) d.erase(tag);
      d.put(DCM_AcquisitionDate, "20200101");
      d.put(DCM_AcquisitionDateTime, text);
    });
  };
  EXPECT_EQ(acquired(of("20260301101530.25+0100")), "2026-03-01 10:15:30");
  EXPECT_NEAR(*acquisition_seconds(of("20260301101530.25")) - *acquisition_seconds(of("20260301101500")), 30.25, 1e-6);
  EXPECT_FALSE(acquisition_seconds(of("20260301")));
  EXPECT_FALSE(acquisition_seconds(of("2026030110")));  // to the hour
  // The night in which the clock is set back.
  EXPECT_NEAR(*acquisition_seconds(of("20261025021030+0100")) - *acquisition_seconds(of("20261025021000+0200")), 3630.0,
              1e-6);
}

TEST_F(RtImageTest, FramesWithoutExposuresShareTheGeometryOfTheFile) {
  join_images(study_);
  edit(study_.image(0), [](DicomItem d) {
    d.erase(DCM_ExposureSequence);
    d.put(DCM_GantryAngle, 30.0);
  });
  const std::vector<RtImage> frames = read_rt_images(study_.image(0), notes_);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].gantry_angle_deg, 30.0);
  EXPECT_EQ(frames[1].gantry_angle_deg, 30.0);
}

}  // namespace
}  // namespace isoshift::rt_image_test
