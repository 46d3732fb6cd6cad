// Which structures are bones by their names.

#include "workflow/register/study_bodies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/small_study.h"

namespace isoshift::study_bodies_test {
namespace {

bool is_bone(const std::string& name) {
  Eigen::Affine3d lattice(Eigen::Translation3d(-20.0, -20.0, -20.0));
  lattice.scale(4.0);
  CtSeries ct;
  ct.hu = Volume<float>(Eigen::Vector3i(11, 11, 11), lattice);
  Structure structure{.number = 1, .name = name};
  for (const double z : {-4.0, 0.0, 4.0})
    structure.contours.push_back({.points_patient_mm = rectangle({0.0, 0.0, z}, 20.0, 20.0)});
  return drawn_bones({.structures = {structure}}, ct).size() == 1;
}

TEST(DrawnBones, AreKnownByTheNamesOfPeopleTg263AndTotalSegmentator) {
  for (const char* name : {"L3",
                           "T12",
                           "C1",
                           "vertebra_L3",
                           "Vertebra 4",
                           "vertebrae_L3",
                           "vertebrae_T12",
                           "vertebrae_C1",
                           "VB_L3",
                           "VB_T11",
                           "Vert L3",
                           "Mandible",
                           "Bone_Mandible",
                           "Femur_L",
                           "femur_left",
                           "Femur_Head_R",
                           "clavicula_left",
                           "Clavicle_L",
                           "scapula_right",
                           "humerus_left",
                           "hip_right",
                           "rib_left_7",
                           "Rib07_L",
                           "Rib_7",
                           "sternum",
                           "sacrum",
                           "skull",
                           "Bone_Ilium_L",
                           "Bone_Pelvic",
                           "BoneMarrow_Pelvic",
                           "Pelvic Bones",
                           "Pelvis",
                           "Femoral Head and Neck R"})
    EXPECT_TRUE(is_bone(name)) << name;
  for (const char* name : {"PTV", "Spine", "SpinalCord", "VB_L", "VBs", "Ribs", "heart", "lung_upper_lobe_left", "T13",
                           "Femur_L_PRV05", "costal_cartilages", "iliopsoas_left", "Hippocampus_L"})
    EXPECT_FALSE(is_bone(name)) << name;
}

// Each would replace the bones that were found there, and move as one with soft tissue.
TEST(DrawnBones, AreNotWhatIsNamedAfterThem) {
  for (const char* name :
       {"Pelvic LN",     "LN_Pelvic",    "Pelvis_LN",         "pelvic nodes",         "Nodes pelvis",
        "Pelvic",        "Pelvis PRV",   "PTV_Pelvis",        "Pelvis PTV",           "Pelvic_Floor",
        "Bowel pelvis",  "Hip muscle L", "Femur artery",      "Femoral_Artery_L",     "Musc_Iliopsoas",
        "A_Iliac_Ext_R", "V_Iliac_L",    "iliac_artery_left", "gluteus_maximus_left", "Sacral plexus",
        "SacralPlexus",  "Spinal Cord",  "SpinalCord_PRV05",  "Humerus_L_PRV03",      "Femur_L+5mm",
        "Scapula_soft",  "Skull_skin",   "L3 nerve root",     "Radius 5 mm",          "Hip joint"})
    EXPECT_FALSE(is_bone(name)) << name;
}

}  // namespace
}  // namespace isoshift::study_bodies_test
