#include "io/study/session_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <numeric>
#include <ranges>
#include <set>
#include <span>
#include <tuple>

#include "base/sha256.h"
#include "io/study/session.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kNameLength = 12;

std::string name_of(const std::vector<StudyFiles::Image>& images) {
  std::set<std::string> uids;
  for (const StudyFiles::Image& image : images) uids.insert(image.sop_instance_uid);
  return session_name(uids);
}

using Images = std::span<const StudyFiles::Image>;

bool has_label(Images images, const std::string& label) {
  return !label.empty() && std::ranges::find(images, label, &StudyFiles::Image::label) != images.end();
}

// X-rays of one patient and plan, in the order of their times, and which of them have a result already.
struct Timeline {
  Images images;
  const std::set<std::string>& registered;

  bool is_free(std::size_t n) const { return !registered.contains(images[n].sop_instance_uid); }
  double gap_s(std::size_t n) const { return *images[n + 1].at_s - *images[n].at_s; }

  // Whether an X-ray may be of the session that the ones from `oldest` to `newest` make.
  bool may_join(std::size_t n, std::size_t oldest, std::size_t newest) const {
    const Images session = images.subspan(oldest, newest - oldest + 1);
    return is_free(n) && *images[newest].at_s - *images[n].at_s <= kMaxTimeSpanS &&
           !has_label(session, images[n].label) && std::ranges::none_of(session, [&](const auto& image) {
             return has_table_moved(image.table, images[n].table);
           });
  }

  // Whether an X-ray may rather belong to the one before than to the one after it: the time before it is not clearly
  // longer, and no read-outs tell that the couch moved then.
  bool is_nearer_to_earlier(std::size_t n) const {
    constexpr double kClearlyLonger = 2.0;
    return n > 0 && gap_s(n - 1) < kClearlyLonger * gap_s(n) && !has_table_moved(images[n].table, images[n - 1].table);
  }

  // Where the session begins that ends with `newest`.
  std::size_t oldest_with(std::size_t newest) const {
    std::size_t oldest = newest;
    while (oldest > 0 && may_join(oldest - 1, oldest, newest)) --oldest;
    while (oldest < newest && is_nearer_to_earlier(oldest)) ++oldest;
    return oldest;
  }

  // Which X-rays of a session repeat a label of an earlier one that is not in it.
  std::vector<std::string> retakes(std::size_t oldest, std::size_t newest) const {
    std::vector<std::string> words;
    for (std::size_t n = oldest; n <= newest; ++n)
      for (const StudyFiles::Image& before : images.first(oldest) | std::views::reverse) {
        const double after_s = *images[n].at_s - *before.at_s;
        if (after_s > kMaxTimeSpanS) break;
        if (images[n].label.empty() || before.label != images[n].label) continue;
        words.push_back(
            fmt::format("{} was taken again {:.0f} s after {}", images[n].label, after_s, before.file.string()));
        break;
      }
    return words;
  }

  std::vector<SessionFiles> sessions() const {
    std::vector<SessionFiles> all;
    for (std::size_t end = images.size(); end > 0;) {
      const std::size_t newest = end - 1, oldest = is_free(newest) ? oldest_with(newest) : newest;
      if (is_free(newest))
        all.push_back({.patient = images[newest].patient,
                       .images = {images.begin() + static_cast<std::ptrdiff_t>(oldest),
                                  images.begin() + static_cast<std::ptrdiff_t>(end)},
                       .remarks = retakes(oldest, newest)});
      end = oldest;
    }
    std::ranges::reverse(all);
    return all;
  }
};

// X-rays without a time, of one patient, plan and folder: one session, unless a label or the table tells that they are
// several. Then it is not known which of them belong together.
std::vector<SessionFiles> untimed_sessions(Images images, const std::set<std::string>& registered) {
  std::vector<SessionFiles> all;
  bool is_one = true;
  for (std::size_t n = 1; n < images.size(); ++n)
    is_one = is_one && !has_label(images.first(n), images[n].label) &&
             !has_table_moved(images[n].table, images.front().table);
  for (const StudyFiles::Image& image : images) {
    if (registered.contains(image.sop_instance_uid)) continue;
    if (all.empty() || !is_one) all.push_back({.patient = image.patient});
    all.back().images.push_back(image);
    if (!is_one)
      all.back().remarks.push_back(fmt::format(
          "{} is one of several sessions' X-rays, and without acquisition times it is not known which of them belong "
          "together",
          image.file.string()));
  }
  return all;
}

