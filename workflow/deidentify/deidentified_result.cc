#include "workflow/deidentify/deidentified_result.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

// "... (allowed by KEY: REASON)": why a person allowed what a check forbids, in words of that person.
std::string without_reason(const std::string& message) {
  const std::size_t begin = message.find("(allowed by "), end = message.find(": ", std::min(begin, message.size()));
  return end == std::string::npos ? message : message.substr(0, end) + ")";
}

// Nobody knows what the name of a folder tells.
void replace_in(std::string& message, const Pseudonyms& pseudonyms) {
  message = without_reason(pseudonyms.in(message));
  if (message.find('/') != std::string::npos || message.find(".dcm") != std::string::npos)
    message = "a message that names a file";
}

void replace_in(Finding& finding, const Pseudonyms& pseudonyms) {
  for (std::string* text : {&finding.view, &finding.subject, &finding.words}) replace_in(*text, pseudonyms);
}

void replace_name(std::string& name, const char* kind, Pseudonyms& pseudonyms) {
  if (!name.empty()) name = pseudonyms.text(kind, name);
}

// The name of a structure of the study's structure set, by which messages of the result may name it, too.
void replace_structure(std::string& name, Pseudonyms& pseudonyms) {
  constexpr std::string_view kCentroid = "centroid of ";
  const bool is_centroid = name.starts_with(kCentroid);
  const std::string structure = is_centroid ? name.substr(kCentroid.size()) : name;
  if (structure.empty() || structure.starts_with(kIsocenterSurroundings)) return;
  if (!pseudonyms.knows(structure))
    throw Error(fmt::format("the study does not hold the structure set of the result: it has no structure \"{}\" ({})",
                            structure, described(DCM_ROIName)));
  name = (is_centroid ? std::string(kCentroid) : "") + pseudonyms.in(structure);
}

void replace_uid(std::string& uid, Pseudonyms& pseudonyms) {
  if (!uid.empty()) uid = pseudonyms.uid(uid);
}

Identity deidentified(const Identity& identity, Pseudonyms& pseudonyms) {
  Identity replaced{.character_set = identity.character_set,
                    .study_instance_uid = identity.study_instance_uid,
                    .study_date = pseudonyms.date(identity.study_date),
                    .study_time = identity.study_time};
  if (!identity.patient_id.empty())
    replaced.patient_id = pseudonyms.patient_id(identity.patient_id, identity.patient_id_issuer);
  if (!identity.patient_name.empty()) replaced.patient_name = pseudonyms.patient_name(identity.patient_name);
  if (!identity.patient_birth_date.empty())
    replaced.patient_birth_date = pseudonyms.birth_date(identity.patient_birth_date);
  replace_uid(replaced.study_instance_uid, pseudonyms);
  return replaced;
}

void replace_in(SetupResult::View& view, Pseudonyms& pseudonyms) {
  replace_uid(view.sop_instance_uid, pseudonyms);
  view.label = pseudonyms.in(view.label);
  view.match.label = pseudonyms.in(view.match.label);
  view.match.field.doubt = pseudonyms.in(view.match.field.doubt);
  view.acquired = pseudonyms.date(view.acquired);
  replace_name(view.machine, "Machine", pseudonyms);
  for (ViewPicture::Outline& outline : view.picture.structures) replace_structure(outline.name, pseudonyms);
}

void replace_in(SiteRules& site, Pseudonyms& pseudonyms) {
  replace_name(site.name, "Site", pseudonyms);
  site.target = pseudonyms.in(site.target);
  site.surrogate = pseudonyms.in(site.surrogate);
  if (site.couch_scale) replace_name(site.couch_scale->validated_by, "Person", pseudonyms);
  if (site.automatic_release) replace_name(site.automatic_release->by, "Person", pseudonyms);
}

}  // namespace

SetupResult deidentified(SetupResult result, Pseudonyms& pseudonyms) {
  result.identity = deidentified(result.identity, pseudonyms);
  for (std::string* uid : {&result.ct_series_uid, &result.ct_frame_uid, &result.structure_set_uid, &result.plan_uid,
                           &result.spatial_registration_uid})
    replace_uid(*uid, pseudonyms);
  for (SetupResult::View& view : result.views) replace_in(view, pseudonyms);
  replace_name(result.plan_label, "Plan", pseudonyms);
  result.made_on = pseudonyms.date(result.made_on);
  if (result.site) replace_in(*result.site, pseudonyms);
  if (result.machine) replace_name(result.machine->name, "Machine profile", pseudonyms);
  if (result.start) {
    replace_name(result.start->file, "File", pseudonyms);
    replace_name(result.start->set_by, "Person", pseudonyms);
  }
  for (SetupResult::Point& point : result.points) replace_structure(point.name, pseudonyms);
  if (result.target) {
    replace_structure(result.target->name, pseudonyms);
    result.target->chosen_by = pseudonyms.in(result.target->chosen_by);
    result.target->surrogate = pseudonyms.in(result.target->surrogate);
  }
  for (Alternative& alternative : result.alternatives) alternative.description = pseudonyms.in(alternative.description);
  for (StructureMotion& structure : result.structures) replace_structure(structure.name, pseudonyms);
  for (Finding& finding : result.findings) replace_in(finding, pseudonyms);
  for (std::vector<std::string>* messages : {&result.region, &result.overrides, &result.warnings})
    for (std::string& message : *messages) replace_in(message, pseudonyms);
  result.left_aside.clear();
  return result;
}

}  // namespace isoshift
