#pragma once
// Discs along a spine as the teeth of a comb: evenly spaced, their distance changing slowly.

#include <vector>

namespace isoshift {

// Mean HU on planes 1 mm apart along the spine, from the feet to the head: for each way that the planes lean, a
// profile. All are equally long; NaN outside the CT.
using LeaningProfiles = std::vector<std::vector<float>>;

struct CombTooth {
  int at = 0;            // mm along the profiles
  int lean = 0;          // the profile that shows it best
  double dip_hu = 0.0;   // by how much it is darker than what lies beside it
  bool is_dark = false;  // discs are darker than vertebrae; else, in brittle bone, the end plates are brighter
};

// The discs between `first` and `end` mm, from the feet to the head; fewer than two if there is no comb. `expected_mm`:
// how far apart they should be at each place of the profiles, to within about 20 %; 0 where that is not known.
std::vector<CombTooth> find_discs(const LeaningProfiles& profiles, int first, int end,
                                  const std::vector<double>& expected_mm);

}  // namespace isoshift
