/// CRC-32 as zlib's (polynomial 0xEDB88320), in portions.
///
///     uint32_t crc = crc32_begin;
///     crc = crc32_add(crc, bytes, size);   // as often as there are portions
///     result = crc32_end(crc);
#ifndef CRC32_H
#define CRC32_H

#include <stddef.h>
#include <stdint.h>

static const uint32_t crc32_begin = 0xffffffffu;

uint32_t crc32_add(uint32_t crc, const uint8_t* bytes, size_t size);

static inline uint32_t crc32_end(uint32_t crc)
{
    return ~crc;
}

#endif
