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

  // "Structure 3" for the third of that kind.
  std::string text(std::string_view kind, const std::string& original);

  // "Patient 1" for all names that comparable_name() makes the same.
  std::string patient_name(const std::string& original);

  // "ANON 1": one ID of two issuers is of two patients; an ID without an issuer is of the first one that was met.
  std::string patient_id(const std::string& original, const std::string& issuer);

  // A day that nobody who is alive was born on, as DA: the first day of 1850 for the first birth date, the second for
  // the second.
  std::string birth_date(const std::string& original);

  // The date with which a DA or DT value or an ISO 8601 time begins is moved ("20260301", "2026.03.01", "2026-03-01"),
  // and the time behind it stays. Empty for anything else.
  std::string date(const std::string& original) const;

  // Anything else that in() replaces, such as the name of a file. Of several pseudonyms the first counts there.
  void stands_for(const std::string& original, const std::string& by);

  // Whether anything stands for this text.
  bool knows(const std::string& original) const { return originals_.contains(original); }

  // What stands for a text as a whole; else, in a sentence, for every original of three characters and more that stands
  // in it as a word, and for shorter ones in quotation marks: without, they may be words and numbers of the sentence
  // itself. Dates in it are moved.
  std::string in(std::string sentence) const;

 private:
  std::string with_moved_dates(const std::string& sentence) const;

  int days_;
  int patients_ = 0;
  std::map<std::string, std::string, std::less<>> uids_;
  std::map<std::string, std::map<std::string, std::string>, std::less<>> texts_;  // of each kind
  std::map<std::string, std::map<std::string, std::string>> ids_;                 // by issuer
  std::map<std::string, std::string> birth_dates_;
  std::map<std::string, std::string, std::less<>> originals_;  // as they were written
};

}  // namespace isoshift
