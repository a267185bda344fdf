// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Synthetic measured materials: RGL tensor files generated from a function, so that the expected
// rendering is known. The distribution of visible normals is GGX, exact at the corners of its grid;
// the spectra are chosen to give the requested reflection.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::testing {

// One array of a tensor file, and its declared position in the file.
struct TensorArray {
  std::string name;
  uint8_t type = 10;  // float32; 1 is uint8.
  std::vector<uint64_t> shape;
  std::string bytes;
};
inline TensorArray FloatArray(std::string name, std::vector<uint64_t> shape,
                              const std::vector<float>& values) {
  TensorArray array{std::move(name), 10, std::move(shape), std::string(values.size() * 4, '\0')};
  std::memcpy(array.bytes.data(), values.data(), array.bytes.size());
  return array;
}

// The bytes of a tensor file.
inline std::string TensorBytes(const std::vector<TensorArray>& arrays) {
  std::string head("tensor_file\0\1\0", 14);
  const auto append = [&head](const auto& number) {
    head.append(reinterpret_cast<const char*>(&number), sizeof number);
  };
  append(static_cast<uint32_t>(arrays.size()));
  uint64_t offset = head.size();
  for (const TensorArray& a : arrays) offset += 2 + a.name.size() + 2 + 1 + 8 + 8 * a.shape.size();
  for (const TensorArray& a : arrays) {
    append(static_cast<uint16_t>(a.name.size()));
    head += a.name;
    append(static_cast<uint16_t>(a.shape.size()));
    append(a.type);
    append(offset);
    for (const uint64_t size : a.shape) append(size);
    offset += a.bytes.size();
  }
  for (const TensorArray& a : arrays) head += a.bytes;
  return head;
}

struct MeasuredFileBuilder {
  // Spectral f(wo, wi) * cos wi; both with z > 0.
  std::function<double(Vec3d wo, Vec3d wi, double nm)> f_cos = [](Vec3d, Vec3d wi, double) {
    return 0.5 / std::numbers::pi * wi.z;
  };
  double alpha_x = 0.5, alpha_y = 0.5;
  std::vector<float> phi = {0}, theta = {0, 0.4f, 0.8f, 1.1f, 1.35f, 1.55f};
  std::vector<float> wavelengths = {400, 550, 700};
  uint32_t normal_size = 33, spectra_size = 17;

  static Vec3d Direction(double theta, double phi) {
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
  }
  bool IsIsotropic() const { return phi.size() <= 2; }
  double Density(Vec3d m) const {  // GGX.
    const double x = m.x / alpha_x, y = m.y / alpha_y, t = x * x + y * y + m.z * m.z;
    return 1 / (std::numbers::pi * alpha_x * alpha_y * t * t);
  }
  double Sigma(Vec3d w) const {  // cos / G1.
    const double x = alpha_x * w.x, y = alpha_y * w.y;
    return 0.5 * (std::sqrt(w.z * w.z + x * x + y * y) + w.z);
  }
  // The micronormal at a point of the square, for incidence at phi.
  Vec3d NormalAt(double u, double v, double phi_i) const {
    const double around = (2 * v - 1) * std::numbers::pi + (IsIsotropic() ? phi_i : 0);
    return Direction(u * u * std::numbers::pi / 2, around);
  }

  std::vector<TensorArray> Arrays() const;
  std::string Bytes() const { return TensorBytes(Arrays()); }
  void Write(const std::string& path) const { std::ofstream(path, std::ios::binary) << Bytes(); }

 private:
  // Interprets the grid over the square as a bilinear density and warps a point of the unit square
  // by it. Values are at the corners, row-major.
  static Vec2d Warp(const std::vector<double>& values, uint32_t n, Vec2d u);
};

