#pragma once
// Finds, among the files of many patients, the X-rays that were taken for one setup, and the other files of that setup.

#include <set>
#include <string>
#include <vector>

#include "io/study/study_files.h"

namespace isoshift {

// X-rays of one patient, one plan, one machine and one position of the table: at most 10 minutes apart, no label twice.
struct SessionFiles {
  std::string name;  // made from its X-rays' SOPInstanceUIDs; does not identify the patient
  std::string patient;
  std::vector<StudyFiles::Image> images;  // in the order of their times
  std::vector<std::string> remarks;       // in words: retakes, and why X-rays are not grouped
  std::vector<std::string> doubts;        // in words: why other X-rays of the patient make the grouping uncertain
};

// X-rays are grouped from the newest backwards: a label that repeats begins an earlier session, and so do table
// read-outs that differ. Retakes are an exception. An X-ray is a retake of the earlier session if it repeats a label of
// that session and lies nearer in time to it than to the later X-rays, and if no read-outs tell that the table moved. A
// retake is not grouped with the later X-rays, because the couch may have moved after it. X-rays without a time are
// grouped by their folder; if a label occurs twice in the folder, they are not grouped.
//
// X-rays that have a result (their SOPInstanceUIDs are in `registered`) are in no session, but an X-ray may still be a
// retake of them. Sessions are ordered by patient and time. An instance that occurs twice counts once. `other_xrays`:
// whether X-rays of other classes than RT Image are to be registered.
std::vector<SessionFiles> sessions_of(const StudyFiles& files, bool other_xrays,
                                      const std::set<std::string>& registered = {});

// Why these X-rays, which have a result, would not be accepted as one session any more, now that other X-rays of their
// patient are known, in words. Empty: they would be. `files`, of that patient, hold them.
std::string objection_to(const std::set<std::string>& sop_instance_uids, const StudyFiles& files, bool other_xrays,
                         std::set<std::string> registered);

// What other X-rays of the patient say against X-rays that a person has made a session, in words. `files`, of that
// patient, hold them.
std::vector<std::string> doubts_about(const SessionFiles& session, const StudyFiles& files, bool other_xrays,
                                      std::set<std::string> registered);

// Finds X-rays that have one SOPInstanceUID and different contents, and notes in each the file of the other.
void compare_copies(StudyFiles& files);

// Whether the times tell which was taken first: not if one of them is unknown, if one has an offset from UTC and the
// other none, or if clock and offset contradict each other.
bool tells_which_is_first(const StudyFiles::Image& a, const StudyFiles::Image& b);

// The name of the session of these X-rays.
std::string session_name(const std::set<std::string>& sop_instance_uids);

// The files from which choose_parts() chooses the parts of a session: its own X-rays, and all other files of its
// patient. A file without an IssuerOfPatientID belongs to the only issuer that other files name for that PatientID.
StudyFiles files_for(const SessionFiles& session, const StudyFiles& files);

// The missing CT images on which the session's structure set was drawn, in words. Empty if none are missing, or if no
// structure set tells.
std::string missing_ct_images(const StudyFiles& of_session);

// Why a file in a folder of these CT images or X-rays cannot be read: it may be one of them. If every X-ray lies in a
// folder of its own, a file anywhere below the folder that holds these may be one, too. Empty if there is no such file.
// `unreadable`: messages, each beginning with the file's path.
std::string unreadable_beside(const StudyParts& parts, const std::vector<std::string>& unreadable);

// The missing objects to which the session's files refer, in words. Empty if nothing is missing.
std::vector<std::string> missing_parts(const StudyFiles& of_session);

}  // namespace isoshift
