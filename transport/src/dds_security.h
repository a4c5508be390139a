/// Are the files of transport_dds_security good for entering a domain?
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

/// False: error holds one line `dds.security.FIELD: PATH: what is wrong, what was expected`.
bool dds_security_check(const transport_dds_security* files, char* error, size_t error_size);

/// Do the domain's rules, however well signed, leave the door open? Then words tells which one and
/// what it lets in. Files that dds_security_check() refuses, and builds without OpenSSL: false.
bool dds_security_lax(const transport_dds_security* files, char* words, size_t words_size);

/// When does the first of certificate, authorities and permissions end? utime [us], and words tells
/// which and its date. Files that dds_security_check() refuses, and builds without OpenSSL: false.
bool dds_security_expires(const transport_dds_security* files, int64_t* utime, char* words,
                          size_t words_size);

#endif