// What the patient's other X-rays say against a session.
class Doubts {
 public:
  // `sessions`: all that were found among the `images` of all patients.
  Doubts(std::vector<StudyFiles::Image> images, std::span<const SessionFiles> sessions) : images_(std::move(images)) {
    std::ranges::sort(images_, {}, [](const auto& image) { return std::tuple(image.at_s, image.file); });
    for (const StudyFiles::Image& image : images_) of_patient_[patient_id_of(image.patient)].push_back(&image);
    for (const SessionFiles& session : sessions)
      for (const StudyFiles::Image& image : session.images) session_of_[image.sop_instance_uid] = session.images;
  }

  std::vector<std::string> of(const SessionFiles& session) const {
    Images own = session.images;
    std::vector<std::string> doubts;
    for (const StudyFiles::Image& image : own)
      if (!image.other.empty())
        doubts.push_back(fmt::format("{} and {} have one SOPInstanceUID and different contents", image.file.string(),
                                     image.other.string()));
    if (own.size() < 2 || !own.front().at_s) return doubts;
    const std::vector<const StudyFiles::Image*>& all = of_patient_.at(patient_id_of(session.patient));
    if (all_tell_position(own)) {
      // The couch did not move between these views, except by a top that moves on it without changing its read-outs.
      if (auto doubt = of_neighbors(own, retakes(own, all)); !doubt.empty()) doubts.push_back(std::move(doubt));
      return doubts;
    }
    Neighbors neighbors;
    for (const StudyFiles::Image* const one : all) {
      const StudyFiles::Image& other = *one;
      if (is_in(own, other)) continue;
      if (!tells_which_is_first(own.front(), other)) {
        if (has_label(own, other.label))
          doubts.push_back(fmt::format("{} shows {}, too, and whether it was taken before or after is not known",
                                       other.file.string(), other.label));
      } else if (is_copy_of_one(own, other)) {
        continue;
      } else if (*other.at_s > *own.front().at_s && *other.at_s < *own.back().at_s) {
        doubts.push_back(fmt::format("{} was taken between these views", other.file.string()));
      } else if (has_time_of_own_label(own, other)) {
        doubts.push_back(
            fmt::format("{} is another {} with the time of one of these views", other.file.string(), other.label));
      } else {
        neighbors.add(own, one);
      }
    }
    if (auto doubt = of_neighbors(own, neighbors); !doubt.empty()) doubts.push_back(std::move(doubt));
    return doubts;
  }

 private:
  // Other X-rays, those nearest to the session first.
  struct Neighbors {
    std::vector<const StudyFiles::Image*> before, after;

    // In the order of the times.
    void add(Images own, const StudyFiles::Image* other) {
      if (*other->at_s <= *own.front().at_s)
        before.insert(before.begin(), other);
      else
        after.push_back(other);
    }
  };

  static bool is_in(Images own, const StudyFiles::Image& image) {
    return std::ranges::find(own, image.sop_instance_uid, &StudyFiles::Image::sop_instance_uid) != own.end();
  }

  // Whether the X-ray may be a copy of one of `own` in another class: it has that time, and no label.
  static bool is_copy_of_one(Images own, const StudyFiles::Image& other) {
    return other.label.empty() && std::ranges::find(own, other.at_s, &StudyFiles::Image::at_s) != own.end() &&
           std::ranges::none_of(own, [](const auto& image) { return image.label.empty(); });
  }

  // Whether the X-ray repeats the label of one of `own` at the time of any of them: then nothing tells which is of
  // which session.
  static bool has_time_of_own_label(Images own, const StudyFiles::Image& other) {
    return has_label(own, other.label) &&
           std::ranges::any_of(own, [&](const auto& image) { return image.at_s == other.at_s; });
  }

  // X-rays before and after the session that repeat one of its labels without the table having moved.
  static Neighbors retakes(Images own, std::span<const StudyFiles::Image* const> all) {
    Neighbors neighbors;
    for (const StudyFiles::Image* const other : all)
      if (!is_in(own, *other) && tells_which_is_first(own.front(), *other) && has_label(own, other->label) &&
          !has_table_moved(own.front().table, other->table) &&
          (*other->at_s < *own.front().at_s || *other->at_s > *own.back().at_s))
        neighbors.add(own, other);
    return neighbors;
  }

  // The X-rays of the session that an X-ray is in; empty if it is in none: it is of another class, or has a result.
  Images session_of(const StudyFiles::Image& image) const {
    const auto found = session_of_.find(image.sop_instance_uid);
    return found == session_of_.end() ? Images() : found->second;
  }

