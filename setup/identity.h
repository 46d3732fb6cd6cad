#pragma once
// To which patient and study an object belongs: attributes of PS3.3 C.7.1.1 and C.7.2.1.

#include <string>

namespace isoshift {

// Text as in the file, UTF-8 where the character set could be converted (then character_set says ISO_IR 192).
struct Identity {
  std::string character_set;
  std::string patient_id;
  std::string patient_id_issuer;
  std::string patient_name;
  std::string patient_birth_date;
  std::string patient_sex;
  std::string study_instance_uid;
  std::string study_date;
  std::string study_time;
  std::string study_id;
  std::string accession_number;
  std::string referring_physician;
};

// The patient for people: "7", "7 (St. Elsewhere)". IDs of two issuers are two patients.
inline std::string patient_in_words(const Identity& identity) {
  return identity.patient_id_issuer.empty() ? identity.patient_id
                                            : identity.patient_id + " (" + identity.patient_id_issuer + ")";
}

// The same as a key, which no other patient has: DICOM texts hold no backslash.
inline std::string patient_key(const Identity& identity) {
  return identity.patient_id + "\\" + identity.patient_id_issuer;
}

}  // namespace isoshift
