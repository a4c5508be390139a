/// Checks the files of the settings dds.security before the domain is entered.
///
/// The middleware reports faults late and without detail, so the files are checked first: they
/// exist; no other user can read the private key; certificate, key and authority match and are
/// valid today; the permissions authority has signed both documents; the permissions name this
/// certificate. Without OpenSSL (VERGE_OPENSSL=OFF) only the first two are checked here, the rest
/// by the middleware.
///
/// Memory      OpenSSL's, freed before the function returns. At start-up only.
#ifndef DDS_SECURITY_H
#define DDS_SECURITY_H

#include "verge/transport.h"

/// Paths of PEM and signed XML files.
typedef struct dds_security_files {
    const char *identity_ca, *certificate, *key, *permissions_ca, *governance, *permissions;
} dds_security_files;

/// The files that the options name, or null without security. `files` is valid as long as the
/// options.
const dds_security_files* dds_security_asked(const transport_options* options,
                                             dds_security_files* files);

/// False: error holds one line `dds.security.FIELD: PATH: what is wrong, what was expected`.
bool dds_security_check(const dds_security_files* files, char* error, size_t error_size);

/// True: a rule of the domain admits participants without a certificate or permission. Then words
/// names the rule and its effect. False for files that dds_security_check() refuses, and without
/// OpenSSL.
bool dds_security_lax(const dds_security_files* files, char* words, size_t words_size);

/// The earliest expiry date of certificate, authorities and permissions: utime [us], and words
/// names the file and the date. False for files that dds_security_check() refuses, and without
/// OpenSSL.
bool dds_security_expires(const dds_security_files* files, int64_t* utime, char* words,
                          size_t words_size);

#endif
