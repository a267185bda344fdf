// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Embree devices, scenes and the callbacks for quadrics and placed groups.
#include "worker/render/embree_scene.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <sys/types.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "worker/render/leak_guard.h"

namespace sheaf::render {
namespace {

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

// Embree hands its context on to callbacks; ours carries the primitive that the ray leaves, and
// which placed group (or the world, kNotPlaced) is being traced.
struct SourceContext {
  QueryContext base;
  PrimitiveId source;
  uint32_t here;

  explicit SourceContext(PrimitiveId ray_source, uint32_t placed = kNotPlaced)
      : source(ray_source), here(placed) {
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&base);
#else
    rtcInitIntersectContext(&base);
#endif
  }
};

// Calls that changed their shape between the two versions.
inline void TraceNearest(RTCScene scene, SourceContext* context, RTCRayHit* ray_hit) {
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context->base;
  rtcIntersect1(scene, ray_hit, &arguments);
#else
  rtcIntersect1(scene, &context->base, ray_hit);
#endif
}
inline void TraceAny(RTCScene scene, SourceContext* context, RTCRay* ray) {
#if RTC_VERSION_MAJOR >= 4
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context->base;
  rtcOccluded1(scene, ray, &arguments);
#else
  rtcOccluded1(scene, &context->base, ray);
#endif
}

// Refuses hits of the triangle that a ray leaves.
void SkipSource(const RTCFilterFunctionNArguments* args) {
  const auto* context = reinterpret_cast<const SourceContext*>(args->context);
  const auto* hit = reinterpret_cast<const RTCHit*>(args->hit);
  if (PrimitiveId{hit->geomID, hit->primID, context->here} == context->source) {
    args->valid[0] = 0;
  }
}

// Above this many triangles in a group the tree is built without splitting them: splits cost
// memory.
constexpr size_t kHighQualityTrianglesMax = size_t{1} << 23;

inline RTCRay ToRtc(const Ray& ray) {
  RTCRay r;
  r.org_x = ray.o.x;
  r.org_y = ray.o.y;
  r.org_z = ray.o.z;
  r.tnear = 0;
  r.dir_x = ray.d.x;
  r.dir_y = ray.d.y;
  r.dir_z = ray.d.z;
  r.time = ray.time;
  r.tfar = ray.t_max;
  r.mask = ~0u;
  r.id = 0;
  r.flags = 0;
  return r;
}
inline void ClearHit(RTCHit* hit) {
  hit->geomID = RTC_INVALID_GEOMETRY_ID;
  hit->instID[0] = kNotPlaced;
}

// What user geometry callbacks are given.
struct QuadricList {
  const std::vector<BakedQuadric>* quadrics = nullptr;
  uint32_t geometry = 0;
};
struct PlacedList {
  const SceneGeometry* geometry = nullptr;
  const std::vector<PlacedGroup>* placed = nullptr;
  uint32_t first = 0;  // Index of the list's first in RawHit::placed.
  const std::vector<RTCScene>* scenes = nullptr;
};

Vec3d Origin(const RTCRay& r) { return {r.org_x, r.org_y, r.org_z}; }
Vec3d Direction(const RTCRay& r) { return {r.dir_x, r.dir_y, r.dir_z}; }

void SetBounds(RTCBounds* out, Vec3f lower, Vec3f upper) {
  out->lower_x = lower.x;
  out->lower_y = lower.y;
  out->lower_z = lower.z;
  out->upper_x = upper.x;
  out->upper_y = upper.y;
  out->upper_z = upper.z;
}

void BoundQuadric(const RTCBoundsFunctionArguments* args) {
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  const std::array<Vec3f, 2> bounds = QuadricBounds((*list.quadrics)[args->primID].quadric);
  SetBounds(args->bounds_o, bounds[0], bounds[1]);
}
// With one ray, Embree's N-wide records have the layout of the single ones.
void IntersectQuadricList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const Quadric& quadric = (*list.quadrics)[args->primID].quadric;
  const std::optional<double> t =
      IntersectQuadric(quadric, Origin(ray_hit->ray), Direction(ray_hit->ray), ray_hit->ray.tfar);
  if (!t.has_value()) return;
  ray_hit->ray.tfar = static_cast<float>(*t);
  ray_hit->hit.u = ray_hit->hit.v = 0;
  ray_hit->hit.primID = args->primID;
  ray_hit->hit.geomID = list.geometry;
  ray_hit->hit.instID[0] = kNotPlaced;
}
void OccludeQuadricList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const Quadric& quadric = (*list.quadrics)[args->primID].quadric;
  if (IntersectQuadric(quadric, Origin(*ray), Direction(*ray), ray->tfar).has_value()) {
    ray->tfar = -std::numeric_limits<float>::infinity();
  }
}

