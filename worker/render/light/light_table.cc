// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sampling and evaluation of lights. light_table_build.cc builds the table from the scene.
#include "worker/render/light/light_table.h"

#include <cmath>
#include <variant>

#include "common/math/elementary.h"
#include "worker/render/light/area_light_sampling.h"
#include "worker/render/light/light_radiance.h"
#include "worker/render/light/light_table_impl.h"
#include "worker/render/sampling/directions.h"

namespace sheaf::render {
namespace {

// Delta: a kind of light without size.
template <typename Color, typename Delta>
std::optional<LightSampleOf<Color>> Sample(const LightTable::Impl& impl, const Delta& light,
                                           const WavelengthsOf<Color>& wavelengths,
                                           float probability, [[maybe_unused]] Vec3f p) {
  LightSampleOf<Color> sample;
  sample.is_delta = true;
  sample.pdf = probability;
  if constexpr (Delta::kIsDistant) {
    sample.wi = light.to_light;
    sample.radiance = impl.ColorOfEmission(light.emission, wavelengths);
    sample.is_infinite = true;
  } else {
    const Vec3d to_light = light.position - ToDouble(p);
    const double d_squared = LengthSquared(to_light);
    if (!(d_squared > 0)) return std::nullopt;
    sample.wi = ToFloat(to_light / std::sqrt(d_squared));
    sample.p_light = ToFloat(light.position);
    sample.p_light_error = RoundingErrorOf(sample.p_light);
    sample.radiance = IntensityAlong<Color>(impl, light, -sample.wi, wavelengths) *
                      static_cast<float>(1 / d_squared);
  }
  return sample;
}

// Radiance as seen from p along the unit direction d.
template <typename Color>
Color RadianceFrom(const LightTable::Impl& impl, const InfiniteEmitter& light, Vec3f p, Vec3f d,
                   const WavelengthsOf<Color>& wavelengths) {
  if (light.portal && !(light.portal->Pdf(p, d) > 0)) return {};
  return RadianceAt<Color>(impl, light, light.PlaceOf(d), wavelengths);
}

// The pdf of the point, per solid angle at p. Not inline: every set of light traits has a call.
[[gnu::noinline]] double PdfOnTriangle(const TriangleEmitter& t, Vec3f p, Vec3f p_light) {
  return PdfTriangle(ViewEmitter(t, p), p, p_light);
}
[[gnu::noinline]] double PdfOnSphere(const SphereEmitter& s, Vec3f p) {
  const SphereView view = ViewEmitter(s, p);
  return view.visible ? view.pdf : 0;
}

}  // namespace

LightTable::LightTable() = default;
LightTable::~LightTable() = default;

bool LightTable::empty() const { return impl_->empty; }

template <TraitBits kMask>
std::optional<LightSampleOf<ColorOf<kMask>>> LightTable::SampleLights(
    const Impl& impl, Vec3f p, Vec3f n, float u_select, Vec2f u,
    const WavelengthsOf<ColorOf<kMask>>& wavelengths, const Preparation& preparation,
    LightQueryOf<kMask> query) {
  if (impl.empty) return std::nullopt;
  const std::optional<ChosenLight> chosen =
      impl.choice.Choose(p, n, u_select, SaltOf(u), RowOf(query));
  if (!chosen) return std::nullopt;
  return SampleOne<kMask>(impl, *chosen, p, n, u, wavelengths, preparation, query);
}

template <TraitBits kMask>
std::optional<LightSampleOf<ColorOf<kMask>>> LightTable::SampleChosenLight(
    const Impl& impl, const ChosenLight& chosen, Vec3f p, Vec3f n, Vec2f u,
    const WavelengthsOf<ColorOf<kMask>>& wavelengths, LightQueryOf<kMask> query) {
  return SampleOne<kMask>(impl, chosen, p, n, u, wavelengths, Prepare(impl, u), query);
}

std::optional<ChosenLight> LightTable::Choose(Vec3f p, float u_select, Vec2f u) const {
  if (impl_->empty) return std::nullopt;
  return impl_->choice.Choose(p, {}, u_select, SaltOf(u));
}

std::optional<ChosenLight> LightTable::Choose(Vec3f p, float u_select, Vec2f u,
                                              LightVisibilityRow row) const {
  if (impl_->empty) return std::nullopt;
  return impl_->choice.Choose(p, {}, u_select, SaltOf(u), row);
}

float LightTable::ChoiceProbability(uint32_t light, Vec3f p, Vec3f n) const {
  return impl_->choice.Probability(light, p, n);
}

float LightTable::ChoiceProbability(uint32_t light, Vec3f p, Vec3f n,
                                    LightVisibilityRow row) const {
  return impl_->choice.Probability(light, p, n, row);
}

const LightChoice& LightTable::choice() const { return impl_->choice; }

template <TraitBits kMask>
std::optional<LightSampleOf<ColorOf<kMask>>> LightTable::SampleOne(
    const Impl& impl, const ChosenLight& chosen, Vec3f p, Vec3f n, Vec2f u,
    const WavelengthsOf<ColorOf<kMask>>& wavelengths, const Preparation& preparation,
    [[maybe_unused]] LightQueryOf<kMask> query) {
  using Color = ColorOf<kMask>;
  const uint32_t light = chosen.light;
  std::optional<LightSampleOf<Color>> sample;  // Returned everywhere, so that it is not copied.
  const auto sample_area = [&](const auto& emitter) {
    const Color radiance = impl.ColorOfEmission(emitter.radiance, wavelengths);
    SampleEmitter(emitter, radiance, chosen.probability, p, u, &sample);
    if constexpr (Has(kMask, Trait::kTexturedEmission)) {
      if (sample) AddDetail<Color>(impl, light, wavelengths, &*sample);
    }
  };
  if (light < impl.first_delta()) {
    if constexpr (Has(kMask, Trait::kAreaLights)) {
      if (light < impl.first_sphere()) {
        sample_area(impl.triangles[light]);
      } else if constexpr (Has(kMask, Trait::kQuadrics)) {
        if (light < impl.first_disk()) {
          sample_area(impl.spheres[light - impl.first_sphere()]);
        } else {
          sample_area(impl.disks[light - impl.first_disk()]);
        }
      }
    }
  } else if (light < impl.first_infinite()) {
    if constexpr (Has(kMask, Trait::kDeltaLights)) {
      sample = impl.VisitDelta(light, [&](const auto& delta) {
        return render::Sample<Color>(impl, delta, wavelengths, chosen.probability, p);
      });
    }
  } else if constexpr (Has(kMask, Trait::kEnvironment)) {
    // Infinite lights share all directions, so a sample of one carries the sum of all.
    sample.emplace();
    const uint32_t index = light - impl.first_infinite();
    const InfiniteEmitter& infinite = impl.infinites[index];
    EnvironmentMap::Place place;
    float portal_pdf = 0;
    if (infinite.portal) {
      const SkyPortal::Sample through = infinite.portal->SampleFrom(p, u);
      if (!(through.pdf > 0)) {
        sample.reset();
        return sample;
      }
      portal_pdf = through.pdf;
      sample->wi = through.d;
      place = infinite.PlaceOf(through.d);
    } else if (infinite.map) {
      place = impl.HasOnlyOneMap() ? preparation.sky.place : infinite.map->Sample(u).place;
      sample->wi = infinite.DirectionOf(place);
    } else {
      sample->wi = UniformDirection(u);
    }
    // Before the load of the radiance completes.
    if (Dot(sample->wi, n) < 0) {
      sample.reset();
      return sample;
    }
    if (impl.HasOnlyOneMap()) {
      sample->radiance = RadianceAt<Color>(impl, infinite, place, wavelengths);
      sample->pdf = preparation.sky.pdf;
    } else {
      const EnvironmentValueOf<Color> value = FromInfinity<Color>(
          impl, p, n, sample->wi, wavelengths, {place, index, portal_pdf}, query);
      sample->radiance = value.radiance;
      sample->pdf = value.pdf;
    }
    sample->is_infinite = true;
  }
  if (!sample) return sample;
  sample->light = light;
  const bool usable =
      IsUsablePdf(sample->pdf) && IsFinite(sample->radiance) && !sample->radiance.IsBlack();
  if (!usable) sample.reset();
  return sample;
}

template <TraitBits kMask>
float LightTable::PdfOfEmitter(const Impl& impl, uint32_t emitter, Vec3f p, Vec3f n, Vec3f wi,
                               Vec3f p_light, LightQueryOf<kMask> query) {
  double shape_pdf = 0;
  if constexpr (Has(kMask, Trait::kAreaLights)) {
    if (emitter < impl.first_sphere()) {
      shape_pdf = PdfOnTriangle(impl.triangles[emitter], p, p_light);
    } else if constexpr (Has(kMask, Trait::kQuadrics)) {
      if (emitter < impl.first_disk()) {
        shape_pdf = PdfOnSphere(impl.spheres[emitter - impl.first_sphere()], p);
      } else {
        shape_pdf =
            PdfDisk(ViewEmitter(impl.disks[emitter - impl.first_disk()], p), p, wi, p_light);
      }
    }
  }
  const float pdf = PdfSolidAngle(shape_pdf, impl.choice.Probability(emitter, p, n, query));
  return IsUsablePdf(pdf) ? pdf : 0;
}

template <typename Color>
Color LightTable::EmitterRadiance(uint32_t emitter, Vec3f ng, Vec3f wo,
                                  const WavelengthsOf<Color>& wavelengths) const {
  const bool front = Dot(ng, wo) > 0;
  const auto radiance = [&](const auto& e, bool emits) {
    return e.two_sided || emits ? impl_->ColorOfEmission(e.radiance, wavelengths) : Color{};
  };
  if (emitter < impl_->first_sphere()) return radiance(impl_->triangles[emitter], front);
  if (emitter < impl_->first_disk()) {
    const SphereEmitter& s = impl_->spheres[emitter - impl_->first_sphere()];
    return radiance(s, front != s.inward);
  }
  return radiance(impl_->disks[emitter - impl_->first_disk()], front);
}
template Rgb LightTable::EmitterRadiance<Rgb>(uint32_t, Vec3f, Vec3f, const NoWavelengths&) const;
template Spectral LightTable::EmitterRadiance<Spectral>(uint32_t, Vec3f, Vec3f,
                                                        const Wavelengths&) const;

template <typename Color>
Color LightTable::TexturedRadiance(uint32_t emitter, Vec3f ng, Vec3f wo, Vec2f uv,
                                   const WavelengthsOf<Color>& wavelengths) const {
  const Color radiance = EmitterRadiance<Color>(emitter, ng, wo, wavelengths);
  const EmissionDetail* detail = impl_->DetailOf(emitter);
  if (detail == nullptr || detail->map == kNone || radiance.IsBlack()) return radiance;
  return RadianceOfMap<Color>(*impl_, *detail, uv, wavelengths);
}
template Rgb LightTable::TexturedRadiance<Rgb>(uint32_t, Vec3f, Vec3f, Vec2f,
                                               const NoWavelengths&) const;
template Spectral LightTable::TexturedRadiance<Spectral>(uint32_t, Vec3f, Vec3f, Vec2f,
                                                         const Wavelengths&) const;

// With several lights, the chosen light is not known this early.
LightTable::Preparation LightTable::Prepare(const Impl& impl, Vec2f u) {
  if (!impl.HasOnlyOneMap()) return {};
  return {impl.infinites[0].map->Sample(u)};
}

EnvironmentMap::Place LightTable::LocateInFirst(const Impl& impl, Vec3f d) {
  if (impl.infinites.empty()) return {};
  return impl.infinites[0].PlaceOf(d);
}

template <typename Color>
Color LightTable::RadianceFromInfinity(const Impl& impl, Vec3f p, Vec3f d,
                                       const WavelengthsOf<Color>& wavelengths) {
  Color sum;
  for (const InfiniteEmitter& light : impl.infinites) {
    sum += RadianceFrom<Color>(impl, light, p, d, wavelengths);
  }
  return sum;
}

uint32_t LightTable::first_infinite() const { return impl_->first_infinite(); }

template <typename Color>
Color LightTable::RadianceOfInfinite(uint32_t light, Vec3f p, Vec3f d,
                                     const WavelengthsOf<Color>& wavelengths) const {
  const InfiniteEmitter& infinite = impl_->infinites[light - impl_->first_infinite()];
  return RadianceFrom<Color>(*impl_, infinite, p, d, wavelengths);
}
template Rgb LightTable::RadianceOfInfinite<Rgb>(uint32_t, Vec3f, Vec3f,
                                                 const NoWavelengths&) const;
template Spectral LightTable::RadianceOfInfinite<Spectral>(uint32_t, Vec3f, Vec3f,
                                                           const Wavelengths&) const;

template <typename Color, typename Query>
EnvironmentValueOf<Color> LightTable::FromInfinity(const Impl& impl, Vec3f p, Vec3f n, Vec3f d,
                                                   const WavelengthsOf<Color>& wavelengths,
                                                   const Located& located, Query query) {
  EnvironmentValueOf<Color> value;
  for (uint32_t i = 0; i < impl.infinites.size(); ++i) {
    const InfiniteEmitter& light = impl.infinites[i];
    const bool is_located = i == located.light;
    double pdf = 0;
    if (light.portal) {
      pdf = static_cast<double>(is_located && located.portal_pdf > 0 ? located.portal_pdf
                                                                     : light.portal->Pdf(p, d));
      if (!(pdf > 0)) continue;
    }
    const EnvironmentMap::Place here = is_located ? located.place : light.PlaceOf(d);
    value.radiance += RadianceAt<Color>(impl, light, here, wavelengths);
    if (!light.portal) pdf = light.Pdf(here);
    value.pdf +=
        PdfSolidAngle(pdf, impl.choice.Probability(impl.first_infinite() + i, p, n, query));
  }
  return value;
}

uint32_t LightTable::GroupOf(uint32_t light) const { return impl_->group_of_light[light]; }

template <typename Color>
void LightTable::AddByGroup(Vec3f p, Vec3f d, const WavelengthsOf<Color>& wavelengths,
                            const Color& weight, const Color& light,
                            std::vector<Color>* groups) const {
  if (impl_->infinites.empty()) return;  // Variants with environments also render scenes without.
  const auto group_of = [this](size_t i) {
    return impl_->group_of_light[impl_->first_infinite() + i];
  };
  Color rest = light;
  for (size_t i = 1; i < impl_->infinites.size(); ++i) {
    if (group_of(i) == group_of(0)) continue;
    const Color own = weight * RadianceFrom<Color>(*impl_, impl_->infinites[i], p, d, wavelengths);
    (*groups)[group_of(i)] += own;
    rest += own * -1.0f;
  }
  (*groups)[group_of(0)] += rest;
}
template void LightTable::AddByGroup<Rgb>(Vec3f, Vec3f, const NoWavelengths&, const Rgb&,
                                          const Rgb&, std::vector<Rgb>*) const;
template void LightTable::AddByGroup<Spectral>(Vec3f, Vec3f, const Wavelengths&, const Spectral&,
                                               const Spectral&, std::vector<Spectral>*) const;

// The header forwards to these: one instantiation for each combination of kLightTraits.
#define SHEAF_INSTANTIATE_FOR(mask) \
  SHEAF_INSTANTIATE_IN_COLOR(mask)  \
  SHEAF_INSTANTIATE_IN_COLOR((mask) | static_cast<TraitBits>(Trait::kSpectral))
#define SHEAF_INSTANTIATE_IN_COLOR(mask)                                                           \
  template std::optional<LightSampleOf<ColorOf<(mask)>>> LightTable::SampleLights<(mask)>(         \
      const Impl&, Vec3f, Vec3f, float, Vec2f, const WavelengthsOf<ColorOf<(mask)>>&,              \
      const Preparation&, LightQueryOf<(mask)>);                                                   \
  template std::optional<LightSampleOf<ColorOf<(mask)>>> LightTable::SampleChosenLight<(mask)>(    \
      const Impl&, const ChosenLight&, Vec3f, Vec3f, Vec2f, const WavelengthsOf<ColorOf<(mask)>>&, \
      LightQueryOf<(mask)>);                                                                       \
  template float LightTable::PdfOfEmitter<(mask)>(const Impl&, uint32_t, Vec3f, Vec3f, Vec3f,      \
                                                  Vec3f, LightQueryOf<(mask)>);
#define SHEAF_INSTANTIATE_WITH(mask)                                           \
  SHEAF_INSTANTIATE_FOR(mask)                                                  \
  SHEAF_INSTANTIATE_FOR((mask) | static_cast<TraitBits>(Trait::kEnvironment))  \
  SHEAF_INSTANTIATE_FOR((mask) | static_cast<TraitBits>(Trait::kDeltaLights))  \
  SHEAF_INSTANTIATE_FOR((mask) | static_cast<TraitBits>(Trait::kEnvironment) | \
                        static_cast<TraitBits>(Trait::kDeltaLights))
SHEAF_INSTANTIATE_WITH(0u)
SHEAF_INSTANTIATE_WITH(static_cast<TraitBits>(Trait::kAreaLights))
SHEAF_INSTANTIATE_WITH(static_cast<TraitBits>(Trait::kQuadrics))
SHEAF_INSTANTIATE_WITH(static_cast<TraitBits>(Trait::kAreaLights) |
                       static_cast<TraitBits>(Trait::kQuadrics))
// Guided variants support every kind of light with a position.
SHEAF_INSTANTIATE_FOR(TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kDeltaLights,
                               Trait::kGuiding))
