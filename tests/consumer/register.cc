// Registers an exported study: consumer STUDY_FOLDER OBJECT.dcm
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>

#include "drr/renderer_pyramid.h"
#include "io/objects/spatial_registration.h"
#include "io/study/study.h"
#include "registration/preprocess/preprocess.h"
#include "registration/presets.h"
#include "setup/couch_shift.h"

int main(int argc, char** argv) try {
  using namespace isoshift;
  if (argc != 3) return 2;
  Notes notes;
  StudyRequest request;
  request.parts.study = argv[1];
  const Study study = load_study(request, notes, {});
  std::vector<Beam> beams;
  for (const XrayImage& xray : study.xrays) beams.push_back(xray.view.beam);
  const RendererPyramid renderers(RendererKind::kCpu, study.ct->hu, AttenuationModel(), beams);
  const RegistrationResult found =
      register_views(renderers, prepared(study.xrays), study.planned_room_from_patient, preset("setup"));
  const Eigen::Isometry3d error =
      setup_error_from_poses(study.planned_room_from_patient, found.actual_room_from_patient);
  std::cout << fmt::format("{} ({:.2f})\n", to_string(found.verdict()), fmt::join(error.translation(), ", "));
  if (found.verdict() != Verdict::kAccepted) return 3;
  write_spatial_registration(study, found.actual_room_from_patient, {}, argv[2], notes);
} catch (const std::exception& error) {
  std::cerr << "error: " << error.what() << "\n";
  return 1;
}
