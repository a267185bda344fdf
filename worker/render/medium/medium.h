// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MediumTable: the scene's participating media in the form that transport uses: their absorption,
// scattering and emission per scene unit, and whether they are bounded in all directions.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/light/light_table.h"
#include "worker/render/medium/color_parts.h"
#include "worker/render/medium/free_flight.h"
#include "worker/render/medium/glow_lights.h"
#include "worker/render/medium/line_choice.h"
#include "worker/render/medium/medium_glow.h"
#include "worker/render/medium/medium_set.h"
#include "worker/render/medium/medium_velocities.h"
#include "worker/render/medium/phase_function.h"
#include "worker/render/medium/varying_medium.h"

namespace sheaf::render {

class MediumTable {
 public:
  struct Options {
    bool spectral = false;    // MixOf may be called for Spectral too.
    int thread_count = 1;     // For reading and bounding grids.
    bool bound_once = false;  // VaryingMedium::Placement::bound_once.
  };
  // Errors: those of the grids' files; kInvalidArgument, with the location of the medium, for media
  // that cannot be rendered; kResourceExhausted over kMediaMax.
  static absl::StatusOr<std::unique_ptr<MediumTable>> Build(const SceneDescription& scene,
                                                            const SceneGeometry& geometry,
                                                            MediumVelocities velocities,
                                                            FileSource& files,
                                                            const Options& options);

  // All other functions use this index: media are sorted by their properties, so that their order
  // in the scene file changes no bit. medium: an index in SceneDescription::media.
  uint16_t IndexOf(int32_t medium) const { return index_of_[static_cast<size_t>(medium)]; }
  // The media that surround the camera.
  const MediumSet& camera_media() const { return camera_media_; }

  // Thread safety: any number of threads at once. Properties of the homogeneous media;
  // MediumMix::varies says that there are heterogeneous ones. paint: fraction of the subsurface
  // scattering that is left, the rest is absorbed; null: all.
  template <typename Color>
  MediumMix<Color> MixOf(const MediumSet& media, const WavelengthsOf<Color>& wavelengths,
                         MediumForm form, const Color* paint = nullptr) const;
  // Requires: mix is MixOf the same arguments, and scatters. throughput weights the media that
  // overlap.
  template <typename Color>
  PhaseMix<Color> PhaseOf(const MediumSet& media, const MediumMix<Color>& mix,
                          const Color& throughput, const WavelengthsOf<Color>& wavelengths,
                          const Color* paint = nullptr) const;

  // --- Heterogeneous media. Each has one density or, if it is a grid of colors, one for each of
  // the components whose sum is the color.
  struct PartId {
    uint16_t medium, part;
  };
  class PartList {
   public:
    uint32_t size() const { return size_; }
    PartId operator[](uint32_t i) const { return parts_[i]; }

   private:
    friend class MediumTable;
    uint32_t size_ = 0;
    // Event streams identify parts by 8 bits.
    static_assert(kMediaAtOnceMax * kMediumPartsMax < 255);
    std::array<PartId, kMediaAtOnceMax * kMediumPartsMax> parts_;
  };
  PartList PartsOf(const MediumSet& media) const {
    PartList list;
    for (const uint16_t medium : media) {
      for (uint16_t part = 0; part < media_[medium].parts.size(); ++part) {
        list.parts_[list.size_++] = {medium, part};
      }
    }
    return list;
  }
  const VaryingMedium& DensityOf(PartId id) const { return PartAt(id).density; }
  // Null where the part does not emit.
  const MediumGlow* GlowOf(PartId id) const {
    return PartAt(id).kind == Part::Kind::kScatters ? nullptr : media_[id.medium].glow.get();
  }
  // All heterogeneous media that emit.
  const GlowLights& glow_lights() const { return glow_lights_; }
  // For a density of 1, per scene unit.
  template <typename Color>
  struct Coefficients {
    Color sigma_t, sigma_s, sigma_a;
  };
  template <typename Color>
  Coefficients<Color> CoefficientsOf(PartId id, const WavelengthsOf<Color>& wavelengths,
                                     MediumForm form) const;
  // At a point of render space. time: as for VaryingMedium.
  template <typename Color, typename Time>
  Coefficients<Color> CoefficientsAt(uint16_t medium, Vec3d p, Time time,
                                     const WavelengthsOf<Color>& wavelengths,
                                     MediumForm form) const;
  float PhaseAsymmetryOf(uint16_t index, MediumForm form) const { return media_[index].In(form).g; }

