#include "workflow/room/engine_state.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"

namespace isoshift {
namespace {

constexpr const char* kFile = "engine.json";

nlohmann::ordered_json json_of(const std::vector<WaitingSession>& sessions) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const WaitingSession& one : sessions)
    json.push_back({{"session", one.name},
                    {"patient_id", one.patient_id},
                    {"acquired", one.acquired},
                    {"why", one.why},
                    {"has_failed", one.has_failed},
                    {"options", isoshift::json_of(one.options)}});
  return json;
}

std::vector<WaitingSession> sessions_from(const nlohmann::json& json) {
  std::vector<WaitingSession> sessions;
  for (const nlohmann::json& one : json)
    sessions.push_back({.name = one.at("session"),
                        .patient_id = one.at("patient_id"),
                        .acquired = one.at("acquired"),
                        .why = one.at("why"),
                        .has_failed = one.at("has_failed"),
                        .options = session_options_from(one.at("options"))});
  return sessions;
}

}  // namespace

EngineFile::EngineFile(const std::filesystem::path& results, const Clock& clock)
    : path_(results / kFile), clock_(clock) {}

void EngineFile::update(const EngineState& state) {
  const Clock::Time now = clock_.now();
  if (written_ == state && now - signed_at_ < kEngineSigns) return;
  std::error_code missing;  // on a full disk the state cannot be written, and the engine runs all the same
  std::filesystem::last_write_time(path_, clock_.file_time(), missing);
  if (written_ != state || missing) {
    const nlohmann::ordered_json json = {{"schema", 1},
                                         {"waiting", json_of(state.waiting)},
                                         {"chosen", json_of(state.chosen)},
                                         {"troubles", state.troubles}};
    replace_text(path_, json_text(json));
    std::filesystem::last_write_time(path_, clock_.file_time());
    written_ = state;
  }
  signed_at_ = now;
}

std::optional<EngineSeen> read_engine_state(const std::filesystem::path& results, std::filesystem::file_time_type now) {
  const std::filesystem::path file = results / kFile;
  std::error_code missing;
  const auto written = std::filesystem::last_write_time(file, missing);
  if (missing) return std::nullopt;
  const nlohmann::json json = read_json_file(file).json;
  EngineSeen seen{.age = std::chrono::duration_cast<std::chrono::seconds>(now - written)};
  try {
    seen.state.troubles = json.at("troubles");
    seen.state.waiting = sessions_from(json.at("waiting"));
    seen.state.chosen = sessions_from(json.at("chosen"));
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: is not what isoshift room watch writes: {}", file.string(), error.what()));
  }
  return seen;
}

}  // namespace isoshift
