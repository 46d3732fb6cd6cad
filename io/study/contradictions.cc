#include "io/study/contradictions.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace isoshift {
namespace {

void compare_sex(const Study& study, std::vector<std::string>& found) {
  const std::string& expected = study.ct->identity.patient_sex;
  const auto compare = [&](const Identity& identity, const std::string& name) {
    if (!expected.empty() && !identity.patient_sex.empty() && identity.patient_sex != expected)
      found.push_back(fmt::format("{}: {} is {}, that of the CT is {}", name, described(DCM_PatientSex),
                                  identity.patient_sex, expected));
  };
  if (study.plan) compare(study.plan->identity, study.plan->path.string());
  if (study.structures) compare(study.structures->identity, study.structures->path.string());
  for (const RtImage& image : study.rt_images) compare(image.identity, image.path.string());
}

void compare_dates(const Study& study, std::vector<std::string>& found) {
  const auto compare = [&](const std::string& date, const char* what, const RtImage& image) {
    const auto before = date_digits(image.acquisition_date.value_or("")), after = date_digits(date);
    if (before && after && *before < *after)
      found.push_back(fmt::format("{}: was taken on {}, before the {} of {}", image.label, *before, what, *after));
  };
  for (const RtImage& image : study.rt_images) {
    compare(study.ct->acquired_on, "CT", image);
    if (study.plan) compare(study.plan->made_on, "plan", image);
  }
}

void compare_machines(const Study& study, std::vector<std::string>& found) {
  if (!study.plan) return;
  std::set<std::string> planned;
  for (const RtPlan::Beam& beam : study.plan->beams) planned.insert(beam.machine);
  if (planned.contains("")) return;
  for (const RtImage& image : study.rt_images)
    if (const auto machine = image.equipment.find("RadiationMachineName");
        machine != image.equipment.end() && !planned.contains(machine->second))
      found.push_back(fmt::format("{}: {} is \"{}\"; the plan's beams are for \"{}\" ({})", image.label,
                                  described(DCM_RadiationMachineName), machine->second, *planned.begin(),
                                  described(DCM_TreatmentMachineName)));
}

// A plan that is not approved is told of where it is compared.
void tell_what_was_rejected(const Study& study, std::vector<std::string>& found) {
  const auto tell = [&](const std::string& status, const std::string& name) {
    if (status == "REJECTED") found.push_back(fmt::format("{}: {} is REJECTED", name, described(DCM_ApprovalStatus)));
  };
  if (study.structures) tell(study.structures->approval_status, study.structures->path.string());
  for (const RtImage& image : study.rt_images) tell(image.approval_status, image.path.string());
}

}  // namespace

std::vector<std::string> contradictions_in(const Study& study) {
  std::vector<std::string> found;
  compare_sex(study, found);
  compare_dates(study, found);
  compare_machines(study, found);
  tell_what_was_rejected(study, found);
  return found;
}

}  // namespace isoshift
