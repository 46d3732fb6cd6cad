#pragma once

#include "io/objects/pseudonyms.h"
#include "setup/setup_result.h"

namespace isoshift {

// A result without what tells who the patient is, where and by whom the patient was treated. Numbers, pictures and
// hashes of files stay; of its messages those that name a file do not.
SetupResult deidentified(SetupResult result, Pseudonyms& pseudonyms);

}  // namespace isoshift
