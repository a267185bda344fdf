// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rays of lights by their places, and the places of rays.
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "common/math/frame.h"
#include "worker/render/light/area_light_sampling.h"
#include "worker/render/light/light_emission.h"
#include "worker/render/light/light_radiance.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

constexpr double kPerSteradian = 1 / (4 * kPi);

// Axes of a plane and of its normal.
struct Axes {
  Vec3d x, y, z;
};
Axes AxesAbout(Vec3d z, Vec3d x) { return {x, Cross(z, x), z}; }
// Not from the normal alone: nearly equal normals can have other axes (Frame::FromNormal).
Axes AxesOfEmitter(const TriangleEmitter& t) {
  const Vec3d e1 = ToDouble(t.v1) - ToDouble(t.v0), e2 = ToDouble(t.v2) - ToDouble(t.v0);
  return AxesAbout(Normalize(Cross(e1, e2)), Normalize(e1));
}
Axes AxesOfEmitter(const DiskEmitter& d) { return AxesAbout(d.normal, d.axis_x); }
Axes AxesOfRay(Vec3f w) {
  const Frame frame = Frame::FromNormal(w);
  return {ToDouble(frame.t), ToDouble(frame.b), ToDouble(w)};
}

Vec2d Clamped(Vec2d v) {
  return {std::clamp(v.x, 0.0, kPlaceMost), std::clamp(v.y, 0.0, kPlaceMost)};
}
EmissionPlace PlaceAt(Vec2d position, Vec2d direction) {
  position = Clamped(position);
  direction = Clamped(direction);
  return {{position.x, position.y, direction.x, direction.y}};
}
Vec2d SphereToSquare(Vec3f w) {
  const Vec2f square = EqualAreaSphereToSquare(w);
  return {static_cast<double>(square.x), static_cast<double>(square.y)};
}

// --- Sides: two-sided surfaces have one in each half of an axis ----------------------------------

struct OnSide {
  double along = 0;
  bool is_below = false;
};
OnSide SideOf(double u, bool inward, bool two_sided) {
  if (!two_sided) return {u, inward};
  const bool is_below = u >= 0.5;
  return {is_below ? 2 * u - 1 : 2 * u, is_below};
}
double WithSide(double along, bool is_below, bool two_sided) {
  if (!two_sided) return along;
  return 0.5 * std::clamp(along, 0.0, kPlaceMost) + (is_below ? 0.5 : 0);
}

// --- Flat emitters -------------------------------------------------------------------------------

// As SampleArea of a triangle: b2 / (b1 + b2) and the square of that sum are uniform.
ShapePoint PointOn(const TriangleEmitter& t, const Axes& axes, Vec2d u) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const double root = std::sqrt(u.x), b2 = u.y * root;
  return {{}, v0 + (root - b2) * e1 + b2 * e2, axes.z};
}
Vec2d PositionOn(const TriangleEmitter& t, const Axes&, Vec3d p) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0, q = p - v0;
  const Vec3d normal = Cross(e1, e2);
  const double square = LengthSquared(normal);
  const double b1 = Dot(Cross(q, e2), normal) / square, b2 = Dot(Cross(e1, q), normal) / square;
  const double root = b1 + b2;
  return {root * std::fabs(root), root > 0 ? b2 / root : 0};
}
ShapePoint PointOn(const DiskEmitter& d, const Axes& axes, Vec2d u) {
  const Vec2d unit = SquareToDisk(u);
  const double inner = d.inner_radius * d.inner_radius, square = unit.x * unit.x + unit.y * unit.y;
  const double r = std::sqrt(inner + square * (d.radius * d.radius - inner));
  const double scale = square > 0 ? r / std::sqrt(square) : 0;
  return {{},
          d.center + (scale * unit.x) * axes.x + (scale * unit.y) * axes.y +
              (square > 0 ? Vec3d{} : r * axes.x),
          d.normal};
}
Vec2d PositionOn(const DiskEmitter& d, const Axes& axes, Vec3d p) {
  const Vec3d q = p - d.center;
  const double x = Dot(q, axes.x), y = Dot(q, axes.y), square = x * x + y * y;
  const double inner = d.inner_radius * d.inner_radius;
  if (!(square > 0)) return {0.5, 0.5};
  const double unit =
      std::sqrt(std::clamp((square - inner) / (d.radius * d.radius - inner), 0.0, 1.0) / square);
  return DiskToSquare({unit * x, unit * y});
}

// Directions about the normal by the cosine.
Vec3f DirectionAbout(const Axes& axes, bool is_below, Vec2d u) {
  const Vec2d disk = SquareToDisk(u);
  const double z = std::sqrt(std::max(0.0, 1 - disk.x * disk.x - disk.y * disk.y));
  return ToFloat(Normalize(disk.x * axes.x + disk.y * axes.y + (is_below ? -z : z) * axes.z));
}
Vec2d DirectionOf(const Axes& axes, Vec3d w) {
  return DiskToSquare({Dot(w, axes.x), Dot(w, axes.y)});
}

