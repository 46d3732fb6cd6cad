#include "base/certificate_authority.h"

#include <fmt/format.h>
#include <openssl/ec.h>
#include <openssl/evp.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <array>

#include "base/error.h"
#include "base/pem.h"

namespace isoshift {
namespace {

using Key = std::shared_ptr<EVP_PKEY>;
using Certificate = std::shared_ptr<X509>;

void require(bool is_done) {
  if (!is_done) throw Error("OpenSSL cannot make a certificate");
}

Key new_key() {
  const Key key(EVP_EC_gen("P-256"), EVP_PKEY_free);
  require(key != nullptr);
  return key;
}

void add_extension(const Certificate& certificate, const Certificate& issuer, int nid, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, issuer.get(), certificate.get(), nullptr, nullptr, 0);
  const std::unique_ptr<X509_EXTENSION, void (*)(X509_EXTENSION*)> extension(
      X509V3_EXT_conf_nid(nullptr, &context, nid, value.c_str()), X509_EXTENSION_free);
  require(extension && X509_add_ext(certificate.get(), extension.get(), -1) == 1);
}

// Without extensions and not signed. `issuer`: null for one that is its own.
Certificate new_certificate(const std::string& name, const Key& key, int days, const Certificate& issuer) {
  constexpr long kVersion3 = 2;  // NOLINT(google-runtime-int)
  std::array<unsigned char, 16> serial{};
  const Certificate certificate(X509_new(), X509_free);
  require(certificate && RAND_bytes(serial.data(), static_cast<int>(serial.size())) == 1);
  serial[0] &= 0x7f;  // positive
  const std::unique_ptr<BIGNUM, void (*)(BIGNUM*)> number(
      BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr), BN_free);
  X509_NAME* subject = X509_get_subject_name(certificate.get());
  require(number && BN_to_ASN1_INTEGER(number.get(), X509_get_serialNumber(certificate.get())) != nullptr &&
          X509_set_version(certificate.get(), kVersion3) == 1 && X509_set_pubkey(certificate.get(), key.get()) == 1 &&
          X509_gmtime_adj(X509_getm_notBefore(certificate.get()), 0) != nullptr &&
          X509_time_adj_ex(X509_getm_notAfter(certificate.get()), days, 0, nullptr) != nullptr &&
          X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_UTF8, reinterpret_cast<const unsigned char*>(name.c_str()),
                                     -1, -1, 0) == 1 &&
          X509_set_issuer_name(certificate.get(), issuer ? X509_get_subject_name(issuer.get()) : subject) == 1);
  return certificate;
}

// "DNS:localhost,IP:127.0.0.1".
std::string alternative_names(const std::vector<std::string>& hosts) {
  std::string names;
  for (const std::string& host : hosts)
    names += fmt::format("{}{}{}", names.empty() ? "" : ",", host.starts_with("IP:") ? "" : "DNS:", host);
  return names;
}

}  // namespace

CertificateAuthority::CertificateAuthority(const std::string& name, int days)
    : days_(days), key_(new_key()), certificate_(new_certificate(name, key_, days, nullptr)) {
  add_extension(certificate_, certificate_, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_extension(certificate_, certificate_, NID_key_usage, "critical,keyCertSign,cRLSign");
  add_extension(certificate_, certificate_, NID_subject_key_identifier, "hash");
  require(X509_sign(certificate_.get(), key_.get(), EVP_sha256()) != 0);
}

CertificatePem CertificateAuthority::issue(const std::string& name, const std::vector<std::string>& hosts) const {
  const Key key = new_key();
  const Certificate certificate = new_certificate(name, key, days_, certificate_);
  add_extension(certificate, certificate_, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(certificate, certificate_, NID_key_usage, "critical,digitalSignature");
  add_extension(certificate, certificate_, NID_ext_key_usage, "serverAuth,clientAuth");
  add_extension(certificate, certificate_, NID_authority_key_identifier, "keyid");
  add_extension(certificate, certificate_, NID_subject_alt_name, alternative_names(hosts));
  require(X509_sign(certificate.get(), key_.get(), EVP_sha256()) != 0);
  return {.certificate = pem_of(certificate.get()), .key = pem_of(key.get())};
}

std::string CertificateAuthority::certificate() const { return pem_of(certificate_.get()); }

}  // namespace isoshift
