#include "tests/support/registered_session.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/report/result_folder.h"
#include "io/study/session_files.h"

namespace isoshift {

std::string write_registering(const ResultsTree& tree, const std::vector<std::string>& xrays,
                              const std::string& verdict) {
  std::string name = session_name(std::set(xrays.begin(), xrays.end()));
  const std::filesystem::path folder = tree.registering(name);
  std::filesystem::create_directories(folder);
  nlohmann::json views = nlohmann::json::array();
  for (const std::string& xray : xrays) views.push_back({{"sop_instance_uid", xray}});
  write_text(folder / kResultFile, nlohmann::json{{"verdict", verdict}, {"views", views}}.dump());
  write_text(folder / "report.dcm", "report of " + name);
  if (verdict == "accepted") write_text(folder / kRegistrationFile, "registration of " + name);
  return name;
}

std::string register_session(ResultsTree& tree, const std::vector<std::string>& xrays, const std::string& verdict) {
  std::string name = write_registering(tree, xrays, verdict);
  tree.publish(name, sha256_of_folder(tree.registering(name)));
  return name;
}

}  // namespace isoshift
