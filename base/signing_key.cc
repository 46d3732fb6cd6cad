#include "base/signing_key.h"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <openssl/pem.h>

#include <array>

#include "base/error.h"
#include "base/pem.h"
#include "base/secret_file.h"

namespace isoshift {
namespace {

constexpr std::size_t kSignatureBytes = 64;

struct Deleter {
  void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
};
template <class T>
using Owned = std::unique_ptr<T, Deleter>;

const unsigned char* bytes_of(std::string_view text) { return reinterpret_cast<const unsigned char*>(text.data()); }

}  // namespace

SigningKey::SigningKey(const std::filesystem::path& path) {
  const auto file = open_secret(path);
  char no_passphrase[] = "";
  key_.reset(PEM_read_PrivateKey(file.get(), nullptr, nullptr, no_passphrase), EVP_PKEY_free);
  if (!key_ || EVP_PKEY_id(key_.get()) != EVP_PKEY_ED25519)
    throw Error(fmt::format(
        "{}: holds no private Ed25519 key without passphrase in PEM; openssl genpkey -algorithm ed25519 makes one",
        path.string()));
}

std::string SigningKey::signature_of(std::string_view text) const {
  const Owned<EVP_MD_CTX> context(EVP_MD_CTX_new());
  std::string signature(kSignatureBytes, '\0');
  std::size_t size = signature.size();
  if (!context || EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key_.get()) != 1 ||
      EVP_DigestSign(context.get(), reinterpret_cast<unsigned char*>(signature.data()), &size, bytes_of(text),
                     text.size()) != 1)
    throw Error("the text cannot be signed");
  return signature;
}

std::string SigningKey::sign(std::string_view text) const {
  const std::string signature = signature_of(text);
  std::array<unsigned char, 4 * (kSignatureBytes + 2) / 3 + 1> base64{};
  const int length = EVP_EncodeBlock(base64.data(), bytes_of(signature), static_cast<int>(signature.size()));
  return {base64.begin(), base64.begin() + length};
}

bool SigningKey::has_signed(std::string_view text, const std::string& signature) const {
  // Ed25519 signs the same text always in the same way.
  return sign(text) == signature;
}

VerifyingKey::VerifyingKey(const std::filesystem::path& path) {
  const std::unique_ptr<std::FILE, FileCloser> file(std::fopen(path.c_str(), "re"));
  if (!file) throw Error(fmt::format("{}: cannot be read", path.string()));
  key_.reset(PEM_read_PUBKEY(file.get(), nullptr, nullptr, nullptr), EVP_PKEY_free);
  if (!key_ || EVP_PKEY_id(key_.get()) != EVP_PKEY_ED25519)
    throw Error(
        fmt::format("{}: holds no public Ed25519 key in PEM; openssl pkey -in KEY -pubout makes it", path.string()));
}

bool VerifyingKey::accepts(std::string_view text, std::string_view signature) const {
  const Owned<EVP_MD_CTX> context(EVP_MD_CTX_new());
  return context && EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, key_.get()) == 1 &&
         EVP_DigestVerify(context.get(), bytes_of(signature), signature.size(), bytes_of(text), text.size()) == 1;
}

std::string new_signing_key() {
  const std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)> key(EVP_PKEY_Q_keygen(nullptr, nullptr, "ED25519"),
                                                           EVP_PKEY_free);
  if (!key) throw Error("OpenSSL cannot make a key");
  return pem_of(key.get());
}

}  // namespace isoshift
