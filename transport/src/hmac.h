/// HMAC-SHA256 (RFC 2104, RFC 4231) with a key that is prepared once.
///
/// Memory      None: a message costs two copies of a struct on the stack.
/// Threads     A key is only read after hmac_key_init().
/// Without OpenSSL (VERGE_OPENSSL=OFF) hmac_available() is false and nothing else may be called.
#ifndef HMAC_H
#define HMAC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/uio.h>

enum {
    HMAC_SIZE = 32,         // [B] of a whole code
    HMAC_KEY_SIZE_MAX = 64, // [B] SHA-256's block: longer keys would be hashed first
    HMAC_STATE_WORDS = 28,  // of a SHA256_CTX, so that no one else needs OpenSSL's headers
};

/// SHA-256 in mid course: behind the inner and behind the outer pad.
typedef struct hmac_key {
    uint32_t inner[HMAC_STATE_WORDS], outer[HMAC_STATE_WORDS];
} hmac_key;

bool hmac_available(void);
/// size: at most HMAC_KEY_SIZE_MAX.
void hmac_key_init(hmac_key* self, const uint8_t* bytes, size_t size);
/// Of the parts one after the other.
void hmac_sha256(const hmac_key* self, const struct iovec* parts, int part_count,
                 uint8_t code[HMAC_SIZE]);
/// Compares in constant time.
bool hmac_same(const uint8_t* a, const uint8_t* b, size_t size);
/// Overwrites secret bytes; the compiler cannot remove it.
void hmac_wipe(void* secret, size_t size);

#endif
