#pragma once
// Messages from a program to the child processes in which it registers, and their answers.

#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "io/study/study_files.h"
#include "setup/verdict.h"

namespace isoshift {

// One registration that a child shall do.
struct RegistrationOrder {
  StudyParts parts;
  std::vector<std::string> flags;  // of isoshift register, without those that name parts, or the output
  std::filesystem::path site;      // site file; empty: that of the flags, if any
  std::string anatomy;             // empty: that of the flags, if any
  std::filesystem::path start;     // a pose (start_pose.h); empty: the planned one
  bool is_searched = true;         // false: the start is only judged
  std::filesystem::path output;
  bool tells_progress = false;
  int at_a_time = 1;  // orders that are worked on at the same time, by children that share the cores
  int worker = 0;     // which of these children works on it: several GPUs are shared out by this number

  bool operator==(const RegistrationOrder&) const = default;
};

// A child says Ready once, and then Ended or Failed in answer to every order; before that Progressed, if the order says
// so.
struct Ready {
  bool operator==(const Ready&) const = default;
};
struct Progressed {
  std::string step;
  double share = 0.0;  // of the step, 0 to 1

  bool operator==(const Progressed&) const = default;
};
struct Ended {
  Verdict verdict = Verdict::kRejected;      // of the result, which is in the output folder
  std::map<std::string, std::string> files;  // SHA-256 by name, of all files that the child wrote there

  bool operator==(const Ended&) const = default;
};
struct Failed {
  std::string why;
  bool is_of_disk = false;  // WriteError: the same order may succeed later

  bool operator==(const Failed&) const = default;
};
using RegistrationMessage = std::variant<Ready, Progressed, Ended, Failed>;

std::string to_line(const RegistrationOrder& order);
std::string to_line(const RegistrationMessage& message);

// Throws Error for a message that is damaged or unknown. `name` is what the Error calls it: "the message of a worker".
RegistrationOrder registration_order_from(const std::string& line, const std::string& name);
RegistrationMessage registration_message_from(const std::string& line, const std::string& name);

}  // namespace isoshift
