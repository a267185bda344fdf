// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/wavelength_sampler.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

namespace sheaf::render {
namespace {

// Collects the bands of all colors that a description has by name.
class BandCollector {
 public:
  std::vector<std::vector<NarrowBand>> found;

  void Add(const ColorSpec& color) {
    std::vector<NarrowBand> bands = sheaf::NarrowBandsOf(color);
    if (!bands.empty()) found.push_back(std::move(bands));
  }
  void Add(const ColorInput& input) { Add(input.value); }
  void Add(const FloatInput&) {}
  void Add(float) {}
  void Add(const RefractiveIndex& index) { Add(index.spectrum); }
  template <typename Color, size_t kCount>
  void Add(const Color (&colors)[kCount]) {
    for (const Color& color : colors) Add(color);
  }
  template <typename T>
  void Add(const std::optional<T>& value) {
    if (value.has_value()) AddAllOf(*value);
  }

  template <typename T>
  void AddAllOf(const T& t) {
    if constexpr (requires { t.reflectance; }) Add(t.reflectance);
    if constexpr (requires { t.transmittance; }) Add(t.transmittance);
    if constexpr (requires { t.eta; }) Add(t.eta);
    if constexpr (requires { t.k; }) Add(t.k);
    if constexpr (requires { t.color; }) Add(t.color);
    if constexpr (requires { t.base_color; }) Add(t.base_color);
    if constexpr (requires { t.specular_tint; }) Add(t.specular_tint);
    if constexpr (requires { t.sheen_color; }) Add(t.sheen_color);
    if constexpr (requires { t.attenuation_color; }) Add(t.attenuation_color);
    if constexpr (requires { t.emission; }) Add(t.emission);
    if constexpr (requires { t.conductor; }) AddAllOf(t.conductor);
    if constexpr (requires { t.radiance; }) Add(t.radiance);
    if constexpr (requires { t.intensity; }) Add(t.intensity);
    if constexpr (requires { t.sigma_a; }) Add(t.sigma_a);
    if constexpr (requires { t.sigma_s; }) Add(t.sigma_s);
    if constexpr (requires { t.free_path; }) Add(t.free_path);
  }
};

}  // namespace

std::vector<std::vector<NarrowBand>> NarrowBandsOf(const SceneDescription& scene) {
  BandCollector collector;
  const auto add = [&](const auto& part) { collector.AddAllOf(part); };
  for (const TextureDescription& texture : scene.textures) std::visit(add, texture.texture);
  for (const MaterialDescription& material : scene.materials) std::visit(add, material.material);
  for (const LightDescription& light : scene.lights) std::visit(add, light.light);
  for (const AreaLightDescription& light : scene.area_lights) add(light);
  for (const MediumDescription& medium : scene.media) add(medium);
  return std::move(collector.found);
}

WavelengthSampler::WavelengthSampler(const std::vector<std::vector<NarrowBand>>& spectra) {
  std::vector<double> ends;
  for (const std::vector<NarrowBand>& bands : spectra) {
    for (const NarrowBand& band : bands) ends.insert(ends.end(), {band.first_nm, band.last_nm});
  }
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  for (size_t i = 1; i < ends.size(); ++i) parts_.push_back({ends[i - 1], ends[i], 0, 0});
  for (const std::vector<NarrowBand>& bands : spectra) {
    double total = 0;
    for (const NarrowBand& band : bands) total += std::fabs(band.Integral());
    if (!(total > 0)) continue;
    for (const NarrowBand& band : bands) {
      const double pdf = std::fabs(band.Integral()) / (total * (band.last_nm - band.first_nm));
      auto part = std::lower_bound(parts_.begin(), parts_.end(), band.first_nm,
                                   [](const Part& p, double nm) { return p.first_nm < nm; });
      for (; part != parts_.end() && part->first_nm < band.last_nm; ++part) part->pdf += pdf;
    }
  }
  std::erase_if(parts_, [](const Part& part) { return !(part.pdf > 0); });
  double sum = 0;
  for (Part& part : parts_) part.probability = sum += part.pdf * (part.last_nm - part.first_nm);
  for (Part& part : parts_) {
    part.probability /= sum;
    part.pdf /= sum;
  }
}

double WavelengthSampler::PdfInBands(double nm) const {
  const auto part = std::lower_bound(parts_.begin(), parts_.end(), nm,
                                     [](const Part& p, double x) { return p.last_nm < x; });
  return part != parts_.end() && part->first_nm <= nm ? part->pdf : 0;
}

Wavelengths WavelengthSampler::SampleBands(float u) const {
  Wavelengths w;
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    float position = u + static_cast<float>(i) / kWavelengthCount;
    if (position >= 1) position -= 1;
    if (position < kBandShare) {
      const double at = static_cast<double>(position / kBandShare);
      const auto part =
          std::min(std::upper_bound(parts_.begin(), parts_.end(), at,
                                    [](double x, const Part& p) { return x < p.probability; }),
                   parts_.end() - 1);
      const double before = part == parts_.begin() ? 0 : (part - 1)->probability;
      const double nm = part->first_nm + (at - before) / part->pdf;
      w.nm[i] = static_cast<float>(std::clamp(nm, part->first_nm, part->last_nm));
    } else {
      w.nm[i] = Wavelengths::NmAt((position - kBandShare) / (1 - kBandShare));
    }
    w.pdf[i] = (1 - kBandShare) * Wavelengths::PdfOf(w.nm[i]) +
               kBandShare * static_cast<float>(PdfInBands(static_cast<double>(w.nm[i])));
  }
  return w;
}

}  // namespace sheaf::render