template <typename Flat>
EmissionPlace PlaceOfFlat(const Flat& emitter, Vec3d p, Vec3d n, Vec3d w) {
  const Axes axes = AxesOfEmitter(emitter);
  Vec2d direction = DirectionOf(axes, w);
  direction.x = WithSide(direction.x, Dot(n, w) < 0, emitter.two_sided);
  return PlaceAt(PositionOn(emitter, axes, p), direction);
}

// --- Spheres: the point is where a line of the ray's direction meets the side that emits ---------

EmissionPlace PlaceOfSphere(const SphereEmitter& s, Vec3d n, Vec3f w) {
  const Axes axes = AxesOfRay(w);
  Vec2d position = DiskToSquare({Dot(n, axes.x), Dot(n, axes.y)});
  position.x = WithSide(position.x, Dot(n, axes.z) < 0, s.two_sided);
  return PlaceAt(position, SphereToSquare(w));
}

Axes AxesOfPortal(const SkyPortal& portal) { return AxesAbout(portal.Axis(), portal.AxisX()); }

}  // namespace

EmissionAxes LightEmission::AxesOf(uint32_t light) const {
  const LightTable::Impl& impl = lights_->impl();
  if (light == lights_->light_count()) return {false, true};
  if (light < impl.first_delta() || light >= impl.first_infinite()) return {true, true};
  const bool is_distant = IsDistant(impl.deltas[light - impl.first_delta()]);
  return {is_distant, !is_distant};
}

template <typename Color>
void LightEmission::PlaceOnSurface(uint32_t light, const EmissionPlace& place,
                                   const WavelengthsOf<Color>& wavelengths,
                                   EmittedRayOf<Color>* ray) const {
  const LightTable::Impl& impl = lights_->impl();
  LightSampleOf<Color> point;
  impl.VisitSurface(light, [&](const auto& emitter) {
    const auto radiance = impl.ColorOfEmission(emitter.radiance, wavelengths);
    if constexpr (std::is_same_v<std::decay_t<decltype(emitter)>, SphereEmitter>) {
      ray->w = ToFloat(EqualAreaSquareToSphere(place.direction()));
      const OnSide side = SideOf(place.u[0], emitter.inward, emitter.two_sided);
      const Vec2d disk = SquareToDisk({side.along, place.u[1]});
      const double z = std::sqrt(std::max(0.0, 1 - disk.x * disk.x - disk.y * disk.y));
      const Axes axes = AxesOfRay(ray->w);
      const Vec3d n =
          Normalize(disk.x * axes.x + disk.y * axes.y + (side.is_below ? -z : z) * axes.z);
      point = AreaSample(ShapePoint{{}, emitter.center + emitter.radius * n, n}, radiance);
    } else {
      const Axes axes = AxesOfEmitter(emitter);
      const OnSide side = SideOf(place.u[2], emitter.IsInward(), emitter.two_sided);
      ray->w = DirectionAbout(axes, side.is_below, {side.along, place.u[3]});
      point = AreaSample(PointOn(emitter, axes, place.position()), radiance);
    }
  });
  BeginAt<Color>(impl, light, wavelengths, point, ray);
}

template <typename Color>
void LightEmission::PlaceOnDisk(Vec2d position, EmittedRayOf<Color>* ray) const {
  const Axes axes = AxesOfRay(ray->w);
  const Vec2d disk = SquareToDisk(position);
  ray->p = StartBefore(center_ + (radius_ * disk.x) * axes.x + (radius_ * disk.y) * axes.y, ray->w);
}

