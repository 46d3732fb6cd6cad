#include <algorithm>
#include <charconv>
#include <chrono>

#include <fmt/format.h>

#include "io/dicom/rt_image.h"

namespace isoshift {
namespace {

// The digits of a DA or TM, without the separators that ACR-NEMA wrote ("10:59:00", "2026.03.01", PS3.5 6.2). Nothing
// for a text that is neither: a time that is half understood would be another time.
std::optional<std::string> digits_of(std::string_view text, char separator, std::size_t between) {
  std::string digits;
  for (std::size_t n = 0; n < text.size(); ++n) {
    if (text[n] == separator && digits.size() >= between && digits.size() % 2 == 0 && n + 1 < text.size()) continue;
    if (text[n] < '0' || text[n] > '9') return std::nullopt;
    digits += text[n];
  }
  return digits;
}

int number_in(const std::string& digits, std::size_t begin, std::size_t count) {
  int value = 0;
  std::from_chars(digits.data() + begin, digits.data() + begin + count, value);
  return value;
}

std::optional<std::string> acquisition_digits(const RtImage& image) {
  return image.acquisition_date ? date_digits(*image.acquisition_date) : std::nullopt;
}

std::optional<std::chrono::sys_days> day_of(const RtImage& image) {
  const auto date = acquisition_digits(image);
  if (!date) return std::nullopt;
  const std::chrono::year_month_day day(std::chrono::year(number_in(*date, 0, 4)),
                                        std::chrono::month(static_cast<unsigned>(number_in(*date, 4, 2))),
                                        std::chrono::day(static_cast<unsigned>(number_in(*date, 6, 2))));
  return day.ok() ? std::optional(std::chrono::sys_days(day)) : std::nullopt;
}

// "101500", without the fraction. A time without seconds (PS3.5 6.2) does not tell how far two X-rays are apart.
std::optional<std::string> time_digits(const RtImage& image) {
  if (!image.acquisition_time) return std::nullopt;
  auto digits = digits_of(image.acquisition_time->substr(0, image.acquisition_time->find('.')), ':', 2);
  if (!digits || digits->size() != 6) return std::nullopt;
  if (number_in(*digits, 0, 2) > 23 || number_in(*digits, 2, 2) > 59 || number_in(*digits, 4, 2) > 60)
    return std::nullopt;
  return digits;
}

// "+0130", from -1200 to +1400 (PS3.3 C.12.1.1.8).
std::optional<int> utc_offset_min(const std::string& text) {
  if (text.size() != 5 || (text[0] != '+' && text[0] != '-') || !digits_of(text.substr(1), ':', 4)) return std::nullopt;
  constexpr int kFarthestWestMin = -12 * 60, kFarthestEastMin = 14 * 60, kHourMin = 60;
  const int minutes = (text[0] == '-' ? -1 : 1) * (kHourMin * number_in(text, 1, 2) + number_in(text, 3, 2));
  if (number_in(text, 3, 2) >= kHourMin || minutes < kFarthestWestMin || minutes > kFarthestEastMin)
    return std::nullopt;
  return minutes;
}

}  // namespace

std::optional<std::string> date_digits(std::string_view written) {
  auto digits = digits_of(written, '.', 4);
  return digits && digits->size() == 8 ? digits : std::nullopt;
}

void read_acquisition_time(const DicomItem& dataset, RtImage& image) {
  std::string offset = dataset.text(DCM_TimezoneOffsetFromUTC).value_or("");
  image.acquisition_date = dataset.text(DCM_AcquisitionDate);
  image.acquisition_time = dataset.text(DCM_AcquisitionTime);
  if (const auto both = dataset.text(DCM_AcquisitionDateTime); both && both->size() > 8 && !image.acquisition_time) {
    const std::size_t end = std::min(both->find_first_of("+-"), both->size());
    image.acquisition_date = both->substr(0, 8);
    image.acquisition_time = both->substr(8, end - 8);
    if (end < both->size()) offset = both->substr(end);
  }
  // The date of an acquisition does not go with the time of an export.
  if (!image.acquisition_time) {
    image.acquisition_date = dataset.text(DCM_ContentDate);
    image.acquisition_time = dataset.text(DCM_ContentTime);
  }
  image.utc_offset_min = utc_offset_min(offset);
  if (!image.utc_offset_min) image.invalid_utc_offset = offset;
}

std::optional<double> acquisition_seconds(const RtImage& image) {
  const auto day = day_of(image);
  const auto time = time_digits(image);
  if (!day || !time) return std::nullopt;
  const double days = static_cast<double>(day->time_since_epoch().count());
  double fraction = 0.0;
  if (const auto point = image.acquisition_time->find('.'); point != std::string::npos) {
    const char *begin = image.acquisition_time->data() + point,
               *end = image.acquisition_time->data() + image.acquisition_time->size();
    if (std::from_chars(begin, end, fraction).ptr != end) return std::nullopt;
  }
  const double minutes =
      (days * 24 + number_in(*time, 0, 2)) * 60 + number_in(*time, 2, 2) - image.utc_offset_min.value_or(0);
  return minutes * 60 + number_in(*time, 4, 2) + fraction + image.frame_offset_s;
}

std::string why_time_is_unknown(const RtImage& image) {
  const auto why = [](const DcmTagKey& tag, const std::optional<std::string>& found, const char* expected) {
    return found ? fmt::format("{} is \"{}\", expected {}", described(tag), *found, expected)
                 : fmt::format("{} is missing", described(tag));
  };
  if (!image.acquisition_time || !time_digits(image)) return why(DCM_AcquisitionTime, image.acquisition_time, "HHMMSS");
  if (!day_of(image)) return why(DCM_AcquisitionDate, image.acquisition_date, "YYYYMMDD");
  return why(DCM_AcquisitionTime, image.acquisition_time, "HHMMSS.FFFFFF");
}

std::string acquired(const RtImage& image) {
  const auto date = acquisition_digits(image), time = time_digits(image);
  if (!date || !time) return "";
  return fmt::format("{}-{}-{} {}:{}:{}", date->substr(0, 4), date->substr(4, 2), date->substr(6, 2),
                     time->substr(0, 2), time->substr(2, 2), time->substr(4, 2));
}

std::string imager_label(const RtImage& image) { return image.label.substr(0, image.label.rfind('#')); }

}  // namespace isoshift
