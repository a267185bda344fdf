// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/lattice_noise.h"

#include <bit>
#include <cmath>

namespace sheaf {
namespace {

constexpr uint32_t kHashSeed = 0xdeadbeef + 13;
constexpr double kCoordinateEnd = 0x1p31;
// They make the extremes of the noises about 1; by the number of dimensions.
constexpr double kScale1 = 0.25, kScale2 = 0.6616, kScale3 = 0.9820, kScale4 = 0.8344;

struct HashState {
  uint32_t a, b, c;

  explicit HashState(uint32_t keys)
      : a(kHashSeed + (keys << 2)), b(kHashSeed + (keys << 2)), c(kHashSeed + (keys << 2)) {}
  void Mix() {
    const auto step = [](uint32_t& x, uint32_t& y, uint32_t& z, int bits) {
      x -= z;
      x ^= std::rotl(z, bits);
      z += y;
    };
    step(a, b, c, 4);
    step(b, c, a, 6);
    step(c, a, b, 8);
    step(a, b, c, 16);
    step(b, c, a, 19);
    step(c, a, b, 4);
  }
  uint32_t Final() {
    const auto step = [](uint32_t& x, uint32_t y, int bits) {
      x ^= y;
      x -= std::rotl(y, bits);
    };
    step(c, b, 14);
    step(a, c, 11);
    step(b, a, 25);
    step(c, b, 16);
    step(a, c, 4);
    step(b, a, 14);
    step(c, b, 24);
    return c;
  }
};

uint32_t BitsOf(float x) { return std::bit_cast<uint32_t>(x); }
float UnitOf(uint32_t hash) { return static_cast<float>(hash) * (1.0f / 4294967296.0f); }

double Eased(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }
double Between(double t, double a, double b) { return (1 - t) * a + t * b; }
double Signed(double x, uint32_t is_negative) { return is_negative != 0 ? -x : x; }

double GradientProduct(uint32_t hash, double x) { return Signed((1 + (hash & 7)) * x, hash & 8); }
double GradientProduct(uint32_t hash, double x, double y) {
  const uint32_t h = hash & 7;
  const double u = h < 4 ? x : y, v = 2 * (h < 4 ? y : x);
  return Signed(u, h & 1) + Signed(v, h & 2);
}
double GradientProduct(uint32_t hash, double x, double y, double z) {
  const uint32_t h = hash & 15;
  const double u = h < 8 ? x : y;
  const double beside = h == 12 || h == 14 ? x : z;
  const double v = h < 4 ? y : beside;
  return Signed(u, h & 1) + Signed(v, h & 2);
}

double GradientProduct(uint32_t hash, double x, double y, double z, double w) {
  const uint32_t h = hash & 31;
  const double a = h < 24 ? x : y, b = h < 16 ? y : z, c = h < 8 ? z : w;
  return Signed(a, h & 1) + Signed(b, h & 2) + Signed(c, h & 4);
}

// The lattice point below and the offset from it.
struct Cell {
  uint32_t at;
  double offset;
};
Cell CellOf(double x) {
  if (!(std::fabs(x) < kCoordinateEnd)) return {0, 0};
  const double below = std::floor(x);
  return {static_cast<uint32_t>(static_cast<int32_t>(below)), x - below};
}

}  // namespace

uint32_t HashOf(uint32_t x) {
  HashState state(1);
  state.a += x;
  return state.Final();
}
uint32_t HashOf(uint32_t x, uint32_t y) {
  HashState state(2);
  state.a += x;
  state.b += y;
  return state.Final();
}
uint32_t HashOf(uint32_t x, uint32_t y, uint32_t z) {
  HashState state(3);
  state.a += x;
  state.b += y;
  state.c += z;
  return state.Final();
}
uint32_t HashOf(uint32_t x, uint32_t y, uint32_t z, uint32_t w) {
  HashState state(4);
  state.a += x;
  state.b += y;
  state.c += z;
  state.Mix();
  state.a += w;
  return state.Final();
}
float RandomOf(float x) { return UnitOf(HashOf(BitsOf(x))); }
float RandomOf(float x, float y) { return UnitOf(HashOf(BitsOf(x), BitsOf(y))); }
float RandomOf(float x, float y, float z) {
  return UnitOf(HashOf(BitsOf(x), BitsOf(y), BitsOf(z)));
}
float RandomOf(float x, float y, float z, float w) {
  return UnitOf(HashOf(BitsOf(x), BitsOf(y), BitsOf(z), BitsOf(w)));
}
std::array<float, 3> RandomTripleOf(float x) {
  return {RandomOf(x), RandomOf(x, 1), RandomOf(x, 2)};
}
std::array<float, 3> RandomTripleOf(float x, float y) {
  return {RandomOf(x, y), RandomOf(x, y, 1), RandomOf(x, y, 2)};
}
std::array<float, 3> RandomTripleOf(float x, float y, float z) {
  return {RandomOf(x, y, z), RandomOf(x, y, z, 1), RandomOf(x, y, z, 2)};
}

std::array<float, 3> RandomTripleOf(float x, float y, float z, float w) {
  return {RandomOf(x, y, z, w), RandomOf(z, x, w, y), RandomOf(w, z, y, x)};
}
std::array<float, 4> RandomQuadrupleOf(float x, float y, float z, float w) {
  return {RandomOf(x, y, z, w), RandomOf(w, x, y, z), RandomOf(z, w, x, y), RandomOf(y, z, w, x)};
}

double LatticeNoise(double x) {
  const Cell cell = CellOf(x);
  return kScale1 * Between(Eased(cell.offset), GradientProduct(HashOf(cell.at), cell.offset),
                           GradientProduct(HashOf(cell.at + 1), cell.offset - 1));
}

double LatticeNoise(Vec2d p) {
  const Cell x = CellOf(p.x), y = CellOf(p.y);
  const double u = Eased(x.offset), v = Eased(y.offset);
  const auto corner = [&](uint32_t i, uint32_t j) {
    return GradientProduct(HashOf(x.at + i, y.at + j), x.offset - i, y.offset - j);
  };
  return kScale2 *
         Between(v, Between(u, corner(0, 0), corner(1, 0)), Between(u, corner(0, 1), corner(1, 1)));
}

double LatticeNoise(Vec3d p) {
  const Cell x = CellOf(p.x), y = CellOf(p.y), z = CellOf(p.z);
  const double u = Eased(x.offset), v = Eased(y.offset), w = Eased(z.offset);
  const auto corner = [&](uint32_t i, uint32_t j, uint32_t k) {
    return GradientProduct(HashOf(x.at + i, y.at + j, z.at + k), x.offset - i, y.offset - j,
                           z.offset - k);
  };
  const auto face = [&](uint32_t k) {
    return Between(v, Between(u, corner(0, 0, k), corner(1, 0, k)),
                   Between(u, corner(0, 1, k), corner(1, 1, k)));
  };
  return kScale3 * Between(w, face(0), face(1));
}

double LatticeNoise(Vec3d p, double w) {
  const Cell x = CellOf(p.x), y = CellOf(p.y), z = CellOf(p.z), t = CellOf(w);
  const double u = Eased(x.offset), v = Eased(y.offset), s = Eased(z.offset);
  const auto corner = [&](uint32_t i, uint32_t j, uint32_t k, uint32_t l) {
    return GradientProduct(HashOf(x.at + i, y.at + j, z.at + k, t.at + l), x.offset - i,
                           y.offset - j, z.offset - k, t.offset - l);
  };
  const auto face = [&](uint32_t k, uint32_t l) {
    return Between(v, Between(u, corner(0, 0, k, l), corner(1, 0, k, l)),
                   Between(u, corner(0, 1, k, l), corner(1, 1, k, l)));
  };
  return kScale4 * Between(Eased(t.offset), Between(s, face(0, 0), face(1, 0)),
                           Between(s, face(0, 1), face(1, 1)));
}

}  // namespace sheaf
