/// The hash uses OpenSSL's low-level interface, which works on a struct of the caller. EVP_MAC and
/// EVP_Digest, its successors, allocate at each message (OpenSSL 3.0: twice, counted through
/// CRYPTO_set_mem_functions), and the daemon must not allocate while it plans.
#define OPENSSL_API_COMPAT 0x10100000L
#include "hmac.h"

#include <assert.h>
#include <string.h>

#ifdef VERGE_OPENSSL
#include <openssl/crypto.h>
#include <openssl/sha.h>

static_assert(sizeof(SHA256_CTX) == HMAC_STATE_WORDS * sizeof(uint32_t),
              "hmac_key holds two SHA256_CTX");

bool hmac_available(void)
{
    return true;
}

void hmac_key_init(hmac_key* self, const uint8_t* bytes, size_t size)
{
    assert(size <= HMAC_KEY_SIZE_MAX);
    uint8_t inner[SHA256_CBLOCK], outer[SHA256_CBLOCK];
    memset(inner, 0x36, sizeof inner);
    memset(outer, 0x5c, sizeof outer);
    for (size_t i = 0; i < size; ++i) {
        inner[i] = (uint8_t)(inner[i] ^ bytes[i]);
        outer[i] = (uint8_t)(outer[i] ^ bytes[i]);
    }
    SHA256_CTX state;
    SHA256_Init(&state);
    SHA256_Update(&state, inner, sizeof inner);
    memcpy(self->inner, &state, sizeof state);
    SHA256_Init(&state);
    SHA256_Update(&state, outer, sizeof outer);
    memcpy(self->outer, &state, sizeof state);
    hmac_wipe(inner, sizeof inner);
    hmac_wipe(outer, sizeof outer);
    hmac_wipe(&state, sizeof state);
}

void hmac_sha256(const hmac_key* self, const struct iovec* parts, int part_count,
                 uint8_t code[HMAC_SIZE])
{
    SHA256_CTX state;
    memcpy(&state, self->inner, sizeof state);
    for (int i = 0; i < part_count; ++i) {
        SHA256_Update(&state, parts[i].iov_base, parts[i].iov_len);
    }
    SHA256_Final(code, &state);
    memcpy(&state, self->outer, sizeof state);
    SHA256_Update(&state, code, HMAC_SIZE);
    SHA256_Final(code, &state);
}

bool hmac_same(const uint8_t* a, const uint8_t* b, size_t size)
{
    return CRYPTO_memcmp(a, b, size) == 0;
}

void hmac_wipe(void* secret, size_t size)
{
    OPENSSL_cleanse(secret, size);
}

#else

bool hmac_available(void)
{
    return false;
}

void hmac_key_init(hmac_key* self, const uint8_t* bytes, size_t size)
{
    (void)bytes;
    (void)size;
    memset(self, 0, sizeof *self);
    assert(false);
}

void hmac_sha256(const hmac_key* self, const struct iovec* parts, int part_count,
                 uint8_t code[HMAC_SIZE])
{
    (void)self;
    (void)parts;
    (void)part_count;
    memset(code, 0, HMAC_SIZE);
    assert(false);
}

bool hmac_same(const uint8_t* a, const uint8_t* b, size_t size)
{
    (void)a;
    (void)b;
    (void)size;
    return false; // a signature that cannot be checked is refused
}

void hmac_wipe(void* secret, size_t size)
{
    memset(secret, 0, size);
}

#endif
