#pragma once
// Registers in the place of another process, so that a crash of a registration does not end that process.

#include <functional>
#include <string>
#include <vector>

#include "base/channel.h"
#include "workflow/register/register_study.h"

namespace isoshift {

// Answers the orders of the parent (registration_messages.h), one after the other, until there are no more. Orders of
// one CT share what was read and built of it. `options_from` turns the flags of isoshift register into options.
void serve_registrations(Channel& parent,
                         const std::function<RegisterOptions(const std::vector<std::string>& flags)>& options_from);

}  // namespace isoshift
