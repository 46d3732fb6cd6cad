#pragma once
// Among the files of many patients: which X-rays were taken for one setup, and what else belongs to it.

#include <set>
#include <string>
#include <vector>

#include "io/study_files.h"

namespace isoshift {

// X-rays of one patient, one plan and one position: at most 10 minutes apart, no label twice (a label that comes again
// is the next setup). X-rays without a time are told apart by their folder.
struct SessionFiles {
  std::string name;  // made from its X-rays' SOPInstanceUIDs; says nothing of the patient
  std::string patient;
  std::vector<StudyFiles::Image> images;
};

// In the order of patients and times; an instance that is there twice counts once. `other_xrays`: whether those of
// other classes than RT Image are X-rays to be registered.
std::vector<SessionFiles> sessions_of(const StudyFiles& files, bool other_xrays);

// The name of the session that these X-rays make.
std::string session_name(const std::set<std::string>& sop_instance_uids);

// What choose_parts() chooses from for a session: all files of its patient, and of X-rays its own. Files without an
// issuer of the PatientID are of the only one there is.
StudyFiles files_for(const SessionFiles& session, const StudyFiles& files);

// CT images that its structure set was drawn on and that are not there, in words; empty: none, or nobody knows.
std::string missing_ct_images(const StudyFiles& of_session);

// What its files refer to and is not there, in words; empty: all is there.
std::vector<std::string> missing_parts(const StudyFiles& of_session);

}  // namespace isoshift
