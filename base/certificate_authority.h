#pragma once
// Certificates for examples and trials: X.509 v3 with keys on the curve P-256, signed by an authority of their own.

#include <memory>
#include <string>
#include <vector>

struct evp_pkey_st;  // of OpenSSL
struct x509_st;

namespace isoshift {

// Of a certificate and its private key.
struct CertificatePem {
  std::string certificate, key;
};

class CertificateAuthority {
 public:
  // Valid from now for `days`. Throws Error if OpenSSL fails, here and below.
  CertificateAuthority(const std::string& name, int days);

  // For a server and client. `hosts`: DNS names, and addresses as "IP:127.0.0.1".
  CertificatePem issue(const std::string& name, const std::vector<std::string>& hosts) const;
  std::string certificate() const;  // PEM. Its key is nowhere but here

 private:
  int days_;
  std::shared_ptr<evp_pkey_st> key_;
  std::shared_ptr<x509_st> certificate_;
};

}  // namespace isoshift
