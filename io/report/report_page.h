#pragma once
// The texts and rounded numbers of a report. They are made once, so that all formats say the same.

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "setup/shown_shift.h"

namespace isoshift {

inline constexpr const char* kNotDetermined = "not determined";
inline constexpr const char* kBent = "Bent";  // the row that says what moved against the target

// One rounded number with its name. `value` is "not determined" if the number is not determined.
struct Quantity {
  std::string name;        // "Lateral"
  std::string value;       // "-4.3"
  std::string unit;        // "mm"
  std::string plus_minus;  // two sigma, "0.2"; empty where unknown
  std::string words;       // "to the left, seen facing the gantry"; empty for 0
  bool is_number = true;
};

inline constexpr const char* kDisclaimer = "Not for clinical use unless validated by the site.";

struct ReportPage {
  struct Row {
    std::string name, value;
  };
  struct Section {
    std::string title;
    std::vector<Row> rows;
  };
  // The shift in the scale of a vendor's display.
  struct Display {
    std::string title;  // "Varian IEC scale, validated by J. Doe on 2026-03-01"
    std::vector<Quantity> rows;
  };
  struct LeftOver {
    std::string at;
    std::array<std::string, 3> components;  // x, y, z, IEC fixed
    std::string length, unit;
  };

  std::string title, program, disclaimer;
  std::vector<Row> who;
  Verdict verdict = Verdict::kRejected;
  std::string verdict_words;         // "ACCEPTED: isoshift's checks passed"
  std::vector<std::string> reasons;  // why it is not accepted
  Action action = Action::kUnset;
  std::string action_words;
  std::vector<std::string> action_reasons;
  bool withheld = false;
  std::vector<Quantity> couch;  // lateral, longitudinal, vertical, yaw, pitch, roll, as far as this couch can move
  std::string couch_order;      // "Translate, then rotate ..."
  std::string couch_target;     // the table angles after the move
  std::vector<Quantity> setup_error;  // x, y, z, about x, y, z
  std::string setup_error_length;
  std::optional<Display> display;
  std::string left_over_words;  // empty: there is no remaining error
  std::vector<LeftOver> left_over;
  std::string picture_words;  // what lines and colors in the pictures mean
  std::vector<std::string> conventions;
  std::vector<std::string> warnings, overrides, left_aside;
  std::vector<Section> details;  // geometry as understood, stages, checks, hashes, versions
};
ReportPage report_page(const SetupResult& report);

std::string upper_case(std::string_view text);  // of ASCII letters

// A DICOM person name (PN) for people: "Family Given (ideographic)".
std::string name_for_people(const std::string& person_name);

}  // namespace isoshift
