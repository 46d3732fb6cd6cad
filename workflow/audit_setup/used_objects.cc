#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/dicom/dicom_dataset.h"
#include "io/objects/registration_check.h"
#include "io/objects/registration_meaning.h"
#include "io/study/files_below.h"
#include "io/study/session.h"
#include "workflow/audit_setup/used_shifts.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

std::vector<CheckedRegistration> registrations_below(const fs::path& folder, std::vector<std::string>& of_no_use) {
  if (!fs::is_directory(folder)) throw Error(fmt::format("{}: is not a folder", folder.string()));
  std::set<fs::path> unsearchable;
  std::vector<CheckedRegistration> objects;
  for (const fs::path& file : files_below({folder}, {}, &unsearchable)) {
    try {
      if (file.extension() == ".dcm" || beginning_of(file) == Beginning::kDicom)
        objects.push_back(check_registration(file));
    } catch (const Error& error) {
      of_no_use.emplace_back(error.what());
    }
  }
  for (const fs::path& path : unsearchable) of_no_use.push_back(why_not_searched(path));
  if (objects.empty())
    throw Error(fmt::format("{}: holds no Spatial Registration object{}", folder.string(),
                            of_no_use.empty() ? "" : "; " + of_no_use.front()));
  return objects;
}

// What the object means for the session's couch; why it means nothing, if it does not.
std::string use_object(CheckedRegistration& object, const std::optional<Eigen::Vector3d>& source_isocenter_mm,
                       AuditedSession& session) {
  for (const FailedCheck& finding :
       patient_findings({&session.identity, "session " + session.name}, {&object.identity, object.path.string()}))
    return finding.message;
  if (session.ct_frame_uid.empty())
    return fmt::format("{}: the result of the session does not say in which frame of reference its CT is ({})",
                       object.path.string(), described(DCM_FrameOfReferenceUID));
  if (object.registered_frame_uid != session.ct_frame_uid)
    return fmt::format("{}: registers the frame {}, and the session's CT has {} ({})", object.path.string(),
                       object.registered_frame_uid, session.ct_frame_uid, described(DCM_FrameOfReferenceUID));
  const RegistrationMeaning meaning = meaning_of(object, session.planned, source_isocenter_mm);
  if (!meaning.couch_shift) {
    const auto error = std::ranges::find_if(object.findings, [](const RegistrationFinding& finding) {
      return finding.is_error && finding.text.find("couch shift") != std::string::npos;
    });
    return fmt::format(
        "{}: {}", object.path.string(),
        error == object.findings.end() ? "it means no couch shift (isoshift check says why)" : error->text);
  }
  const CouchShift& shift = *meaning.couch_shift;
  const Eigen::Vector3d& mm = shift.translation_mm;
  session.used = {mm.x(),
                  mm.y(),
                  mm.z(),
                  deg_from_rad(shift.change.z_rad),
                  deg_from_rad(shift.change.x_rad),
                  deg_from_rad(shift.change.y_rad)};
  session.used_from = object.path.string();
  return "";
}

}  // namespace

std::vector<std::string> read_used_objects(const fs::path& folder,
                                           const std::optional<Eigen::Vector3d>& source_isocenter_mm,
                                           std::vector<AuditedSession>& sessions) {
  std::vector<std::string> of_no_use;
  std::vector<CheckedRegistration> objects = registrations_below(folder, of_no_use);
  std::map<AuditedSession*, std::vector<CheckedRegistration*>> by_session;
  for (CheckedRegistration& object : objects) {
    bool names_xrays = false;
    for (AuditedSession& session : sessions) {
      const bool is_of_session = std::ranges::any_of(
          session.xrays, [&](const std::string& xray) { return object.referenced_instance_uids.contains(xray); });
      names_xrays = names_xrays || is_of_session;
      if (is_of_session) by_session[&session].push_back(&object);
    }
    if (!names_xrays) of_no_use.push_back(fmt::format("{}: names no X-ray of a session", object.path.string()));
  }
  for (auto& [session, own] : by_session) {
    if (own.size() > 1) {
      session->not_compared = fmt::format("{} registration objects name its X-rays, among them {} and {}", own.size(),
                                          own[0]->path.string(), own[1]->path.string());
      continue;
    }
    session->not_compared = use_object(*own.front(), source_isocenter_mm, *session);
  }
  return of_no_use;
}

}  // namespace isoshift