void BoundPlaced(const RTCBoundsFunctionArguments* args) {
  const auto& list = *static_cast<const PlacedList*>(args->geometryUserPtr);
  const PlacedGroup& placed = (*list.placed)[args->primID];
  const PlacedBounds bounds = placed.motion == kNone
                                  ? BoundsOfStill(*list.geometry, placed)
                                  : BoundsOfMoving(*list.geometry, placed, args->timeStep);
  SetBounds(args->bounds_o, bounds.lower, bounds.upper);
}
// The ray in the space of the group. The direction keeps its length's meaning, so t stays the same.
RTCRay RayInGroup(const PlacedList& list, const PlacedGroup& placed, const RTCRay& ray) {
  const Affine group_from_render = GroupFromRenderAt(*list.geometry, placed, ray.time);
  RTCRay inner = ray;
  const Vec3f o = ToFloat(group_from_render.Point(Origin(ray)));
  const Vec3f d = ToFloat(group_from_render.Vector(Direction(ray)));
  inner.org_x = o.x;
  inner.org_y = o.y;
  inner.org_z = o.z;
  inner.dir_x = d.x;
  inner.dir_y = d.y;
  inner.dir_z = d.z;
  return inner;
}
PrimitiveId SourceOf(const QueryContext* context) {
  return reinterpret_cast<const SourceContext*>(context)->source;
}
void IntersectPlacedList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PlacedList*>(args->geometryUserPtr);
  auto* outer = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const PlacedGroup& placed = (*list.placed)[args->primID];
  RTCRayHit inner;
  inner.ray = RayInGroup(list, placed, outer->ray);
  ClearHit(&inner.hit);
  SourceContext context(SourceOf(args->context), list.first + args->primID);
  TraceNearest((*list.scenes)[placed.group], &context, &inner);
  if (inner.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  outer->ray.tfar = inner.ray.tfar;
  outer->hit = inner.hit;
  outer->hit.instID[0] = list.first + args->primID;
}
void OccludePlacedList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PlacedList*>(args->geometryUserPtr);
  auto* outer = reinterpret_cast<RTCRay*>(args->ray);
  const PlacedGroup& placed = (*list.placed)[args->primID];
  RTCRay inner = RayInGroup(list, placed, *outer);
  SourceContext context(SourceOf(args->context), list.first + args->primID);
  TraceAny((*list.scenes)[placed.group], &context, &inner);
  if (inner.tfar < 0) outer->tfar = -std::numeric_limits<float>::infinity();
}

}  // namespace

struct EmbreeScene::State {
  RTCDevice device = nullptr;
  Filters filters = Filters::kSkipSource;
  std::vector<RTCScene> scenes;  // One per group; [0] is the world.
  std::vector<QuadricList> quadric_lists;
  PlacedList still, moving;
  LeakGuard leak_guard;
  std::atomic<int64_t> memory_bytes{0};

  ~State() {
    for (const RTCScene scene : scenes) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }

  static bool CountMemory(void* self, ssize_t bytes, bool /*post*/) {
    static_cast<State*>(self)->memory_bytes += bytes;
    return true;
  }

  absl::Status Error() const {
    switch (rtcGetDeviceError(device)) {
      case RTC_ERROR_NONE:
        return absl::OkStatus();
      case RTC_ERROR_OUT_OF_MEMORY:
        return absl::ResourceExhaustedError(
            "the scene's geometry does not fit into memory while its acceleration structure is "
            "built");
      case RTC_ERROR_UNSUPPORTED_CPU:
        return absl::FailedPreconditionError(
            "this processor lacks AVX2, which the ray tracer needs");
      default:
        return absl::InternalError("the ray tracer (Embree) reported an error");
    }
  }

  void Attach(RTCScene scene, RTCGeometry geometry) const {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  void AddMeshes(const GeometryGroup& group, RTCScene scene) const;
  void AddQuadrics(const GeometryGroup& group, RTCScene scene, QuadricList* list) const;
  void AddPlaced(const SceneGeometry& geometry, PlacedList* list) const;
  absl::Status BuildGroup(const SceneGeometry& geometry, size_t index);
};

void EmbreeScene::State::AddMeshes(const GeometryGroup& group, RTCScene scene) const {
  for (const BakedMesh& mesh : group.meshes) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               mesh.positions.data(), 0, sizeof(Vec3f), mesh.positions.size() - 1);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                               mesh.indices.data(), 0, 3 * sizeof(uint32_t),
                               mesh.indices.size() / 3);
    if (filters == Filters::kSkipSource) {
      rtcSetGeometryIntersectFilterFunction(geometry, SkipSource);
      rtcSetGeometryOccludedFilterFunction(geometry, SkipSource);
    }
    Attach(scene, geometry);
  }
}

void EmbreeScene::State::AddQuadrics(const GeometryGroup& group, RTCScene scene,
                                     QuadricList* list) const {
  list->quadrics = &group.quadrics;
  list->geometry = static_cast<uint32_t>(group.meshes.size());
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(group.quadrics.size()));
  rtcSetGeometryUserData(geometry, list);
  rtcSetGeometryBoundsFunction(geometry, BoundQuadric, nullptr);
  rtcSetGeometryIntersectFunction(geometry, IntersectQuadricList);
  rtcSetGeometryOccludedFunction(geometry, OccludeQuadricList);
  Attach(scene, geometry);
}

