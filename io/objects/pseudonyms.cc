#include "io/objects/pseudonyms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <random>
#include <vector>

#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

bool is_of_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; }

std::string in_small_letters(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
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

std::string Pseudonyms::uid(const std::string& original) {
  std::string& known = uids_[original];
  if (known.empty()) known = new_uid();
  stands_for(original, known);
  return known;
}

std::string Pseudonyms::text(std::string_view kind, const std::string& original) {
  auto& of_kind = texts_[std::string(kind)];
  const std::size_t number = of_kind.size() + 1;
  std::string& known = of_kind[in_small_letters(original)];
  if (known.empty()) known = fmt::format("{} {}", kind, number);
  stands_for(original, known);
  return known;
}

std::string Pseudonyms::patient_id(const std::string& original, const std::string& issuer) {
  std::string known = text("ANON", original + "\\" + issuer);
  stands_for(original, known);
  stands_for(issuer, known);
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
  if (!found.ok()) return "";
  const std::chrono::year_month_day moved(std::chrono::sys_days(found) - std::chrono::days(days_));
  return fmt::format("{:04}{}{:02}{}{:02}{}", static_cast<int>(moved.year()), separator,
                     static_cast<unsigned>(moved.month()), separator, static_cast<unsigned>(moved.day()),
                     original.substr(end));
}

std::string Pseudonyms::in(std::string sentence) const {
  // The longest first: one may be part of another.
  std::vector<std::pair<std::string_view, std::string_view>> all(originals_.begin(), originals_.end());
  std::ranges::stable_sort(all, std::greater(), [](const auto& pair) { return pair.first.size(); });
  for (const auto& [original, by] : all)
    if (!original.empty()) replace_word(sentence, original, by);
  return sentence;
}

}  // namespace isoshift
