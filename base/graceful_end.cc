#include "base/graceful_end.h"

#include <atomic>

namespace isoshift {
namespace {

enum class State { kNobodyListens, kListens, kAsked };
std::atomic<State> state = State::kNobodyListens;

}  // namespace

GracefulEnd::GracefulEnd() { state = State::kListens; }
GracefulEnd::~GracefulEnd() { state = State::kNobodyListens; }

bool GracefulEnd::is_asked_for() const { return state == State::kAsked; }

bool ask_for_end() {
  State listens = State::kListens;
  return state.compare_exchange_strong(listens, State::kAsked);
}

}  // namespace isoshift
