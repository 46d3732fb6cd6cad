#pragma once
// Long runs that end in good order when they are interrupted: SIGINT or SIGTERM asks them to, a second one ends the
// program at once.

namespace isoshift {

// While one exists, the first signal asks instead of ending the program. Not more than one at a time.
class GracefulEnd {
 public:
  GracefulEnd();
  ~GracefulEnd();
  GracefulEnd(const GracefulEnd&) = delete;
  GracefulEnd& operator=(const GracefulEnd&) = delete;

  bool is_asked_for() const;
};

// For the thread that waits for signals: asks, and returns whether anybody listens who had not been asked before.
bool ask_for_end();

}  // namespace isoshift