  // The longest time between X-rays that follow each other.
  static double longest_gap_s(Images images) {
    double longest_s = 0.0;
    for (std::size_t n = 1; n < images.size(); ++n)
      longest_s = std::max(longest_s, *images[n].at_s - *images[n - 1].at_s);
    return longest_s;
  }

  static double apart_s(Images own, const StudyFiles::Image& other) {
    return std::max(*own.front().at_s - *other.at_s, *other.at_s - *own.back().at_s);
  }

  bool lacks_partner(const StudyFiles::Image& other, Images own) const {
    const Images session = session_of(other);
    return !session.empty() && session.size() < own.size();
  }

  // An X-ray without its partner among the neighbors on one side, as far as all gaps up to it are short: then the views
  // of these sessions may belong together in another way. A gap is short if it is not clearly longer than those within
  // the session that it follows.
  const StudyFiles::Image* lonely(Images own, std::span<const StudyFiles::Image* const> neighbors) const {
    constexpr double kClearlyLonger = 10.0;
    Images session = own;
    for (const StudyFiles::Image* const other : neighbors) {
      if (session_of(*other).empty() || is_in(session, *other)) continue;
      if (apart_s(session, *other) > std::min(kMaxTimeSpanS, kClearlyLonger * longest_gap_s(session))) return nullptr;
      if (lacks_partner(*other, own)) return other;
      session = session_of(*other);
    }
    return nullptr;
  }

  // An X-ray without its partner before or after the session may be the partner of one of its views.
  std::string of_neighbors(Images own, const Neighbors& neighbors) const {
    constexpr double kClearlyNearer = 0.5;  // two X-rays that follow each other closely are of one setup
    for (const auto& [side, when] : {std::pair(&neighbors.before, "before"), std::pair(&neighbors.after, "after")})
      if (!side->empty() && apart_s(own, *side->front()) < kClearlyNearer * longest_gap_s(own))
        return fmt::format("{}, {:.0f} s {}, lies nearer to one of these views than they lie to each other",
                           side->front()->file.string(), apart_s(own, *side->front()), when);
    const auto lacks_partner_near = [&](const std::vector<const StudyFiles::Image*>& side) {
      return !side.empty() && apart_s(own, *side.front()) <= kMaxTimeSpanS && lacks_partner(*side.front(), own);
    };
    const StudyFiles::Image *before = lonely(own, neighbors.before), *after = lonely(own, neighbors.after);
    if (lacks_partner_near(neighbors.before) && lacks_partner_near(neighbors.after)) before = neighbors.before.front();
    if (before == nullptr && after == nullptr) return "";
    const StudyFiles::Image& other = before != nullptr ? *before : *after;
    return fmt::format("{}, {:.0f} s {}, has no partner, and may belong to one of these views", other.file.string(),
                       apart_s(own, other), before != nullptr ? "before" : "after");
  }

  std::vector<StudyFiles::Image> images_;                                    // in the order of their times
  std::map<std::string, std::vector<const StudyFiles::Image*>> of_patient_;  // by PatientID
  std::map<std::string, Images> session_of_;                                 // by SOPInstanceUID
};

// The lowest folder that holds all files, with a slash; empty unless each of several files has a folder of its own, and
// these have more in common than the root.
std::string folder_above(const std::vector<fs::path>& files) {
  std::set<fs::path> folders;
  for (const fs::path& file : files) folders.insert(file.parent_path());
  if (folders.size() < 2 || folders.size() < files.size()) return "";
  fs::path above = *folders.begin();
  for (const fs::path& folder : folders) {
    const auto differs = std::mismatch(above.begin(), above.end(), folder.begin(), folder.end()).first;
    above = std::accumulate(above.begin(), differs, fs::path(), std::divides());
  }
  return above == above.root_path() ? "" : above.string() + "/";
}

}  // namespace

std::string objection_to(const std::set<std::string>& sop_instance_uids, const StudyFiles& files, bool other_xrays,
                         std::set<std::string> registered) {
  for (const std::string& uid : sop_instance_uids) registered.erase(uid);
  const std::vector<SessionFiles> sessions = sessions_of(files, other_xrays, registered);
  const auto same = std::ranges::find(sessions, session_name(sop_instance_uids), &SessionFiles::name);
  if (same == sessions.end()) return "together with X-rays that have come later, these would be grouped in another way";
  return same->doubts.empty() ? "" : same->doubts.front();
}

