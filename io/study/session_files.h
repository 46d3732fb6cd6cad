#pragma once
// Among the files of many patients: which X-rays were taken for one setup, and what else belongs to it.

#include <set>
#include <string>
#include <vector>

#include "io/study/study_files.h"

namespace isoshift {

// X-rays of one patient, one plan, one machine and one position of the table: at most 10 minutes apart, no label twice.
struct SessionFiles {
  std::string name;  // made from its X-rays' SOPInstanceUIDs; says nothing of the patient
  std::string patient;
  std::vector<StudyFiles::Image> images;  // in the order of their times
  std::vector<std::string> remarks;       // in words: X-rays taken again, why X-rays are not grouped
};

// X-rays are grouped from the newest backwards: a label that comes again begins an earlier session, and so do table
// read-outs that differ. Where no read-outs tell that the table moved, an X-ray that lies nearer in time to the session
// before, of which it repeats a label, is a retake of that one: it is not grouped with later X-rays, between which and
// itself the couch may have moved. X-rays without a time are grouped by their folder, and not at all where a label is
// there twice.
//
// X-rays with a result (their SOPInstanceUIDs in `registered`) are in no session, but still count as the earlier ones
// of which a retake is one. Sessions come in the order of patients and times; an instance that is there twice counts
// once. `other_xrays`: whether those of other classes than RT Image are X-rays to be registered.
std::vector<SessionFiles> sessions_of(const StudyFiles& files, bool other_xrays,
                                      const std::set<std::string>& registered = {});

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
