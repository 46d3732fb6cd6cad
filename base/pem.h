#pragma once
// What OpenSSL holds as PEM. Throws Error if OpenSSL fails.

#include <string>

struct evp_pkey_st;  // of OpenSSL
struct x509_st;

namespace isoshift {

std::string pem_of(const evp_pkey_st* private_key);  // without passphrase
std::string pem_of(const x509_st* certificate);

}  // namespace isoshift
