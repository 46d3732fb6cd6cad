#pragma once
// What a site knows about a machine and the machine's files lack or say wrongly: a JSON file (docs/machine-profile.md).

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/signing_key.h"
#include "io/dicom/rt_image.h"

namespace isoshift {

struct MachineProfile {
  // For the images whose attributes are these.
  struct Rule {
    std::map<std::string, std::string, std::less<>> where;  // keyword of kEquipmentAttributes to value; all must match
    std::optional<double> gantry_angle_offset_deg;          // source angle = GantryAngle + this; nothing: not told
    bool spacing_at_axis = false;       // spacing and position count in the plane of the axis, not of the receptor
    std::optional<KnownImager> imager;  // what is known of its errors
    RtImageSwitches switches;
    std::optional<Eigen::Matrix<double, 3, 4>> pixel_from_room;  // for images of this size
    int columns = 0, rows = 0;
  };

  std::filesystem::path path;
  std::string name;
  std::string sha256;  // of the file, hexadecimal
  std::vector<Rule> rules;
};

// With the public half of a key, FILE.sig must hold the signature of FILE by that key. Throws Error naming the file,
// the place in it and what is expected there; for a signature that is missing or wrong; and without a key for a profile
// that corrects an imager.
MachineProfile read_machine_profile(const std::filesystem::path& path, const std::optional<VerifyingKey>& key = {});

// Applies the first rule that fits the image, and notes each change as an override. If a rule needs SAD or SID and the
// command line will replace them afterwards, the values of the command line are used. Throws Error if no rule fits.
RtImage with_machine(RtImage image, const MachineProfile& profile, const RtImageSwitches& command_line, Notes& notes);

}  // namespace isoshift