// By definition: the marginal distribution of rows, then the distribution within the row, each
// inverted by bisection.
inline Vec2d MeasuredFileBuilder::Warp(const std::vector<double>& values, uint32_t n, Vec2d u) {
  const auto line = [&](uint32_t y, double x) {  // Integral of corner line y up to x cells.
    double sum = 0;
    for (uint32_t i = 0; i + 1 < n && x > i; ++i) {
      const double f = std::fmin(x - i, 1.0), a = values[y * n + i], b = values[y * n + i + 1];
      sum += f * (a + 0.5 * f * (b - a));
    }
    return sum;
  };
  std::vector<double> lines(n);
  for (uint32_t y = 0; y < n; ++y) lines[y] = line(y, n - 1);
  const auto marginal = [&](double y) {
    double sum = 0;
    for (uint32_t i = 0; i + 1 < n && y > i; ++i) {
      const double f = std::fmin(y - i, 1.0);
      sum += f * (lines[i] + 0.5 * f * (lines[i + 1] - lines[i]));
    }
    return sum;
  };
  const auto solve = [n](const auto& f, double target) {
    double low = 0, high = n - 1;
    for (int i = 0; i < 50; ++i) {
      const double middle = 0.5 * (low + high);
      (f(middle) < target ? low : high) = middle;
    }
    return 0.5 * (low + high);
  };
  const double y = solve(marginal, u.y * marginal(n - 1));
  const auto row = std::min(static_cast<uint32_t>(y), n - 2);
  const double t = y - row;
  const auto along = [&](double x) { return (1 - t) * line(row, x) + t * line(row + 1, x); };
  const double x = solve(along, u.x * along(n - 1));
  return {x / (n - 1), y / (n - 1)};
}

inline std::vector<TensorArray> MeasuredFileBuilder::Arrays() const {
  constexpr double kPi = std::numbers::pi;
  const uint32_t n = normal_size, m = spectra_size;
  std::vector<float> ndf, sigma, vndf, luminance, spectra;
  for (uint32_t y = 0; y < n; ++y) {
    for (uint32_t x = 0; x < n; ++x) {
      const double u = static_cast<double>(x) / (n - 1), v = static_cast<double>(y) / (n - 1);
      ndf.push_back(static_cast<float>(Density(NormalAt(u, v, 0))));
      const double theta_i = u * u * kPi / 2;
      sigma.push_back(static_cast<float>(Sigma(Direction(theta_i, (2 * v - 1) * kPi))));
    }
  }
  for (const float p : phi) {
    for (const float t : theta) {
      const Vec3d wo = Direction(t, p);
      std::vector<double> visible;
      for (uint32_t y = 0; y < n; ++y) {
        for (uint32_t x = 0; x < n; ++x) {
          const double u = static_cast<double>(x) / (n - 1), v = static_cast<double>(y) / (n - 1);
          const Vec3d normal = NormalAt(u, v, p);
          const double jacobian = 2 * kPi * kPi * u * std::sin(u * u * kPi / 2);
          // Bounded away from 0: measured values contain noise, and 0 would not determine f.
          visible.push_back(Density(normal) * std::fmax(Dot(wo, normal), 0.002) * jacobian /
                            Sigma(wo));
        }
      }
      for (const double value : visible) vndf.push_back(static_cast<float>(value));
      std::vector<std::vector<float>> by_wavelength(wavelengths.size());
      for (uint32_t y = 0; y < m; ++y) {
        for (uint32_t x = 0; x < m; ++x) {
          const Vec2d at = Warp(
              visible, n, {static_cast<double>(x) / (m - 1), static_cast<double>(y) / (m - 1)});
          const Vec3d normal = NormalAt(at.x, at.y, p);
          const Vec3d wi = normal * (2 * Dot(wo, normal)) - wo;
          double sum = 0;
          for (size_t w = 0; w < wavelengths.size(); ++w) {
            const double value = wi.z > 0 ? f_cos(wo, wi, static_cast<double>(wavelengths[w])) * 4 *
                                                Sigma(wo) / Density(normal)
                                          : 0;
            by_wavelength[w].push_back(static_cast<float>(value));
            sum += value;
          }
          luminance.push_back(static_cast<float>(sum + 0.01));
        }
      }
      for (const auto& values : by_wavelength) {
        spectra.insert(spectra.end(), values.begin(), values.end());
      }
    }
  }
  const uint64_t phis = phi.size(), thetas = theta.size(), waves = wavelengths.size();
  return {{"description", 1, {4}, "test"},
          FloatArray("phi_i", {phis}, phi),
          FloatArray("theta_i", {thetas}, theta),
          FloatArray("wavelengths", {waves}, wavelengths),
          {"jacobian", 1, {1}, std::string(1, '\1')},
          FloatArray("ndf", {n, n}, ndf),
          FloatArray("sigma", {n, n}, sigma),
          FloatArray("vndf", {phis, thetas, n, n}, vndf),
          FloatArray("luminance", {phis, thetas, m, m}, luminance),
          FloatArray("spectra", {phis, thetas, waves, m, m}, spectra)};
}

}  // namespace sheaf::testing
