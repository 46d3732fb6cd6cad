#pragma once
// What one mistake explains an outlier: a shift with a wrong sign, with exchanged axes, of another session, or one that
// was not applied.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "workflow/audit_setup/audited_session.h"
#include "workflow/audit_setup/differences.h"

namespace isoshift {

// In words. A mistake explains a session if the used shift lies within the threshold of `found` on all axes once the
// mistake is made with the shift that the other sessions let expect. Several mistakes are named if their likelihoods
// differ by less than 20 to 1. `sessions` are those from which `found` was made, in its order.
std::string explanation_of(std::size_t outlier, std::span<const AuditedSession* const> sessions,
                           const DifferencesFound& found);

}  // namespace isoshift
