#include "workflow/track/ct_phases.h"

#include <fmt/format.h>

#include "base/error.h"
#include "io/study/files_below.h"
#include "registration/motion/tracker.h"
#include "workflow/register/study_options.h"

namespace isoshift {
namespace {

// What an X-ray of the phase would show, centered on the isocenter.
FixedImage drr_of(const RendererPyramid& phase, const Study& study, double gantry_deg) {
  constexpr double kSadMm = 1000.0, kSidMm = 1500.0, kPixelMm = 1.2;
  constexpr int kPixels = 256;
  constexpr double kFirstMm = -0.5 * kPixelMm * (kPixels - 1);
  const XrayView view = make_xray_view({.sad_mm = kSadMm,
                                        .gantry_angle_rad = rad_from_deg(gantry_deg),
                                        .receptor_translation_mm = {0.0, 0.0, kSadMm - kSidMm},
                                        .column_spacing_mm = kPixelMm,
                                        .row_spacing_mm = kPixelMm,
                                        .position_mm = {kFirstMm, -kFirstMm},
                                        .columns = kPixels,
                                        .rows = kPixels},
                                       study.xrays.front().view.beam);
  const RenderResult drr =
      phase.finest().render(std::span(&view, 1), std::span(&study.planned_room_from_patient, 1), PixelSet::all());
  return {.view = view,
          .line_integral = image_of(view, drr.line_integrals(0, 0)),
          .field = Image<std::uint8_t>(view.columns, view.rows, 1)};
}

}  // namespace

std::vector<Eigen::VectorXd> displacements_of_phases(const std::vector<std::filesystem::path>& folders,
                                                     const Study& study, const RegistrationSetup& setup,
                                                     const RenderingOptions& rendering,
                                                     const Eigen::Vector3d& target_patient_mm,
                                                     const Allowances& allowed, Notes& notes) {
  std::vector<Eigen::VectorXd> displacements;
  for (const std::filesystem::path& folder : folders) {
    const CtSeries ct = read_ct_series(files_below({folder}), allowed, notes, {});
    if (ct.frame_of_reference_uid != study.ct->frame_of_reference_uid)
      throw Error(
          fmt::format("{}: {} is not that of the planning CT", folder.string(), described(DCM_FrameOfReferenceUID)));
    const RendererPyramid phase(rendering.kind(), ct.hu, rendering.model(), beams_of(study), rendering.options());
    std::vector<FixedImage> views;
    for (const double gantry_deg : {0.0, 90.0}) views.push_back(drr_of(phase, study, gantry_deg));
    Tracker once(setup.renderers(), *setup.options().region, study.planned_room_from_patient, target_patient_mm, {});
    const TrackedFrame found = once.track(0.0, std::move(views));
    if (!found.measured_mm) throw Error(fmt::format("{}: the target was not found in this phase", folder.string()));
    displacements.emplace_back(*found.measured_mm);
  }
  return displacements;
}

}  // namespace isoshift
