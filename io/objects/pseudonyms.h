#pragma once
// What stands for names, UIDs and dates that tell who a patient is: the same for the same, so that files which
// belonged together still do, and anything else in every run.

#include <map>
#include <string>
#include <string_view>

namespace isoshift {

class Pseudonyms {
 public:
  // Dates are moved by 1 to 3650 days, which nobody is told.
  Pseudonyms();

  std::string uid(const std::string& original);

  // "Structure 3" for the third of that kind. Names of patients and of everything else count as the same if only the
  // case of letters differs.
  std::string text(std::string_view kind, const std::string& original);

  // The same of a PatientID and its issuer, which may be empty: one ID of two issuers is of two patients.
  std::string patient_id(const std::string& original, const std::string& issuer);

  // The date with which a DA or DT value or an ISO 8601 time begins is moved ("20260301", "2026.03.01", "2026-03-01"),
  // and the time behind it stays. Empty for what does not begin with a date.
  std::string date(const std::string& original) const;

  // Anything else that in() replaces, such as the name of a file. Of several pseudonyms the first counts there.
  void stands_for(const std::string& original, const std::string& by) { originals_.try_emplace(original, by); }

  // A sentence in which every original is replaced that stands in it as a word.
  std::string in(std::string sentence) const;

 private:
  int days_;
  std::map<std::string, std::string, std::less<>> uids_;
  std::map<std::string, std::map<std::string, std::string>, std::less<>> texts_;  // of each kind
  std::map<std::string, std::string, std::less<>> originals_;                     // as they were written
};

}  // namespace isoshift
