// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Small fixed-size vectors of float and double. Plain values: no constructors that hide work, no
// virtual functions; every operation is component-wise unless its name says otherwise.
#pragma once

#include <cmath>
#include <cstddef>

namespace sheaf {

template <typename T>
struct Vec2 {
  T x{}, y{};
  friend constexpr Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
  friend constexpr Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
  friend constexpr Vec2 operator*(Vec2 a, T s) { return {a.x * s, a.y * s}; }
  friend constexpr Vec2 operator*(T s, Vec2 a) { return {a.x * s, a.y * s}; }
  friend constexpr bool operator==(const Vec2&, const Vec2&) = default;
};

template <typename T>
struct Vec3 {
  T x{}, y{}, z{};
  constexpr T operator[](size_t i) const { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr T& operator[](size_t i) { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr Vec3 operator-() const { return {-x, -y, -z}; }
  friend constexpr Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend constexpr Vec3 operator*(Vec3 a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  friend constexpr Vec3 operator*(T s, Vec3 a) { return {a.x * s, a.y * s, a.z * s}; }
  friend constexpr Vec3 operator/(Vec3 a, T s) { return {a.x / s, a.y / s, a.z / s}; }
  constexpr Vec3& operator+=(Vec3 b) { return *this = *this + b; }
  constexpr Vec3& operator-=(Vec3 b) { return *this = *this - b; }
  constexpr Vec3& operator*=(T s) { return *this = *this * s; }
  friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
};

using Vec2f = Vec2<float>;
using Vec2d = Vec2<double>;
using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

template <typename T>
constexpr T Dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename T>
constexpr Vec3<T> Cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <typename T>
constexpr T LengthSquared(Vec3<T> a) {
  return Dot(a, a);
}
template <typename T>
inline T Length(Vec3<T> a) {
  return std::sqrt(LengthSquared(a));
}
// Requires: Length(a) > 0 and LengthSquared(a) neither under- nor overflows.
template <typename T>
inline Vec3<T> Normalize(Vec3<T> a) {
  return a * (T(1) / Length(a));
}
constexpr Vec3f ToFloat(Vec3d a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}
constexpr Vec3d ToDouble(Vec3f a) { return {a.x, a.y, a.z}; }

// Linear-light color with the primaries and white point of sRGB (ITU-R BT.709, D65); may be
// negative.
struct Rgb {
  float r = 0, g = 0, b = 0;
  static constexpr Rgb Gray(float v) { return {v, v, v}; }
  constexpr float operator[](size_t i) const { return i == 0 ? r : (i == 1 ? g : b); }
  constexpr float& operator[](size_t i) { return i == 0 ? r : (i == 1 ? g : b); }
  friend constexpr Rgb operator+(Rgb p, Rgb q) { return {p.r + q.r, p.g + q.g, p.b + q.b}; }
  friend constexpr Rgb operator-(Rgb p, Rgb q) { return {p.r - q.r, p.g - q.g, p.b - q.b}; }
  friend constexpr Rgb operator*(Rgb p, Rgb q) { return {p.r * q.r, p.g * q.g, p.b * q.b}; }
  friend constexpr Rgb operator*(Rgb p, float s) { return {p.r * s, p.g * s, p.b * s}; }
  friend constexpr Rgb operator*(float s, Rgb p) { return {p.r * s, p.g * s, p.b * s}; }
  friend constexpr Rgb operator/(Rgb p, float s) { return {p.r / s, p.g / s, p.b / s}; }
  constexpr Rgb& operator+=(Rgb q) { return *this = *this + q; }
  constexpr Rgb& operator*=(Rgb q) { return *this = *this * q; }
  constexpr Rgb& operator*=(float s) { return *this = *this * s; }
  constexpr bool IsBlack() const { return r == 0 && g == 0 && b == 0; }
  friend constexpr bool operator==(const Rgb&, const Rgb&) = default;
};
constexpr float MaxComponent(Rgb c) {
  return c.r > c.g ? (c.r > c.b ? c.r : c.b) : (c.g > c.b ? c.g : c.b);
}
// Relative luminance (CIE Y) of linear sRGB. Source: IEC 61966-2-1.
constexpr float Luminance(Rgb c) { return 0.212639f * c.r + 0.715169f * c.g + 0.072192f * c.b; }
inline bool IsFinite(Rgb c) {
  return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b);
}

}  // namespace sheaf
