#pragma once
// Certificates for one test, made by OpenSSL, and servers on the loopback device that use them.

#include <cstdint>
#include <filesystem>
#include <string>

namespace isoshift {

class Certificates {
 public:
  // In this folder: NAME.pem and NAME.key of each, and ca.pem, ca.key of the authority that signs them.
  explicit Certificates(std::filesystem::path folder);

  static bool can_be_made();  // OpenSSL's program is there

  void make_authority(const std::string& name) const;
  // `names`: a subjectAltName ("DNS:record.example.org,IP:10.0.0.5"); empty: none.
  void make(const std::string& name, const std::string& subject, const std::string& names,
            const std::string& authority = "ca") const;
  std::string fingerprint(const std::string& name) const;
  void openssl(const std::string& words) const;

 private:
  std::filesystem::path folder_;
};

std::uint16_t free_port();

// Returns when something listens on the port; after 10 s in any case.
void wait_for_listener(std::uint16_t port);

}  // namespace isoshift
