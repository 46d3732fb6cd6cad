#include "io/objects/pseudonyms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <random>
#include <regex>
#include <vector>

#include "io/dicom/dicom_dataset.h"
#include "io/dicom/identity.h"

namespace isoshift {
namespace {

bool is_of_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; }

std::string text_of(std::chrono::year_month_day day, std::string_view separator) {
  return fmt::format("{:04}{}{:02}{}{:02}", static_cast<int>(day.year()), separator, static_cast<unsigned>(day.month()),
                     separator, static_cast<unsigned>(day.day()));
}

// `original` where no letter or digit goes on before or behind it.
void replace_word(std::string& sentence, std::string_view original, std::string_view by) {
  for (std::size_t at = 0; (at = sentence.find(original, at)) != std::string::npos;) {
    const std::size_t end = at + original.size();
    const bool is_word =
        (at == 0 || !is_of_word(sentence[at - 1])) && (end == sentence.size() || !is_of_word(sentence[end]));
    if (is_word) sentence.replace(at, original.size(), by);
    at += is_word ? by.size() : 1;
  }
}

}  // namespace

Pseudonyms::Pseudonyms() {
  std::random_device random;
  days_ = std::uniform_int_distribution(1, 3650)(random);
}

void Pseudonyms::stands_for(const std::string& original, const std::string& by) {
  if (!original.empty()) originals_.try_emplace(original, by);
}

std::string Pseudonyms::uid(const std::string& original) {
  std::string& known = uids_[original];
  if (known.empty()) known = new_uid();
  stands_for(original, known);
  return known;
}

std::string Pseudonyms::text(std::string_view kind, const std::string& original) {
  auto& of_kind = texts_[std::string(kind)];
  std::string& known = of_kind[original];
  if (known.empty()) known = fmt::format("{} {}", kind, of_kind.size());
  stands_for(original, known);
  return known;
}

std::string Pseudonyms::patient_name(const std::string& original) {
  const std::string known = text("Patient", comparable_name(original));
  stands_for(original, known);
  return known;
}

std::string Pseudonyms::patient_id(const std::string& original, const std::string& issuer) {
  auto& by_issuer = ids_[original];
  auto same = by_issuer.find(issuer);
  if (same == by_issuer.end() && issuer.empty()) same = by_issuer.begin();
  if (same == by_issuer.end() && by_issuer.size() == 1) same = by_issuer.find("");
  const std::string known = same == by_issuer.end() ? fmt::format("ANON {}", ++patients_) : same->second;
  by_issuer.emplace(issuer, known);
  stands_for(original, known);
  stands_for(issuer, known);
  return known;
}

std::string Pseudonyms::birth_date(const std::string& original) {
  constexpr std::chrono::year_month_day kFirst(std::chrono::year(1850) / 1 / 1);
  std::string& known = birth_dates_[comparable_date(original)];
  if (known.empty()) known = text_of(std::chrono::sys_days(kFirst) + std::chrono::days(birth_dates_.size() - 1), "");
  stands_for(original, known);
  return known;
}

std::string Pseudonyms::date(const std::string& original) const {
  using std::chrono::day, std::chrono::month, std::chrono::year;
  constexpr std::size_t kDigits = 8;
  std::string digits, separator;
  std::size_t end = 0;
  for (; end < original.size() && digits.size() < kDigits; ++end) {
    if (std::isdigit(static_cast<unsigned char>(original[end])) != 0)
      digits += original[end];
    else if ((original[end] == '.' || original[end] == '-') && (digits.size() == 4 || digits.size() == 6))
      separator = original[end];
    else
      return "";
  }
  if (digits.size() < kDigits) return "";
  const std::chrono::year_month_day found(year(std::stoi(digits.substr(0, 4))),
                                          month(static_cast<unsigned>(std::stoi(digits.substr(4, 2)))),
                                          day(static_cast<unsigned>(std::stoi(digits.substr(6, 2)))));
  static const std::regex time("([T ]?[0-9]{2}(:?[0-9]{2}(:?[0-9]{2}(\\.[0-9]{1,6})?)?)?)?([+-][0-9]{2}:?[0-9]{2})?");
  if (!found.ok() || !std::regex_match(original.begin() + static_cast<std::ptrdiff_t>(end), original.end(), time))
    return "";
  return text_of(std::chrono::sys_days(found) - std::chrono::days(days_), separator) + original.substr(end);
}

std::string Pseudonyms::in(std::string sentence) const {
  if (const auto whole = originals_.find(sentence); whole != originals_.end()) return whole->second;
  // The longest first: one may be part of another.
  constexpr std::size_t kShortest = 3;
  std::vector<std::pair<std::string_view, std::string_view>> all(originals_.begin(), originals_.end());
  std::ranges::sort(all, std::greater(), [](const auto& pair) { return std::pair(pair.first.size(), pair.first); });
  for (const auto& [original, by] : all)
    if (original.size() >= kShortest)
      replace_word(sentence, original, by);
    else
      replace_word(sentence, fmt::format("\"{}\"", original), fmt::format("\"{}\"", by));
  return with_moved_dates(sentence);
}

// "20260301", "2026-03-01 10:15:00": digits that are no part of a longer number or UID.
std::string Pseudonyms::with_moved_dates(const std::string& sentence) const {
  static const std::regex written(
      "(^|[^0-9A-Za-z.+-])((?:19|20)[0-9]{6}|(?:19|20)[0-9]{2}([.-])[0-9]{2}\\3[0-9]{2})(?![0-9A-SU-Za-z]|[.-][0-9])");
  std::string moved;
  auto rest = sentence.begin();
  for (std::sregex_iterator found(sentence.begin(), sentence.end(), written), end; found != end; ++found) {
    const std::string to = date(found->str(2));
    moved.append(rest, (*found)[2].first).append(to.empty() ? found->str(2) : to);
    rest = (*found)[2].second;
  }
  return moved.append(rest, sentence.end());
}

}  // namespace isoshift
