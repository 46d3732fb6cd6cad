#pragma once
// What the writer and the reader of result.json share.

#include <array>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "setup/identity.h"
#include "setup/setup_result.h"

namespace isoshift {

inline constexpr std::array<std::pair<const char*, std::string Identity::*>, 12> kIdentity = {{
    {"character_set", &Identity::character_set},
    {"id", &Identity::patient_id},
    {"id_issuer", &Identity::patient_id_issuer},
    {"name", &Identity::patient_name},
    {"birth_date", &Identity::patient_birth_date},
    {"sex", &Identity::patient_sex},
    {"study_instance_uid", &Identity::study_instance_uid},
    {"study_date", &Identity::study_date},
    {"study_time", &Identity::study_time},
    {"study_id", &Identity::study_id},
    {"accession_number", &Identity::accession_number},
    {"referring_physician", &Identity::referring_physician},
}};

// Names of angles end with their unit: radians inside the program, degrees in files.
inline constexpr std::string_view kRad = "_rad";
inline constexpr std::string_view kDeg = "_deg";

// Throws Error, naming both, if fields of a result.json contradict each other. `result`: what was read from the file.
void check_is_consistent(const nlohmann::ordered_json& file, const SetupResult& result);

}  // namespace isoshift
