// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChainTable: the casters and lamps of RenderPlan::chain_shapes, as chains sample them
// (integrator/chains.h). Thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/light/light_table.h"
#include "worker/render/plan/chain_shapes.h"
#include "worker/render/sampling/discrete_distribution.h"
#include "worker/render/scene/chain_seeds.h"

namespace sheaf::render {

class ChainTable {
 public:
  // A point on a lamp. Space: render.
  struct LampPoint {
    Vec3d p;
    double pdf = 0;  // Per area, times the probability of choosing the emitter.
    uint32_t emitter = 0;
    int32_t shape = kNone;
    Vec3d outward;  // The normal of a sphere, not unit; zero on flat emitters.
  };
  struct ChosenCaster {
    uint32_t caster = 0;
    double probability = 0;
  };

  // Both must outlive *this.
  ChainTable(const ChainShapes& shapes, const SceneGeometry& geometry, const LightTable& lights);

  // Whether no chain leads to a lamp.
  bool empty() const { return casters_.empty() || lamp_choice_.empty(); }
  bool IsCaster(int32_t shape) const {
    return shape >= 0 && static_cast<size_t>(shape) < is_caster_.size() && is_caster_[shape];
  }
  bool IsLamp(uint32_t emitter) const { return emitter < is_lamp_.size() && is_lamp_[emitter]; }
  // A point of a lamp, by power. Requires: !empty(). choice, u: independent, in [0, 1).
  LampPoint SampleLamp(float choice, Vec2f u) const;
  // A caster: by the solid angle in which p sees it, or by the light paths that left it for places
  // near p. n: casters behind it are not chosen by their angle; zero if all may be. seeds: of the
  // lamp; may be null. None where all are behind.
  std::optional<ChosenCaster> ChooseCaster(Vec3f p, Vec3d n, const ChainSeeds::OfLamp* seeds,
                                           double u) const;
  uint32_t caster_count() const { return static_cast<uint32_t>(casters_.size()); }
  std::optional<uint32_t> CasterOf(int32_t shape) const;
  int32_t ShapeOf(uint32_t caster) const { return casters_[caster].shape; }
  // Radius of a ball about the caster.
  double RadiusOf(uint32_t caster) const { return casters_[caster].radius; }
  // A direction from p to the caster; every part of it that p sees has a positive density.
  // Unit. u: independent, in [0, 1).
  Vec3d SampleDirection(uint32_t caster, Vec3d p, const double (&u)[3]) const;

  // Sets the seeds to those of `trace`, a pure function of the scene, unless they are set.
  void EnsureSeeds(const std::function<ChainSeeds()>& trace) const;
  // Null before EnsureSeeds.
  const ChainSeeds* seeds() const { return seeds_ ? &*seeds_ : nullptr; }

 private:
  struct Caster {
    int32_t shape = kNone;
    Vec3d center{};
    double radius = 0;
    bool is_ball = false;              // A whole sphere, which fills the ball.
    const BakedMesh* mesh = nullptr;   // Null for quadrics.
    const Quadric* quadric = nullptr;  // Null for meshes.
    DiscreteDistribution areas{};      // The mesh's triangles by area.
  };
  struct Lamp {
    uint32_t emitter = 0;
    int32_t shape = kNone;
    Vec3d corner{}, e1{}, e2{};        // A triangle, where quadric is null.
    const Quadric* quadric = nullptr;  // A whole disk or sphere, not distorted.
    double area = 0;
  };

  void AddCaster(const BakedMesh& mesh);
  void AddCaster(const BakedQuadric& quadric);
  void AddLamp(const Lamp& lamp, Vec3d normal, const LightTable& lights,
               std::vector<double>* powers);
  double WeightOf(const Caster& caster, Vec3d p, Vec3d n) const;

  std::vector<bool> is_caster_, is_lamp_;  // By shape, by emitter.
  std::vector<Caster> casters_;
  std::vector<Lamp> lamps_;
  DiscreteDistribution lamp_choice_;
  mutable std::once_flag seeds_once_;
  mutable std::optional<ChainSeeds> seeds_;
};

}  // namespace sheaf::render