template <typename Color>
std::optional<EmittedRayOf<Color>> LightEmission::RayAt(
    uint32_t light, const EmissionPlace& place, const WavelengthsOf<Color>& wavelengths) const {
  const LightTable::Impl& impl = lights_->impl();
  EmittedRayOf<Color> ray;
  ray.light = light;
  ray.pdf = PlaceDensity(light);
  if (light < impl.first_delta()) {
    PlaceOnSurface<Color>(light, place, wavelengths, &ray);
    ray.pdf *= std::fabs(Dot(ToDouble(ray.n), ToDouble(ray.w)));
  } else if (light < impl.first_infinite()) {
    impl.VisitDelta(light, [&](const auto& delta) {
      if constexpr (std::decay_t<decltype(delta)>::kIsDistant) {
        ray.w = -delta.to_light;
        PlaceOnDisk(place.position(), &ray);
        ray.power = impl.ColorOfEmission(delta.emission, wavelengths);
        ray.is_infinite = true;
      } else {
        ray.w = ToFloat(EqualAreaSquareToSphere(place.direction()));
        ray.p = ToFloat(delta.position);
        ray.power = IntensityAlong<Color>(impl, delta, ray.w, wavelengths);
      }
    });
    ray.p_error = RoundingErrorOf(ray.p);
  } else {
    const InfiniteEmitter& infinite = impl.infinites[light - impl.first_infinite()];
    if (infinite.portal) {
      ray.w = -DirectionAbout(AxesOfPortal(*infinite.portal), false, place.direction());
      ray.p = StartBefore(infinite.portal->PointAt(place.position()), ray.w);
    } else {
      ray.w = ToFloat(EqualAreaSquareToSphere(place.direction()));
      PlaceOnDisk(place.position(), &ray);
    }
    ray.power = RadianceAt<Color>(impl, infinite, infinite.PlaceOf(-ray.w), wavelengths);
    ray.p_error = RoundingErrorOf(ray.p);
    ray.is_infinite = true;
  }
  const bool is_usable =
      ray.pdf > 0 && std::isfinite(ray.pdf) && IsFinite(ray.power) && !ray.power.IsBlack();
  return is_usable ? std::optional(ray) : std::nullopt;
}
template std::optional<EmittedRayOf<Rgb>> LightEmission::RayAt<Rgb>(uint32_t, const EmissionPlace&,
                                                                    const NoWavelengths&) const;
template std::optional<EmittedRayOf<Spectral>> LightEmission::RayAt<Spectral>(
    uint32_t, const EmissionPlace&, const Wavelengths&) const;

EmissionPlace LightEmission::PlaceOfRay(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n,
                                        Vec3f w) const {
  const LightTable::Impl& impl = lights_->impl();
  if (light < impl.first_delta()) {
    return impl.VisitSurface(light, [&](const auto& emitter) {
      if constexpr (std::is_same_v<std::decay_t<decltype(emitter)>, SphereEmitter>) {
        return PlaceOfSphere(emitter, ToDouble(n), w);
      } else {
        return PlaceOfFlat(emitter, ToDouble(p_light), ToDouble(n), ToDouble(w));
      }
    });
  }
  const EmissionAxes axes = AxesOf(light);
  if (!axes.position) return PlaceAt({0.5, 0.5}, SphereToSquare(w));
  if (light >= impl.first_infinite()) {
    const InfiniteEmitter& infinite = impl.infinites[light - impl.first_infinite()];
    if (infinite.portal) {
      return PlaceAt(infinite.portal->Meets(ToDouble(p), ToDouble(w)),
                     DirectionOf(AxesOfPortal(*infinite.portal), -ToDouble(w)));
    }
  }
  const Axes ray = AxesOfRay(w);
  const Vec3d q = (ToDouble(p) - center_) / radius_;
  return PlaceAt(DiskToSquare({Dot(q, ray.x), Dot(q, ray.y)}),
                 axes.direction ? SphereToSquare(w) : Vec2d{0.5, 0.5});
}

double LightEmission::PlaceDensity(uint32_t light) const {
  const LightTable::Impl& impl = lights_->impl();
  if (light < impl.first_delta()) {
    return impl.VisitSurface(light, [](const auto& emitter) {
      return 1 / (kPi * emitter.Area() * (emitter.two_sided ? 2 : 1));
    });
  }
  if (light < impl.first_infinite()) {
    const bool is_distant = IsDistant(impl.deltas[light - impl.first_delta()]);
    return is_distant ? 1 / CrossSection() : kPerSteradian;
  }
  const InfiniteEmitter& infinite = impl.infinites[light - impl.first_infinite()];
  return infinite.portal ? 1 / (kPi * infinite.portal->Area()) : kPerSteradian / CrossSection();
}

double LightEmission::OwnDensity(uint32_t light, Vec3f w) const {
  const LightTable::Impl& impl = lights_->impl();
  if (light < impl.first_delta() || light == lights_->light_count()) return 1;
  if (light < impl.first_infinite()) {
    return impl.VisitDelta(light, [&](const auto& delta) {
      if constexpr (std::decay_t<decltype(delta)>::kIsDistant) {
        return 1.0;
      } else {
        return delta.DirectionPdf(samplers_, w) / kPerSteradian;
      }
    });
  }
  const InfiniteEmitter& infinite = impl.infinites[light - impl.first_infinite()];
  if (infinite.portal) return kPi * infinite.portal->PdfOfRays(-w);
  if (!infinite.map) return 1;
  return static_cast<double>(infinite.map->Pdf(infinite.PlaceOf(-w))) / kPerSteradian;
}

}  // namespace sheaf::render
