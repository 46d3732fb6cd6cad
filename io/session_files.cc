#include "io/session_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "io/session.h"
#include "io/sha256.h"

namespace isoshift {
namespace {

constexpr std::size_t kNameLength = 12;

std::string name_of(const std::vector<StudyFiles::Image>& images) {
  std::set<std::string> uids;
  for (const StudyFiles::Image& image : images) uids.insert(image.sop_instance_uid);
  std::string all;
  for (const std::string& uid : uids) all += uid + "\n";
  return sha256_of(all).substr(0, kNameLength);
}

// Whether an X-ray belongs to the session that the ones before it make.
bool belongs_to(const SessionFiles& session, const StudyFiles::Image& image) {
  const StudyFiles::Image& first = session.images.front();
  if (image.patient != first.patient || image.plan_uid != first.plan_uid) return false;
  if (image.at_s.has_value() != first.at_s.has_value()) return false;
  if (image.at_s && *image.at_s - *first.at_s > kMaxTimeSpanS) return false;
  if (!image.at_s && image.file.parent_path() != first.file.parent_path()) return false;
  return image.label.empty() ||
         std::ranges::find(session.images, image.label, &StudyFiles::Image::label) == session.images.end();
}

}  // namespace

std::vector<SessionFiles> sessions_of(const StudyFiles& files, bool other_xrays) {
  std::vector<StudyFiles::Image> images = files.images;
  if (other_xrays) images.insert(images.end(), files.other_xrays.begin(), files.other_xrays.end());
  std::ranges::sort(images, {}, [](const StudyFiles::Image& image) {
    return std::tuple(image.patient, image.plan_uid, image.at_s, image.file);
  });
  std::set<std::string> seen;
  std::vector<SessionFiles> sessions;
  for (const StudyFiles::Image& image : images) {
    if (!seen.insert(image.sop_instance_uid).second) continue;
    if (sessions.empty() || !belongs_to(sessions.back(), image))
      sessions.push_back({.name = "", .patient = image.patient, .images = {}});
    sessions.back().images.push_back(image);
  }
  for (SessionFiles& session : sessions) session.name = name_of(session.images);
  return sessions;
}

StudyFiles files_for(const SessionFiles& session, const StudyFiles& files) {
  StudyFiles own;
  const std::string id = patient_id_of(session.patient);
  std::set<std::string> issued = {session.patient};  // patients of this ID whose issuer is named
  const auto find_issuers = [&](const auto& entries) {
    for (const auto& entry : entries)
      if (patient_id_of(entry.patient) == id) issued.insert(entry.patient);
  };
  find_issuers(files.cts);
  find_issuers(files.plans);
  find_issuers(files.structures);
  find_issuers(files.images);
  find_issuers(files.other_xrays);
  issued.erase(id + "\\");
  const auto take = [&](auto& to, const auto& from) {
    std::ranges::copy_if(from, std::back_inserter(to), [&](const auto& entry) {
      return entry.patient == session.patient || (issued.size() <= 1 && patient_id_of(entry.patient) == id);
    });
  };
  take(own.cts, files.cts);
  take(own.plans, files.plans);
  take(own.structures, files.structures);
  own.images = session.images;
  return own;
}

std::string missing_ct_images(const StudyFiles& of_session) {
  for (const StudyFiles::Plan& plan : of_session.plans) {
    const auto is_imaged = [&](const auto& image) { return image.plan_uid == plan.sop_instance_uid; };
    if (std::ranges::none_of(of_session.images, is_imaged)) continue;
    for (const StudyFiles::Structures& structures : of_session.structures) {
      if (structures.sop_instance_uid != plan.structure_set_uid) continue;
      const auto absent = std::ranges::count_if(structures.ct_sop_instance_uids, [&](const std::string& uid) {
        return std::ranges::none_of(of_session.cts, [&](const auto& ct) { return ct.sop_instance_uids.contains(uid); });
      });
      if (absent > 0)
        return fmt::format("{} of the {} CT images of the RT Structure Set", absent,
                           structures.ct_sop_instance_uids.size());
    }
  }
  return "";
}

std::vector<std::string> missing_parts(const StudyFiles& of_session) {
  std::vector<std::string> missing;
  if (of_session.cts.empty()) missing.emplace_back("the CT");
  std::set<std::string> plan_uids;
  for (const StudyFiles::Image& image : of_session.images)
    if (!image.plan_uid.empty()) plan_uids.insert(image.plan_uid);
  for (const std::string& uid : plan_uids) {
    const auto plan = std::ranges::find(of_session.plans, uid, &StudyFiles::Plan::sop_instance_uid);
    if (plan == of_session.plans.end())
      missing.push_back(fmt::format("the RT Plan {}", uid));
    else if (!plan->structure_set_uid.empty() &&
             std::ranges::find(of_session.structures, plan->structure_set_uid,
                               &StudyFiles::Structures::sop_instance_uid) == of_session.structures.end())
      missing.push_back(fmt::format("the RT Structure Set {}", plan->structure_set_uid));
  }
  if (std::string images = missing_ct_images(of_session); !images.empty()) missing.push_back(std::move(images));
  return missing;
}

}  // namespace isoshift
