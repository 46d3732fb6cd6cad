#include "base/pem.h"

#include <openssl/bio.h>
#include <openssl/pem.h>

#include <memory>

#include "base/error.h"

namespace isoshift {
namespace {

// `write`: writes into a BIO, and returns 1.
template <class Write>
std::string text_of(const Write& write) {
  const std::unique_ptr<BIO, int (*)(BIO*)> bio(BIO_new(BIO_s_mem()), BIO_free);
  if (!bio || write(bio.get()) != 1) throw Error("OpenSSL cannot write PEM");
  char* text = nullptr;
  const auto size = BIO_get_mem_data(bio.get(), &text);
  return {text, static_cast<std::size_t>(size)};
}

}  // namespace

std::string pem_of(const evp_pkey_st* private_key) {
  return text_of(
      [&](BIO* bio) { return PEM_write_bio_PKCS8PrivateKey(bio, private_key, nullptr, nullptr, 0, nullptr, nullptr); });
}

std::string pem_of(const x509_st* certificate) {
  return text_of([&](BIO* bio) { return PEM_write_bio_X509(bio, certificate); });
}

}  // namespace isoshift
