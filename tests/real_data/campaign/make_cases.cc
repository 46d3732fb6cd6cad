// make_cases CT_ROOT OUT SEED...: the cases with these seeds, each in OUT/SEED. CT_ROOT holds head/CT and chest/CT.

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <map>

#include "base/process.h"
#include "io/dicom/decoder_process.h"
#include "tests/real_data/campaign/case_files.h"
#include "tests/real_data/campaign/case_plan.h"
#include "tests/real_data/campaign/tissue.h"

namespace isoshift::campaign {
namespace {

// What the X-rays see: the patient of the CT with what has changed since.
Patient changed(Patient patient, const CasePlan& plan) {
  if (plan.holder_is_gone) clear_outside(patient, {-84.0, 5.0, -1e4}, {84.0, 205.0, 1e4});
  if (plan.lost_mm > 0.0) lose_weight(patient, plan.lost_mm);
  if (plan.effusion_behind_mm < 1e8) put_effusion(patient, plan.effusion_behind_mm);
  for (const CasePlan::Ball& ball : plan.gas) put_gas(patient, ball.center_mm, ball.half_extent_mm);
  for (const CasePlan::Rod& rod : plan.metal) put_metal(patient, rod.begin_mm, rod.end_mm, rod.radius_mm);
  return patient;
}

void make_case(std::uint64_t seed, const Patient& patient, const std::filesystem::path& out) {
  const auto begin = std::chrono::steady_clock::now();
  const CasePlan plan = draw_case(seed, stratum_of(seed), anatomy_of(seed));
  const Deformation deformation(plan.bendings, plan.breath);
  const Patient seen = changed(patient, plan);
  std::mt19937_64 noise(seed);
  write_case(plan, patient, deformation, expose(seen, deformation, plan.setup, plan.exposures, noise),
             out / fmt::format("{}", seed));
  fmt::print("{} {} {}: {:.1f} s\n", seed, plan.anatomy, plan.stratum,
             std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  if (argc < 4) {
    fmt::print(stderr, "make_cases CT_ROOT OUT SEED...\n");
    return 2;
  }
  const std::filesystem::path ct_root = argv[1], out = argv[2];
  std::map<std::string, Patient> patients;
  for (int n = 3; n < argc; ++n) {
    const std::uint64_t seed = std::stoull(argv[n]);
    const std::string anatomy = anatomy_of(seed);
    if (!patients.contains(anatomy)) patients[anatomy] = read_patient(ct_root / anatomy / "CT");
    make_case(seed, patients[anatomy], out);
  }
  return 0;
}

}  // namespace
}  // namespace isoshift::campaign

int main(int argc, char** argv) {
  isoshift::use_decoder(isoshift::decoder_of(ISOSHIFT_PROGRAM));
  isoshift::use_program(ISOSHIFT_PROGRAM);
  try {
    return isoshift::campaign::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
  }
}