std::vector<std::string> doubts_about(const SessionFiles& session, const StudyFiles& files, bool other_xrays,
                                      std::set<std::string> registered) {
  for (const StudyFiles::Image& image : session.images) registered.insert(image.sop_instance_uid);
  std::vector<SessionFiles> sessions = sessions_of(files, other_xrays, registered);
  sessions.push_back(session);
  std::vector<StudyFiles::Image> images;
  std::set<std::string> seen;
  for (const auto* all : {&files.images, &files.other_xrays})
    for (const StudyFiles::Image& image : *all)
      if (seen.insert(image.sop_instance_uid).second) images.push_back(image);
  return Doubts(std::move(images), sessions).of(session);
}

void compare_copies(StudyFiles& files) {
  std::map<std::string, StudyFiles::Image*> first_of;
  for (auto* images : {&files.images, &files.other_xrays})
    for (StudyFiles::Image& image : *images) {
      const auto [first, is_new] = first_of.emplace(image.sop_instance_uid, &image);
      if (is_new || sha256_of_file(first->second->file) == sha256_of_file(image.file)) continue;
      image.other = first->second->file;
      first->second->other = image.file;
    }
}

bool tells_which_is_first(const StudyFiles::Image& a, const StudyFiles::Image& b) {
  if (!a.at_s || !b.at_s) return false;
  if (a.has_utc_offset != b.has_utc_offset)
    return std::abs(*a.at_s - *b.at_s) > StudyFiles::kLargestUtcOffsetS + kMaxTimeSpanS;
  return a.at_s == b.at_s || a.acquired == b.acquired || (*a.at_s < *b.at_s) == (a.acquired < b.acquired);
}

std::string session_name(const std::set<std::string>& sop_instance_uids) {
  std::string all;
  for (const std::string& uid : sop_instance_uids) all += uid + "\n";
  return sha256_of(all).substr(0, kNameLength);
}

std::vector<SessionFiles> sessions_of(const StudyFiles& files, bool other_xrays,
                                      const std::set<std::string>& registered) {
  std::vector<StudyFiles::Image> images;
  std::set<std::string> seen;
  const auto take_new = [&](const std::vector<StudyFiles::Image>& from) {
    std::ranges::copy_if(from, std::back_inserter(images),
                         [&](const auto& image) { return seen.insert(image.sop_instance_uid).second; });
  };
  take_new(counting_images(files));
  if (other_xrays) take_new(files.other_xrays);
  // Those without a time come first, by folder.
  const auto place_of = [](const StudyFiles::Image& image) {
    return image.at_s ? fs::path() : image.file.parent_path();
  };
  std::ranges::sort(images, {}, [&](const StudyFiles::Image& image) {
    return std::tuple(image.patient, image.plan_uid, image.machine, image.at_s, place_of(image), image.file);
  });
  const auto whose = [&](const StudyFiles::Image& image) {
    return std::tuple(image.patient, image.plan_uid, image.machine, image.at_s.has_value(), place_of(image));
  };
  std::vector<SessionFiles> sessions;
  for (auto begin = images.begin(); begin != images.end();) {
    const auto end =
        std::find_if(begin, images.end(), [&](const auto& image) { return whose(image) != whose(*begin); });
    std::vector<SessionFiles> found = begin->at_s
                                          ? Timeline{.images = Images(begin, end), .registered = registered}.sessions()
                                          : untimed_sessions(Images(begin, end), registered);
    std::ranges::move(found, std::back_inserter(sessions));
    begin = end;
  }
  // Evidence are all X-rays, those that are not to be registered, too.
  if (!other_xrays) take_new(files.other_xrays);
  const Doubts doubts(std::move(images), sessions);
  for (SessionFiles& session : sessions) {
    session.name = name_of(session.images);
    session.doubts = doubts.of(session);
  }
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

std::string unreadable_beside(const StudyParts& parts, const std::vector<std::string>& unreadable) {
  std::set<std::string> folders;
  for (const auto& files : {parts.ct, parts.images})
    for (const fs::path& file : files) folders.insert(file.parent_path().string() + "/");
  const std::string above = folder_above(parts.images);
  for (const std::string& reason : unreadable) {
    if (!above.empty() && reason.starts_with(above)) return reason;
    for (const std::string& folder : folders)
      if (reason.starts_with(folder) &&
          reason.substr(0, reason.find(": ")).find('/', folder.size()) == std::string::npos)
        return reason;
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
