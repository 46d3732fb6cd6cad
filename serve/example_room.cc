#include "serve/example_room.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/certificate_authority.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/random_word.h"
#include "base/signing_key.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kDays = 365;
// Those of Debian's own Orthanc (8042, 4242) stay free.
constexpr int kSourceHttp = 8142, kSourceDicom = 4142, kRecordHttp = 8143, kRecordDicom = 4143, kScreen = 8443;

constexpr const char* kReadMe =
    R"(A treatment room to try, on this computer: two Orthanc servers, isoshift room watch and isoshift room serve.

  source   the room's server: CT, plan and X-rays arrive here by DICOM ({source_dicom}), watch reads them by HTTP ({source_http})
  record   the peer that receives released results by DICOM with TLS ({record_dicom}), as an archive would
  watch    registers the X-rays that arrive at source, and holds the results
  serve    the room's screen, where results are looked at and released: https://localhost:{screen}

Start each of the four in a terminal of its own, in this folder (Debian: apt install orthanc dcmtk curl):

  /usr/sbin/Orthanc source.json
  /usr/sbin/Orthanc record.json
  isoshift room watch watch.json
  isoshift room serve serve.json

Make a patient, whose X-rays show a setup error, and send all of it to source:

  isoshift phantom -o study
  storescu +sd +r +sp '*.dcm' -aec SOURCE localhost {source_dicom} study

About 10 s after the last file the session is registered. Open https://localhost:{screen}. The browser does not know the
authority of its certificate, ca.pem: import it, or accept the warning for this trial. Sign in as {user}, with the
password of this computer. Open the session, look at its report, and release it. Without a browser:

  isoshift room release SESSION --by "J. Doe" --watch watch.json

watch sends the registration object and the report to record. What arrived there:

  curl -u isoshift:$(cat record.password) http://localhost:{record_http}/instances

What is what:

  site.json, watch.json, serve.json     describe the room: docs/site-file.md, docs/commands/watch.md, serve.md
  source.json, record.json              configure the two Orthanc servers
  ca.pem                                the authority that signed the certificates here. Its key was thrown away
  serve, record, isoshift .pem, .key    certificates for localhost, valid for {days} days, of the screen, of record, and of watch
                                        as it sends to record
  release.key                           signs releases and decisions
  *.password                            of the user isoshift of each Orthanc server

For a real room, replace the certificates and passwords, and the names, hosts and ports in the files. Both DICOM ports
are open to the network: that of source to everybody, as imagers need it, that of record to who shows a certificate of
ca.pem. HTTP and the screen listen to this computer only.
)";

class Files {
 public:
  explicit Files(const fs::path& folder) : folder_(folder) {
    fs::permissions(folder, fs::perms::owner_all);  // before there is anything to read
  }
  void write(const std::string& name, const std::string& text) const {
    write_text(folder_ / name, text);
    fs::permissions(folder_ / name, fs::perms::owner_read | fs::perms::owner_write);
  }
  void write(const std::string& name, const Json& json) const { write(name, json_text(json)); }

 private:
  const fs::path& folder_;
};

Json orthanc(const std::string& name, const std::string& title, int http, int dicom, const std::string& password) {
  return {{"Name", name},
          {"StorageDirectory", name + "-storage"},
          {"IndexDirectory", name + "-storage"},
          {"HttpPort", http},
          {"RemoteAccessAllowed", false},
          {"AuthenticationEnabled", true},
          {"RegisteredUsers", {{"isoshift", password}}},
          {"DicomAet", title},
          {"DicomPort", dicom},
          {"DicomCheckCalledAet", true},
          {"DicomAlwaysAllowStore", true}};
}

Json site_json() {
  return {{"site_file", 1},
          {"name", "Trial room"},
          {"action_levels", {{"default", {{"translation_mm", 3}, {"rotation_deg", 2}}}}},
          {"couch", {{"degrees_of_freedom", 6}}},
          {"sessions", {{"views", 2}, {"quiet_s", 5}}},
          {"release", {{"rule", "manual"}}}};
}

Json watch_json() {
  return {{"watch_file", 1},
          {"orthanc",
           {{"url", fmt::format("http://localhost:{}", kSourceHttp)},
            {"user", "isoshift"},
            {"password_file", "source.password"}}},
          {"results", "results"},
          {"site", "site.json"},
          {"signing_key", "release.key"},
          {"peers",
           {{{"name", "record"},
             {"host", "localhost"},
             {"port", kRecordDicom},
             {"called_aet", "RECORD"},
             {"calling_aet", "ISOSHIFT"},
             {"tls", {{"ca", "ca.pem"}, {"certificate", "isoshift.pem"}, {"key", "isoshift.key"}}}}}}};
}

Json serve_json(const std::string& user) {
  return {{"serve_file", 1},
          {"watch", "watch.json"},
          {"address", "127.0.0.1"},
          {"port", kScreen},
          {"tls", {{"certificate", "serve.pem"}, {"key", "serve.key"}}},
          {"pam_service", "login"},
          {"roles", {{user, {"view", "register", "release"}}}}};
}

std::string read_me(const std::string& user) {
  return fmt::format(kReadMe, fmt::arg("source_dicom", kSourceDicom), fmt::arg("source_http", kSourceHttp),
                     fmt::arg("record_dicom", kRecordDicom), fmt::arg("record_http", kRecordHttp),
                     fmt::arg("screen", kScreen), fmt::arg("user", user), fmt::arg("days", kDays));
}

}  // namespace

void write_example_room(const fs::path& folder, const std::string& user) {
  OutputFolder output(folder, false);
  const Files files(output.path());
  const CertificateAuthority authority("isoshift trial room", kDays);
  files.write("ca.pem", authority.certificate());
  for (const char* name : {"serve", "record", "isoshift"}) {
    const CertificatePem pem = authority.issue(name, {"localhost", "IP:127.0.0.1"});
    files.write(fmt::format("{}.pem", name), pem.certificate);
    files.write(fmt::format("{}.key", name), pem.key);
  }
  const std::string of_source = random_word(), of_record = random_word();
  const Json source = orthanc("source", "SOURCE", kSourceHttp, kSourceDicom, of_source);
  Json record = orthanc("record", "RECORD", kRecordHttp, kRecordDicom, of_record);
  record["DicomTlsEnabled"] = true;
  record["DicomTlsCertificate"] = "record.pem";
  record["DicomTlsPrivateKey"] = "record.key";
  record["DicomTlsTrustedCertificates"] = "ca.pem";
  files.write("source.json", source);
  files.write("record.json", record);
  files.write("source.password", of_source + "\n");
  files.write("record.password", of_record + "\n");
  files.write("release.key", new_signing_key());
  files.write("site.json", site_json());
  files.write("watch.json", watch_json());
  files.write("serve.json", serve_json(user));
  files.write("README.txt", read_me(user));
  output.commit();
}

}  // namespace isoshift
