/// Are the files of the settings dds.security good for entering a domain?
///
/// Looked at before the middleware does, which says little and late: do they exist, is the private
/// key nobody else's, do certificate, key and authority belong together, are they valid today, did
/// the permissions' authority sign both documents, do the permissions speak of this certificate.
/// Without OpenSSL (VERGE_OPENSSL=OFF) only the first two; the middleware sees to the rest.
///
/// Memory      OpenSSL's, given back before the function returns. At start-up only.
#ifndef DDS_SECURITY_H
#define DDS_SECURITY_H

#include "verge/transport.h"

/// Paths of PEM and signed XML files.
typedef struct dds_security_files {
    const char *identity_ca, *certificate, *key, *permissions_ca, *governance, *permissions;
} dds_security_files;

/// The files that the options name, or null where they ask for no security. `files` holds them as
/// long as the options live.
const dds_security_files* dds_security_asked(const transport_options* options,
                                             dds_security_files* files);

/// False: error holds one line `dds.security.FIELD: PATH: what is wrong, what was expected`.
bool dds_security_check(const dds_security_files* files, char* error, size_t error_size);

/// Do the domain's rules, however well signed, leave the door open? Then words tells which one and
/// what it lets in. Files that dds_security_check() refuses, and builds without OpenSSL: false.
bool dds_security_lax(const dds_security_files* files, char* words, size_t words_size);

/// When does the first of certificate, authorities and permissions end? utime [us], and words tells
/// which and its date. Files that dds_security_check() refuses, and builds without OpenSSL: false.
bool dds_security_expires(const dds_security_files* files, int64_t* utime, char* words,
                          size_t words_size);

#endif
