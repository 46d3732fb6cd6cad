// Registers an exported study: consumer STUDY_FOLDER OBJECT.dcm
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iostream>

#include "drr/renderer_pyramid.h"
#include "io/objects/spatial_registration.h"
#include "io/study/study.h"
#include "registration/preprocess/preprocess.h"
#include "registration/presets.h"
#include "registration/target/target_registration.h"
#include "registration/target/target_volume.h"
#include "setup/couch_shift.h"

int main(int argc, char** argv) try {
  using namespace isoshift;
  if (argc != 3) return 2;
  Notes notes;
  StudyRequest request;
  request.parts.study = argv[1];
  const Study study = load_study(request, notes, {});
  const Volume<float>& ct = study.ct->hu;
  TargetProblem problem;
  problem.patient = {.ct_hu = {study.ct, &ct}, .room_from_patient = study.planned_room_from_patient};
  problem.options = preset("setup");
  problem.target = isocenter_surroundings();
  BodyStore bodies;
  problem.surrogate = surrogate_near(problem.patient, problem.target, bodies);
  for (const std::string& doubt : study.doubts) {
    Finding& finding = problem.findings.emplace_back();
    finding.check = Check::kFiles;
    finding.words = doubt;
  }
  const RendererPyramid renderers(problem.rendering.kind, ct, problem.rendering.model, problem.rendering.beams);
  const TargetRegistration registration(problem, renderers, ct, bodies);
  const RegistrationResult found = registration.from(study.planned_room_from_patient, prepared(study.xrays));
  const Eigen::Isometry3d error =
      setup_error_from_poses(study.planned_room_from_patient, found.actual_room_from_patient);
  std::cout << fmt::format("{} ({:.4f})\n", to_string(found.verdict()), fmt::join(error.translation(), ", "));
  for (const std::string& reason : found.reasons()) std::cout << reason << "\n";
  if (found.verdict() != Verdict::kAccepted) return 3;
  write_spatial_registration(study, found.actual_room_from_patient, {}, argv[2], notes);
} catch (const std::exception& error) {
  std::cerr << "error: " << error.what() << "\n";
  return 1;
}
