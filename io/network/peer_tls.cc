#include "io/network/peer_tls.h"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <array>
#include <filesystem>
#include <memory>
#include <string_view>

#include "base/sha256.h"
#include "io/network/dicom_send.h"

namespace isoshift {
namespace {

// Whom a certificate names: "CN = record, DNS:record.example.org".
std::string names_in(X509* certificate) {
  const std::unique_ptr<BIO, decltype(&BIO_free_all)> text(BIO_new(BIO_s_mem()), BIO_free_all);
  X509_NAME_print_ex(text.get(), X509_get_subject_name(certificate), 0, XN_FLAG_ONELINE);
  const int at = X509_get_ext_by_NID(certificate, NID_subject_alt_name, -1);
  if (at >= 0) {
    BIO_puts(text.get(), ", ");
    X509V3_EXT_print(text.get(), X509_get_ext(certificate, at), 0, 0);
  }
  char* bytes = nullptr;
  const long size = BIO_get_mem_data(text.get(), &bytes);
  return {bytes, static_cast<std::size_t>(size)};
}

std::string fingerprint_of(X509* certificate) {
  unsigned char* bytes = nullptr;
  const int size = i2d_X509(certificate, &bytes);
  if (size < 0) return "";
  std::string fingerprint = sha256_of({reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(size)});
  OPENSSL_free(bytes);
  return fingerprint;
}

}  // namespace

PeerTls::PeerTls(const DicomPeer& peer) : peer_(peer), layer_(NET_REQUESTOR, nullptr, OFTrue) {
  SSL_CTX* context = layer_.getNativeHandle();
  if (context == nullptr) throw PeerError("TLS is not available");
  const auto require = [&](bool is_done, const std::filesystem::path& file, const char* expected) {
    if (is_done) return;
    const char* reason = ERR_reason_error_string(ERR_peek_last_error());
    const std::string why = reason != nullptr ? reason : "it cannot be read";
    ERR_clear_error();
    throw PeerError(fmt::format("peer {}: {}: expected {}: {}", peer.name, file.string(), expected, why));
  };
  const DicomPeer::Tls& tls = *peer.tls;
  layer_.setPrivateKeyPasswd("");  // else OpenSSL asks on the terminal
  require(SSL_CTX_load_verify_locations(context, tls.ca.c_str(), nullptr) == 1, tls.ca, "a certificate (PEM)");
  require(SSL_CTX_use_certificate_chain_file(context, tls.certificate.c_str()) == 1, tls.certificate,
          "a certificate (PEM)");
  require(SSL_CTX_use_PrivateKey_file(context, tls.key.c_str(), SSL_FILETYPE_PEM) == 1, tls.key,
          "the key of the certificate (PEM), without a passphrase");
  if (layer_.setTLSProfile(TSP_Profile_BCP195_ND).bad() || layer_.activateCipherSuites().bad())
    throw PeerError("TLS as BCP 195 has it is not available");
  layer_.setCertificateVerification(DCV_requireCertificate);
  if (tls.fingerprint.empty()) expect_host();
  SSL_CTX_set_cert_verify_callback(context, check, this);
}

// A number is looked for among the certificate's IP addresses, a name among its DNS names; where it has no DNS names,
// in its subject (RFC 6125 6.4).
void PeerTls::expect_host() {
  X509_VERIFY_PARAM* expected = SSL_CTX_get0_param(layer_.getNativeHandle());
  X509_VERIFY_PARAM_set_hostflags(expected, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
  if (X509_VERIFY_PARAM_set1_ip_asc(expected, peer_.host.c_str()) == 1) return;
  ERR_clear_error();
  if (X509_VERIFY_PARAM_set1_host(expected, peer_.host.c_str(), 0) != 1)
    throw PeerError(fmt::format("peer {}: host {}: is not a name that a certificate can have", peer_.name, peer_.host));
}

int PeerTls::check(X509_STORE_CTX* presented, void* self) {
  PeerTls& tls = *static_cast<PeerTls*>(self);
  const DicomPeer& peer = tls.peer_;
  X509* certificate = X509_STORE_CTX_get0_cert(presented);
  const bool is_valid = X509_verify_cert(presented) == 1;
  const int error = X509_STORE_CTX_get_error(presented);
  if (is_valid && peer.tls->fingerprint.empty()) return 1;
  const std::string fingerprint = fingerprint_of(certificate);
  if (is_valid && fingerprint == peer.tls->fingerprint) return 1;
  const std::string found = fmt::format("peer {}: {}:{} presents the certificate of {} (SHA-256 {})", peer.name,
                                        peer.host, peer.port, names_in(certificate), fingerprint);
  if (is_valid) {
    X509_STORE_CTX_set_error(presented, X509_V_ERR_APPLICATION_VERIFICATION);
    tls.refusal_ = fmt::format("{}, expected the certificate with fingerprint {}", found, peer.tls->fingerprint);
  } else if (error == X509_V_ERR_HOSTNAME_MISMATCH || error == X509_V_ERR_IP_ADDRESS_MISMATCH) {
    tls.refusal_ = fmt::format(
        "{}, expected a certificate of {}. If this is the peer, name it as its certificate does "
        "(host), or pin its certificate (fingerprint)",
        found, peer.host);
  } else {
    tls.refusal_ = fmt::format("{}, expected one that {} vouches for: {}", found, peer.tls->ca.string(),
                               X509_verify_cert_error_string(error));
  }
  return 0;
}

}  // namespace isoshift