  // --- Line sampling in heterogeneous media: medium_lines.cc. Decides for each such medium whether
  // lines through it gather light; none does by default. Call once, before the table is used.
  void ChooseLines(const LightTable& lights, LinesInVarying lines);
  bool Gathers(uint16_t medium) const { return media_[medium].gathers; }
  bool gathers_always() const { return gathers_always_; }  // Whether or not it pays off.
  // The part of o + t d, t in [0, length], that passes through gathering heterogeneous media, and
  // their mean extinction over their boxes; d: unit. Empty where begin == end.
  struct LinePart {
    double begin = 0, end = 0, extinction = 0;
  };
  LinePart PartOfLine(const MediumSet& media, Vec3d o, Vec3d d, double length) const;
  uint64_t memory_bytes() const;

 private:
  struct Part {
    // Its effect on light; a color's density does only one of the two, for one color component.
    enum class Kind : uint8_t { kBoth, kAbsorbs, kScatters };
    VaryingMedium density;
    Kind kind = Kind::kBoth;
    ColorPart color = ColorPart::kGrey;
  };
  const Part& PartAt(PartId id) const { return media_[id.medium].parts[id.part]; }

  // Factor of sigma_s and mean cosine in one form of a medium.
  struct Scattering {
    float share = 1, g = 0;
  };
  struct Medium {
    const Scattering& In(MediumForm form) const { return scattering[static_cast<size_t>(form)]; }

    Rgb sigma_a, sigma_s, radiance;  // Scaled, per scene unit.
    SpectralColor sigma_a_spectrum, sigma_s_spectrum, radiance_spectrum;
    float scale = 1, radiance_scale = 1;   // Factors of the spectra.
    std::array<Scattering, 2> scattering;  // By MediumForm.
    bool emits = false;
    bool is_bounded = false;
    std::vector<Part> parts;                    // Empty if homogeneous.
    std::unique_ptr<const MediumGlow> glow;     // If heterogeneous.
    bool gathers = false;                       // As in MediumMix.
    double extinction = 0;                      // If it gathers: the mean over its boxes.
    bool is_matter = false, is_hidden = false;  // As in MediumMix.
  };
  // The motion of a medium while the shutter is open, if any.
  struct Movement {
    std::optional<VolumeGrid> velocities;
    double duration = 0;  // As for VolumeMotion::Make.
  };
  // Errors: see Build.
  static absl::StatusOr<std::vector<Part>> MakeParts(const std::string& where,
                                                     const MediumDescription& description,
                                                     const Affine& placement, Movement movement,
                                                     FileSource& files, const Options& options);
  // Null where the medium does not emit. Errors: see Build.
  static absl::StatusOr<std::unique_ptr<const MediumGlow>> MakeGlow(
      const std::string& where, const MediumDescription& description, const Affine& placement,
      FileSource& files, const Options& options);
  // For subsurface media given by their reflectance: converts each wavelength.
  static void SetSpectra(const MatterReflectance& reflectance, float g, Medium* medium);
  GlowLights FindGlowLights() const;
  template <typename Color>
  static Color Evaluate(Rgb rgb, const SpectralColor& spectrum, float scale,
                        const WavelengthsOf<Color>& wavelengths) {
    if constexpr (std::is_same_v<Color, Spectral>) {
      return spectrum.At(wavelengths) * scale;
    } else {
      return rgb;
    }
  }