void EmbreeScene::State::AddPlaced(const SceneGeometry& geometry, PlacedList* list) const {
  if (list->placed->empty()) return;
  list->geometry = &geometry;
  list->scenes = &scenes;
  RTCGeometry user = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(user, static_cast<unsigned>(list->placed->size()));
  if (list->placed->front().motion != kNone) rtcSetGeometryTimeStepCount(user, kMotionStepCount);
  rtcSetGeometryUserData(user, list);
  rtcSetGeometryBoundsFunction(user, BoundPlaced, nullptr);
  rtcSetGeometryIntersectFunction(user, IntersectPlacedList);
  rtcSetGeometryOccludedFunction(user, OccludePlacedList);
  Attach(scenes[0], user);
}

absl::Status EmbreeScene::State::BuildGroup(const SceneGeometry& geometry, size_t index) {
  const GeometryGroup& group = geometry.groups[index];
  size_t triangles = 0;
  for (const BakedMesh& mesh : group.meshes) triangles += mesh.indices.size() / 3;
  const RTCScene scene = scenes[index];
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene, triangles <= kHighQualityTrianglesMax ? RTC_BUILD_QUALITY_HIGH
                                                                       : RTC_BUILD_QUALITY_MEDIUM);
  AddMeshes(group, scene);
  if (!group.quadrics.empty()) AddQuadrics(group, scene, &quadric_lists[index]);
  if (index == 0) {
    AddPlaced(geometry, &still);
    AddPlaced(geometry, &moving);
  }
  rtcCommitScene(scene);
  return Error();
}

EmbreeScene::EmbreeScene() : state_(std::make_unique<State>()) {}
EmbreeScene::~EmbreeScene() = default;

absl::StatusOr<std::unique_ptr<EmbreeScene>> EmbreeScene::Build(const SceneGeometry& geometry,
                                                                uint32_t build_threads,
                                                                Filters filters) {
  std::unique_ptr<EmbreeScene> result(new EmbreeScene);
  State& state = *result->state_;
  state.filters = filters;
  state.leak_guard = LeakGuard(geometry);
  const std::string config = absl::StrCat("isa=avx2,threads=", build_threads);
  state.device = rtcNewDevice(config.c_str());
  if (state.device == nullptr) return absl::InternalError("the ray tracer (Embree) cannot start");
  rtcSetDeviceMemoryMonitorFunction(state.device, State::CountMemory, &state);
  state.still.placed = &geometry.still;
  state.moving.placed = &geometry.moving;
  state.moving.first = static_cast<uint32_t>(geometry.still.size());
  state.quadric_lists.resize(geometry.groups.size());
  for (size_t i = 0; i < geometry.groups.size(); ++i) {
    state.scenes.push_back(rtcNewScene(state.device));
  }
  // Groups first: the world's tree asks for their bounds only, but its rays enter them.
  for (size_t i = geometry.groups.size(); i-- > 0;) {
    const absl::Status status = state.BuildGroup(geometry, i);
    if (!status.ok()) return status;
  }
  return result;
}

bool EmbreeScene::IntersectOnce(const Ray& ray, RawHit* hit) const {
  RTCRayHit ray_hit;
  ray_hit.ray = ToRtc(ray);
  ClearHit(&ray_hit.hit);
  SourceContext context(ray.source);
  TraceNearest(state_->scenes[0], &context, &ray_hit);
  if (ray_hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  *hit = {ray_hit.ray.tfar,
          ray_hit.hit.u,
          ray_hit.hit.v,
          {ray_hit.hit.geomID, ray_hit.hit.primID, ray_hit.hit.instID[0]}};
  return true;
}

bool EmbreeScene::MeetsWhenNudged(const Ray& ray, RawHit* hit) const {
  if (ray.t_max < std::numeric_limits<float>::infinity()) return false;
  if (!state_->leak_guard.IsEnclosed(ray)) return false;
  for (int attempt = 0; attempt < kNudgesMax; ++attempt) {
    if (IntersectOnce(NudgedRay(ray, attempt), hit)) return true;
  }
  return false;
}

bool EmbreeScene::Intersect(const Ray& ray, RawHit* hit) const {
  return IntersectOnce(ray, hit) || MeetsWhenNudged(ray, hit);
}

bool EmbreeScene::Occluded(const Ray& ray) const {
  RTCRay r = ToRtc(ray);
  SourceContext context(ray.source);
  TraceAny(state_->scenes[0], &context, &r);
  RawHit hit;
  return r.tfar < 0 || MeetsWhenNudged(ray, &hit);
}

uint64_t EmbreeScene::Replay(const std::vector<RecordedRay>& rays) const {
  uint64_t met = 0;
  RawHit hit;
  for (const RecordedRay& recorded : rays) {
    met += recorded.is_shadow ? Occluded(recorded.ray) : Intersect(recorded.ray, &hit);
  }
  return met;
}

uint64_t EmbreeScene::memory_bytes() const {
  return static_cast<uint64_t>(std::max<int64_t>(0, state_->memory_bytes));
}

}  // namespace sheaf::render
