// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/perlin_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace sheaf {
namespace {

constexpr int kPeriod = 256;

// Source: Perlin 2002.
constexpr std::array<uint8_t, kPeriod> kPermutation = {
    151, 160, 137, 91,  90,  15,  131, 13,  201, 95,  96,  53,  194, 233, 7,   225, 140, 36,  103,
    30,  69,  142, 8,   99,  37,  240, 21,  10,  23,  190, 6,   148, 247, 120, 234, 75,  0,   26,
    197, 62,  94,  252, 219, 203, 117, 35,  11,  32,  57,  177, 33,  88,  237, 149, 56,  87,  174,
    20,  125, 136, 171, 168, 68,  175, 74,  165, 71,  134, 139, 48,  27,  166, 77,  146, 158, 231,
    83,  111, 229, 122, 60,  211, 133, 230, 220, 105, 92,  41,  55,  46,  245, 40,  244, 102, 143,
    54,  65,  25,  63,  161, 1,   216, 80,  73,  209, 76,  132, 187, 208, 89,  18,  169, 200, 196,
    135, 130, 116, 188, 159, 86,  164, 100, 109, 198, 173, 186, 3,   64,  52,  217, 226, 250, 124,
    123, 5,   202, 38,  147, 118, 126, 255, 82,  85,  212, 207, 206, 59,  227, 47,  16,  58,  17,
    182, 189, 28,  42,  223, 183, 170, 213, 119, 248, 152, 2,   44,  154, 163, 70,  221, 153, 101,
    155, 167, 43,  172, 9,   129, 22,  39,  253, 19,  98,  108, 110, 79,  113, 224, 232, 178, 185,
    112, 104, 218, 246, 97,  228, 251, 34,  242, 193, 238, 210, 144, 12,  191, 179, 162, 241, 81,
    51,  145, 235, 249, 14,  239, 107, 49,  192, 214, 31,  181, 199, 106, 157, 184, 84,  204, 176,
    115, 121, 50,  45,  127, 4,   150, 254, 138, 236, 205, 93,  222, 114, 67,  29,  24,  72,  243,
    141, 128, 195, 78,  66,  215, 61,  156, 180};

uint8_t Permuted(int i) { return kPermutation[static_cast<size_t>(i & (kPeriod - 1))]; }

// Second derivatives vanish at 0 and 1.
double Fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }
double Mix(double t, double a, double b) { return a + t * (b - a); }

// The product of the offset with one of twelve gradients, to the edge centers of a cube; four of
// them occur twice among the 16 hashes.
double GradientProduct(int x, int y, int z, Vec3d offset) {
  const int hash = Permuted(Permuted(Permuted(x) + y) + z) & 15;
  const bool is_repeated = hash == 12 || hash == 13;
  const double a = hash < 8 || is_repeated ? offset.x : offset.y;
  const double b = hash < 4 || is_repeated ? offset.y : offset.z;
  return ((hash & 1) != 0 ? -a : a) + ((hash & 2) != 0 ? -b : b);
}

// Within [0, kPeriod).
double WithinPeriod(double x) {
  if (!std::isfinite(x)) return 0;
  const double reduced = x - kPeriod * std::floor(x * (1.0 / kPeriod));
  return reduced < kPeriod ? reduced : 0;  // Tiny negative numbers round up to the period.
}

template <typename Value>
double SumOctaves(Vec3d p, int octaves, double roughness, const Value& value) {
  double sum = 0, amplitude = 1, frequency = 1;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * value(PerlinNoise(frequency * p));
    frequency *= kLacunarity;
    amplitude *= roughness;
  }
  return sum;
}

}  // namespace

double PerlinNoise(Vec3d p) {
  p = {WithinPeriod(p.x), WithinPeriod(p.y), WithinPeriod(p.z)};
  const int x = static_cast<int>(p.x), y = static_cast<int>(p.y), z = static_cast<int>(p.z);
  const Vec3d f = p - Vec3d{double(x), double(y), double(z)};
  const auto corner = [&](int i, int j, int k) {
    return GradientProduct(x + i, y + j, z + k, f - Vec3d{double(i), double(j), double(k)});
  };
  const double u = Fade(f.x), v = Fade(f.y), w = Fade(f.z);
  const auto row = [&](int j, int k) { return Mix(u, corner(0, j, k), corner(1, j, k)); };
  const double value = Mix(w, Mix(v, row(0, 0), row(1, 0)), Mix(v, row(0, 1), row(1, 1)));
  return std::clamp(value, -1.0, 1.0);  // Only rounding can leave the range.
}

double FractalNoise(Vec3d p, int octaves, double roughness) {
  return SumOctaves(p, octaves, roughness, [](double value) { return value; });
}

double TurbulentNoise(Vec3d p, int octaves, double roughness) {
  return SumOctaves(p, octaves, roughness, [](double value) { return std::fabs(value); });
}

}  // namespace sheaf
