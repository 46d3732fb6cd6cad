#pragma once
// Lets a long run end in good order when it is interrupted: the first SIGINT or SIGTERM asks the run to end, the second
// ends the program at once.

namespace isoshift {

// While an object of this class exists, the first signal does not end the program. Not more than one at a time.
class GracefulEnd {
 public:
  GracefulEnd();
  ~GracefulEnd();
  GracefulEnd(const GracefulEnd&) = delete;
  GracefulEnd& operator=(const GracefulEnd&) = delete;

  bool is_asked_for() const;
};

// For the thread that waits for signals: asks the run to end. Returns false if no run listens, or if one was asked
// before.
bool ask_for_end();

}  // namespace isoshift
