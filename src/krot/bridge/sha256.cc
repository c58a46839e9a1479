#include "krot/bridge/sha256.h"

namespace krot::internal {
namespace {

__extension__ using Wide = unsigned __int128;

constexpr bool IsPrime(int n) {
  for (int divisor = 2; divisor * divisor <= n; ++divisor) {
    if (n % divisor == 0) return false;
  }
  return true;
}

// The first 32 bits behind the point of the root of that degree.
constexpr uint32_t RootBits(int n, int degree) {
  const Wide target = Wide(n) << (32 * degree);
  Wide root = 0;
  for (int bit = 36; bit >= 0; --bit) {
    const Wide trial = root | (Wide(1) << bit);
    const Wide power = degree == 2 ? trial * trial : trial * trial * trial;
    if (power <= target) root = trial;
  }
  return static_cast<uint32_t>(root);
}

// Of the first primes.
template <size_t size>
constexpr std::array<uint32_t, size> PrimeRoots(int degree) {
  std::array<uint32_t, size> roots = {};
  size_t found = 0;
  for (int n = 2; found < size; ++n) {
    if (IsPrime(n)) roots[found++] = RootBits(n, degree);
  }
  return roots;
}

constexpr std::array<uint32_t, 8> kStart = PrimeRoots<8>(2);
constexpr std::array<uint32_t, 64> kRounds = PrimeRoots<64>(3);

uint32_t Turn(uint32_t word, int bits) {
  return (word >> bits) | (word << (32 - bits));
}

}  // namespace

Sha256Stream::Sha256Stream() : state_(kStart) {}

void Sha256Stream::Append(const unsigned char* bytes, size_t size) {
  num_bytes_ += size;
  for (size_t n = 0; n < size; ++n) {
    block_[block_size_++] = bytes[n];
    if (block_size_ == block_.size()) DigestBlock();
  }
}

// Named as in the standard: the schedule w, the working variables a to h.
void Sha256Stream::DigestBlock() {
  std::array<uint32_t, 64> w;
  for (size_t t = 0; t < 16; ++t) {
    w[t] = uint32_t{block_[4 * t]} << 24 | uint32_t{block_[4 * t + 1]} << 16 |
           uint32_t{block_[4 * t + 2]} << 8 | uint32_t{block_[4 * t + 3]};
  }
  for (size_t t = 16; t < 64; ++t) {
    const uint32_t x = w[t - 15], y = w[t - 2];
    w[t] = w[t - 16] + (Turn(x, 7) ^ Turn(x, 18) ^ (x >> 3)) + w[t - 7] +
           (Turn(y, 17) ^ Turn(y, 19) ^ (y >> 10));
  }
  auto [a, b, c, d, e, f, g, h] = state_;
  for (size_t t = 0; t < 64; ++t) {
    const uint32_t t1 = h + (Turn(e, 6) ^ Turn(e, 11) ^ Turn(e, 25)) +
                        ((e & f) ^ (~e & g)) + kRounds[t] + w[t];
    const uint32_t t2 = (Turn(a, 2) ^ Turn(a, 13) ^ Turn(a, 22)) +
                        ((a & b) ^ (a & c) ^ (b & c));
    h = g, g = f, f = e, e = d + t1, d = c, c = b, b = a, a = t1 + t2;
  }
  const std::array<uint32_t, 8> worked = {a, b, c, d, e, f, g, h};
  for (size_t n = 0; n < 8; ++n) state_[n] += worked[n];
  block_size_ = 0;
}

std::array<unsigned char, 32> Sha256Stream::Finish() {
  const uint64_t num_bits = 8 * num_bytes_;
  const unsigned char one = 0x80, zero = 0;
  Append(&one, 1);
  while (block_size_ != 56) Append(&zero, 1);
  for (int shift = 56; shift >= 0; shift -= 8) {
    const auto byte = static_cast<unsigned char>(num_bits >> shift);
    Append(&byte, 1);
  }
  std::array<unsigned char, 32> digest;
  for (size_t n = 0; n < digest.size(); ++n) {
    digest[n] = static_cast<unsigned char>(state_[n / 4] >> (24 - 8 * (n % 4)));
  }
  return digest;
}

}  // namespace krot::internal