SHEAF_INSTANTIATE_FOR(TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kDeltaLights,
                               Trait::kEnvironment, Trait::kGuiding))
SHEAF_INSTANTIATE_FOR(TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kDeltaLights,
                               Trait::kLearnedLights))
SHEAF_INSTANTIATE_FOR(TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kDeltaLights,
                               Trait::kEnvironment, Trait::kLearnedLights))
// So do those that split the lights, which have no wavelengths.
SHEAF_INSTANTIATE_IN_COLOR(TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kDeltaLights,
                                    Trait::kLightSplits))
SHEAF_INSTANTIATE_IN_COLOR(TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kDeltaLights,
                                    Trait::kEnvironment, Trait::kLightSplits))
// Varying emission is rare: its variants support every kind of light, guiding and splits.
SHEAF_INSTANTIATE_FOR(LightTable::kLightTraits & ~static_cast<TraitBits>(Trait::kSpectral))
#undef SHEAF_INSTANTIATE_WITH
#undef SHEAF_INSTANTIATE_FOR
#undef SHEAF_INSTANTIATE_IN_COLOR

#define SHEAF_INSTANTIATE_INFINITY(color)                                              \
  template color LightTable::RadianceFromInfinity<color>(const Impl&, Vec3f, Vec3f,    \
                                                         const WavelengthsOf<color>&); \
  SHEAF_INSTANTIATE_FROM_INFINITY(color, NoLightVisibilityRow)                         \
  SHEAF_INSTANTIATE_FROM_INFINITY(color, LightVisibilityRow)                           \
  SHEAF_INSTANTIATE_FROM_INFINITY(color, ProductRow)                                   \
  SHEAF_INSTANTIATE_FROM_INFINITY(color, SplitLightQuery<NoLightVisibilityRow>)        \
  SHEAF_INSTANTIATE_FROM_INFINITY(color, SplitLightQuery<LightVisibilityRow>)          \
  SHEAF_INSTANTIATE_FROM_INFINITY(color, SplitLightQuery<ProductRow>)
#define SHEAF_INSTANTIATE_FROM_INFINITY(color, query)                        \
  template EnvironmentValueOf<color> LightTable::FromInfinity<color, query>( \
      const Impl&, Vec3f, Vec3f, Vec3f, const WavelengthsOf<color>&, const Located&, query);
SHEAF_INSTANTIATE_INFINITY(Rgb)
SHEAF_INSTANTIATE_INFINITY(Spectral)
#undef SHEAF_INSTANTIATE_INFINITY
#undef SHEAF_INSTANTIATE_FROM_INFINITY

}  // namespace sheaf::render