  std::vector<Medium> media_;
  std::vector<uint16_t> index_of_;
  MediumSet camera_media_;
  GlowLights glow_lights_;
  bool gathers_always_ = false;
};

template <typename Color>
MediumMix<Color> MediumTable::MixOf(const MediumSet& media, const WavelengthsOf<Color>& wavelengths,
                                    MediumForm form, const Color* paint) const {
  constexpr size_t kCount = kComponentCount<Color>;
  // Sums in double are the same in any order, except for coefficients that differ by a factor of
  // about 2^29.
  std::array<double, kCount> sigma_t{}, sigma_s{}, emission{};
  MediumMix<Color> mix;
  mix.form = form;
  for (const uint16_t index : media) {
    const Medium& medium = media_[index];
    mix.is_bounded = mix.is_bounded || medium.is_bounded;
    mix.is_matter = mix.is_matter || medium.is_matter;
    mix.is_hidden = mix.is_hidden || medium.is_hidden;
    if (!medium.parts.empty()) {
      mix.varies = true;
      mix.glows = mix.glows || medium.glow != nullptr;
      mix.gathers = mix.gathers || medium.gathers;
      continue;
    }
    Color a = Evaluate<Color>(medium.sigma_a, medium.sigma_a_spectrum, medium.scale, wavelengths);
    Color s = Evaluate<Color>(medium.sigma_s, medium.sigma_s_spectrum, medium.scale, wavelengths);
    if (paint != nullptr && medium.is_matter) {
      const Color kept = s * *paint;
      a = MakeColor<Color>([&](size_t i) { return a[i] + (s[i] - kept[i]); });
      s = kept;
    }
    s *= medium.In(form).share;
    for (size_t i = 0; i < kCount; ++i) {
      sigma_t[i] += static_cast<double>(a[i]) + static_cast<double>(s[i]);
      sigma_s[i] += static_cast<double>(s[i]);
    }
    if (!medium.emits) continue;
    const Color radiance = Evaluate<Color>(medium.radiance, medium.radiance_spectrum,
                                           medium.radiance_scale, wavelengths);
    for (size_t i = 0; i < kCount; ++i) {
      emission[i] += static_cast<double>(radiance[i]) * static_cast<double>(a[i]);
    }
  }
  for (size_t i = 0; i < kCount; ++i) {
    mix.sigma_t[i] = static_cast<float>(sigma_t[i]);
    mix.sigma_s[i] = static_cast<float>(sigma_s[i]);
    mix.emission[i] = static_cast<float>(emission[i]);
    mix.is_grey =
        mix.is_grey && mix.sigma_t[i] == mix.sigma_t[0] && mix.sigma_s[i] == mix.sigma_s[0];
  }
  mix.scatters = !mix.sigma_s.IsBlack();
  return mix;
}

template <typename Color>
PhaseMix<Color> MediumTable::PhaseOf(const MediumSet& media, const MediumMix<Color>& mix,
                                     const Color& throughput,
                                     const WavelengthsOf<Color>& wavelengths,
                                     const Color* paint) const {
  PhaseMix<Color> phase;
  if (media.size() == 1) {
    phase.Add(media_[*media.begin()].In(mix.form).g, Color::Grey(1), 1);
    return phase;
  }
  const Color chosen_by = internal::ComponentShares(throughput);
  for (const uint16_t index : media) {
    const Medium& medium = media_[index];
    if (!medium.parts.empty()) continue;
    const auto [kept, g] = medium.In(mix.form);
    Color s =
        Evaluate<Color>(medium.sigma_s, medium.sigma_s_spectrum, medium.scale, wavelengths) * kept;
    if (paint != nullptr && medium.is_matter) s *= *paint;
    float share = 0;
    const Color part = MakeColor<Color>([&](size_t i) {
      const float of_all = mix.sigma_s[i] > 0 ? s[i] / mix.sigma_s[i] : 0;
      share += of_all * chosen_by[i];
      return of_all;
    });
    if (share > 0) phase.Add(g, part, share);
  }
  return phase;
}

template <typename Color>
MediumTable::Coefficients<Color> MediumTable::CoefficientsOf(
    PartId id, const WavelengthsOf<Color>& wavelengths, MediumForm form) const {
  const Medium& medium = media_[id.medium];
  const Part& part = PartAt(id);
  const float kept = medium.In(form).share;
  if (part.kind != Part::Kind::kBoth) {
    const Color sigma = ShareOf<Color>(part.color, wavelengths) * medium.scale;
    if (part.kind == Part::Kind::kScatters) return {sigma * kept, sigma * kept, {}};
    return {sigma, {}, sigma};
  }
  const Color s =
      Evaluate<Color>(medium.sigma_s, medium.sigma_s_spectrum, medium.scale, wavelengths) * kept;
  const Color a =
      Evaluate<Color>(medium.sigma_a, medium.sigma_a_spectrum, medium.scale, wavelengths);
  return {s + a, s, a};
}

template <typename Color, typename Time>
MediumTable::Coefficients<Color> MediumTable::CoefficientsAt(
    uint16_t medium, Vec3d p, Time time, const WavelengthsOf<Color>& wavelengths,
    MediumForm form) const {
  Coefficients<Color> sum;
  for (uint16_t part = 0; part < media_[medium].parts.size(); ++part) {
    const auto its = CoefficientsOf<Color>({medium, part}, wavelengths, form);
    const auto density = static_cast<float>(DensityOf({medium, part}).DensityAt(p, time));
    sum.sigma_t += its.sigma_t * density;
    sum.sigma_s += its.sigma_s * density;
    sum.sigma_a += its.sigma_a * density;
  }
  return sum;
}

}  // namespace sheaf::render
