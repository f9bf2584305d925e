/* XXH64, the hash of Y. Collet's specification (https://github.com/Cyan4973/xxHash, doc/xxhash_spec.md), with words
   in the order of the machine. Spelled out here because compute clusters seldom have libxxhash to link with. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

static const uint64_t p1 = 0x9E3779B185EBCA87u, p2 = 0xC2B2AE3D27D4EB4Fu, p3 = 0x165667B19E3779F9u,
                      p4 = 0x85EBCA77C2B2AE63u, p5 = 0x27D4EB2F165667C5u;

static uint64_t rotated(uint64_t x, int n) { return x << n | x >> (64 - n); }
static uint64_t round_of(uint64_t lane, uint64_t word) { return rotated(lane + word * p2, 31) * p1; }

static uint64_t word_at(const unsigned char *p)
{
  uint64_t word;
  memcpy(&word, p, sizeof word);
  return word;
}

uint64_t hexcontact_xxh64(const void *data, size_t size, uint64_t seed)
{
  const unsigned char *p = data, *end = p + size;
  uint64_t h = seed + p5;

  if (size >= 32) {
    uint64_t lane[4] = {seed + p1 + p2, seed + p2, seed, seed - p1};
    for (; end - p >= 32; p += 32)
      for (int i = 0; i < 4; i++) lane[i] = round_of(lane[i], word_at(p + 8 * i));
    h = rotated(lane[0], 1) + rotated(lane[1], 7) + rotated(lane[2], 12) + rotated(lane[3], 18);
    for (int i = 0; i < 4; i++) h = (h ^ round_of(0, lane[i])) * p1 + p4;
  }
  h += size;
  for (; end - p >= 8; p += 8) h = rotated(h ^ round_of(0, word_at(p)), 27) * p1 + p4;
  if (end - p >= 4) {
    uint32_t half;
    memcpy(&half, p, sizeof half);
    h = rotated(h ^ half * p1, 23) * p2 + p3;
    p += 4;
  }
  for (; p < end; p++) h = rotated(h ^ *p * p5, 11) * p1;
  h = (h ^ h >> 33) * p2;
  h = (h ^ h >> 29) * p3;
  return h ^ h >> 32;
}
