#pragma once
// What isoshift room watch is doing, in engine.json of the results tree: for whoever shows it. The age of the file says
// whether the engine runs.

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "workflow/room/clock.h"
#include "workflow/room/waiting_session.h"

namespace isoshift {

struct EngineState {
  std::vector<WaitingSession> waiting;
  std::vector<WaitingSession> chosen;  // with a result that rests on a person's choice, which can be made again
  std::vector<std::string> troubles;   // that may be over in the next round

  bool operator==(const EngineState&) const = default;
};

// A running engine gives a sign of life as often as the first; it counts as stopped if the last sign is older than the
// second.
inline constexpr std::chrono::seconds kEngineSigns(2), kEngineIsStopped(10);

// The engine's side.
class EngineFile {
 public:
  EngineFile(const std::filesystem::path& results, const Clock& clock);

  // Writes the state if it has changed, else gives a sign of life when that is due.
  void update(const EngineState& state);

 private:
  std::filesystem::path path_;
  const Clock& clock_;
  std::optional<EngineState> written_;
  Clock::Time signed_at_;
};

struct EngineSeen {
  EngineState state;
  std::chrono::seconds age{0};                                                     // since it was written
  bool runs() const { return age < kEngineIsStopped && age > -kEngineIsStopped; }  // clocks may be set back
};
// Nothing if no engine has ever run there. Throws Error for a file that an engine has not written.
std::optional<EngineSeen> read_engine_state(const std::filesystem::path& results, std::filesystem::file_time_type now);

}  // namespace isoshift
