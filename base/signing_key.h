#pragma once
// Signatures of texts: Ed25519 (RFC 8032).

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

struct evp_pkey_st;  // of OpenSSL

namespace isoshift {

class SigningKey {
 public:
  // A private key, PEM, as `openssl genpkey -algorithm ed25519` writes it. Throws Error for a file that cannot be read,
  // that other users can read, or that holds no such key.
  explicit SigningKey(const std::filesystem::path& path);

  std::string signature_of(std::string_view text) const;  // 64 bytes
  std::string sign(std::string_view text) const;          // the same in base64
  bool has_signed(std::string_view text, const std::string& signature) const;

 private:
  std::shared_ptr<evp_pkey_st> key_;
};

// The public half of such a key, which says whether a text was signed.
class VerifyingKey {
 public:
  // PEM, as `openssl pkey -pubout` writes it. Throws Error for a file that cannot be read or holds no such key.
  explicit VerifyingKey(const std::filesystem::path& path);

  // Never throws for a signature of any size or content.
  bool accepts(std::string_view text, std::string_view signature) const;

 private:
  std::shared_ptr<evp_pkey_st> key_;
};

// A new private key, PEM. Throws Error if none can be made.
std::string new_signing_key();

}  // namespace isoshift
