// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Building and querying Embree devices and scenes.
#include "worker/render/accel/embree_scene.h"

#include <sys/types.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/load_phases.h"
#include "worker/render/accel/embree_callbacks.h"
#include "worker/render/accel/embree_door.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/leak_guard.h"
#include "worker/render/geometry/needle.h"

namespace sheaf::render {
namespace {

// Above this number of triangles in a group, the tree is built without spatial splits, which cost
// memory.
constexpr size_t kHighQualityTrianglesMax = size_t{1} << 23;

// A ray that is turned across an edge, by both of these angles, meets the surface that continues
// there if it meets one that is at most this many times farther than the ray was moved sideways.
constexpr float kTurnsRadians[] = {0x1p-19f, 0x1p-18f};
constexpr float kNeighborSlope = 0x1p11f;

Vec3f ReachOf(const BakedMesh& mesh) {
  Vec3f reach;
  for (size_t step = 0; step <= mesh.steps.size(); ++step) {
    const std::vector<Vec3f>& positions = PositionsOfStep(mesh, step);
    // Without the last, which is padding.
    for (size_t v = 0; v + 1 < positions.size(); ++v) {
      const Vec3f& p = positions[v];
      const Vec3d in_file = FileReach(mesh.target_from_shape, mesh.shape_from_target, ToDouble(p));
      for (size_t i = 0; i < 3; ++i) {
        reach[i] = std::max(reach[i], std::fabs(p[i]) + static_cast<float>(in_file[i]));
      }
    }
  }
  return reach;
}

bool HasMasks(const SceneGeometry& geometry) {
  const auto has_mask = [](const auto& shape) { return shape.surface.seen_by != kEverything; };
  return std::ranges::any_of(geometry.groups, [&](const GeometryGroup& group) {
    return std::ranges::any_of(group.meshes, has_mask) ||
           std::ranges::any_of(group.quadrics, has_mask) ||
           std::ranges::any_of(group.patches, has_mask) ||
           std::ranges::any_of(group.curves, has_mask);
  });
}

// The result of a search for the nearest hit, beside the hit.
struct FoundNearest {
  bool is_hit = false;
  bool passes_beside = false;  // The ray passes beside the triangle that it hits.
};

// The result of a search for any hit.
struct FoundAny {
  bool is_hidden = false;
  bool is_undecided = false;  // Only the nearest hit tells whether there is one.
  bool met_passable = false;  // It is hidden by a surface that may let the ray pass.
};

}  // namespace

struct EmbreeScene::State {
  RTCDevice device = nullptr;
  Filters filters = Filters::kSkipSource;
  std::vector<RTCScene> scenes;  // One per group; [0] is the world.
  std::vector<QuadricList> quadric_lists;
  const SceneGeometry* described = nullptr;
  // Bound of the distance of a plane of the world from the one that is meant.
  float plane_bound = 0;
  std::deque<TracedMesh> meshes;      // For all groups; Embree holds pointers to elements.
  std::deque<PatchList> patch_lists;  // For all groups; Embree holds pointers to elements.
  std::deque<CurveList> curve_lists;  // Likewise.
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

  void Attach(RTCScene scene, RTCGeometry geometry, RayMask seen_by = kEverything) const {
    rtcSetGeometryMask(geometry, seen_by);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
  }
  void AddMeshes(const GeometryGroup& group, RTCScene scene);
  void AddQuadrics(const GeometryGroup& group, RTCScene scene, QuadricList* list) const;
  void AddPatches(const GeometryGroup& group, RTCScene scene);
  void AddCurves(const GeometryGroup& group, RTCScene scene);
  void AddPlaced(const SceneGeometry& geometry, PlacedList* list) const;
  absl::Status BuildGroup(const SceneGeometry& geometry, size_t index);

  // The nearest hit, without those that rounding lets pass at a vertex (LeaksAtEdge).
  bool Trace(const Ray& ray, RawHit* hit) const;
  // The nearest hit as the tracer has it. passed: triangles to ignore, or null.
  FoundNearest TraceOnce(const Ray& ray, RawHit* hit,
                         const PassedTriangles* passed = nullptr) const;
  // start: the contact that the ray leaves, or null.
  FoundNearest TraceFrom(const Contact* start, const PassedTriangles* passed, const Ray& ray,
                         RawHit* hit) const;
  // Whether the ray meets *hit, or what is behind it, where the ray passes beside its triangle.
  bool TraceBeside(const Ray& ray, RawHit* hit) const;
  // Whether there is no surface beside the edge of *hit that the ray passes outside of.
  bool IsOpenBeside(const Ray& ray, const RawHit& hit) const;
  FoundAny SearchAny(const Ray& ray, bool ends_at_passable) const;
  FoundAny SearchAnyFrom(const Contact* start, const Ray& ray, bool ends_at_passable) const;
  // Whether an unbounded ray that hit nothing passes through the tracer's rounding at a vertex
  // (leak_guard.h): sets the hit there.
  bool LeaksAtEdge(const Ray& ray, RawHit* hit) const;
};

void EmbreeScene::State::AddMeshes(const GeometryGroup& group, RTCScene scene) {
  for (const BakedMesh& mesh : group.meshes) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetGeometryTimeStepCount(geometry, static_cast<unsigned>(1 + mesh.steps.size()));
    for (size_t step = 0; step <= mesh.steps.size(); ++step) {
      rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, static_cast<unsigned>(step),
                                 RTC_FORMAT_FLOAT3, PositionsOfStep(mesh, step).data(), 0,
                                 sizeof(Vec3f), mesh.positions.size() - 1);
    }
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                               mesh.indices.data(), 0, 3 * sizeof(uint32_t),
                               mesh.indices.size() / 3);
    if (filters == Filters::kSkipSource) {
      TracedMesh& traced = meshes.emplace_back(TracedMesh{&mesh, ReachOf(mesh)});
      if (!mesh.steps.empty()) {
        FilterDeforming(geometry, &traced);
      } else {
        FilterTriangles(geometry, &traced, HasNeedles(mesh.positions, mesh.indices));
      }
    }
    Attach(scene, geometry, mesh.surface.seen_by);
  }
}

void EmbreeScene::State::AddQuadrics(const GeometryGroup& group, RTCScene scene,
                                     QuadricList* list) const {
  list->quadrics = &group.quadrics;
  list->have_masks = std::ranges::any_of(
      group.quadrics, [](const BakedQuadric& q) { return q.surface.seen_by != kEverything; });
  list->geometry = group.QuadricsId();
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  SetQuadrics(geometry, list);
  Attach(scene, geometry);
}

void EmbreeScene::State::AddPatches(const GeometryGroup& group, RTCScene scene) {
  for (size_t i = 0; i < group.patches.size(); ++i) {
    patch_lists.push_back({&group.patches[i], group.PatchesId(i)});
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    SetPatches(geometry, &patch_lists.back());
    Attach(scene, geometry, group.patches[i].surface.seen_by);
  }
}

void EmbreeScene::State::AddCurves(const GeometryGroup& group, RTCScene scene) {
  for (size_t i = 0; i < group.curves.size(); ++i) {
    curve_lists.push_back({&group.curves[i], group.CurvesId(i)});
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    SetCurves(geometry, &curve_lists.back());
    Attach(scene, geometry, group.curves[i].surface.seen_by);
  }
}

void EmbreeScene::State::AddPlaced(const SceneGeometry& geometry, PlacedList* list) const {
  if (list->placed->empty()) return;
  list->geometry = &geometry;
  list->scenes = &scenes;
  RTCGeometry user = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  SetPlaced(user, list);
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
  AddPatches(group, scene);
  AddCurves(group, scene);
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
  const PhaseTimer timer(LoadPhase::kTracer, PhaseCpu::kProcess);
  std::unique_ptr<EmbreeScene> result(new EmbreeScene);
  State& state = *result->state_;
  state.filters = filters;
  state.described = &geometry;
  state.plane_bound = Gamma(2) * Length(geometry.reach);
  state.leak_guard = LeakGuard(geometry);
  const std::string config = absl::StrCat("isa=avx2,threads=", build_threads);
  state.device = rtcNewDevice(config.c_str());
  if (state.device == nullptr) {
    return rtcGetDeviceError(nullptr) == RTC_ERROR_OUT_OF_MEMORY
               ? absl::ResourceExhaustedError("there is no memory for the ray tracer (Embree)")
               : absl::InternalError("the ray tracer (Embree) cannot start");
  }
  if (HasMasks(geometry) &&
      rtcGetDeviceProperty(state.device, RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) == 0) {
    return absl::FailedPreconditionError(
        "the scene has shapes that some rays do not see, for which the ray tracer (Embree) of this "
        "machine was built without ray masks; install one with EMBREE_RAY_MASK, as Debian's");
  }
  rtcSetDeviceMemoryMonitorFunction(state.device, State::CountMemory, &state);
  state.still.placed = &geometry.still;
  state.moving.placed = &geometry.moving;
  state.moving.first = static_cast<uint32_t>(geometry.still.size());
  state.quadric_lists.resize(geometry.groups.size());
  for (size_t i = 0; i < geometry.groups.size(); ++i) {
    state.scenes.push_back(rtcNewScene(state.device));
  }
  // Groups first: the world's tree needs only their bounds, but its rays enter them.
  for (size_t i = geometry.groups.size(); i-- > 0;) {
    const absl::Status status = state.BuildGroup(geometry, i);
    if (!status.ok()) return status;
  }
  return result;
}

void EmbreeScene::NoteOutsideIsDark() { state_->leak_guard.NoteOutsideIsDark(); }

[[gnu::always_inline]] inline FoundNearest EmbreeScene::State::TraceFrom(
    const Contact* start, const PassedTriangles* passed, const Ray& ray, RawHit* hit) const {
  RTCRayHit ray_hit;
  ray_hit.ray = ToRtc(ray);
  ClearHit(&ray_hit.hit);
  const TraceContext context(*described, plane_bound, ray, start, passed);
  ray_hit.ray.tfar = context.SearchEndOf();
  TraceNearest(scenes[0], &context, &ray_hit);
  if (ray_hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  Settle(context, &ray_hit);
  *hit = {context.nearest.t,
          ray_hit.hit.u,
          ray_hit.hit.v,
          {ray_hit.hit.geomID, ray_hit.hit.primID, ray_hit.hit.instID[0]},
          context.nearest.contact};
  return {true, context.passes_beside};
}

[[gnu::always_inline]] inline FoundNearest EmbreeScene::State::TraceOnce(
    const Ray& ray, RawHit* hit, const PassedTriangles* passed) const {
  if (!(ray.contact > 0)) [[likely]]
    return TraceFrom(nullptr, passed, ray, hit);
  const std::optional<Contact> start = ContactOfSource(*described, ray);
  const FoundNearest found = TraceFrom(start ? &*start : nullptr, passed, ray, hit);
  // The hit was not compared with the surface that the ray left.
  if (found.is_hit && start && hit->contact < ray.contact) {
    const std::optional<Contact> met = ContactAt(*described, ray, *hit);
    if (met && AreOnePlace(*start, *met, ToDouble(ray.d))) hit->contact = ray.contact;
  }
  return found;
}

bool EmbreeScene::State::Trace(const Ray& ray, RawHit* hit) const {
  const FoundNearest found = TraceOnce(ray, hit);
  if (!found.is_hit) return false;
  return !found.passes_beside || TraceBeside(ray, hit);
}

bool EmbreeScene::State::IsOpenBeside(const Ray& ray, const RawHit& hit) const {
  const float origin_reach = ReachOfOrigin(ray) / Length(ray.d);
  for (const float turn_radians : kTurnsRadians) {
    const float near = kNeighborSlope * turn_radians * (hit.t + origin_reach);
    const auto is_near = [&](const RawHit& beside) { return beside.t - hit.t <= near; };
    RawHit beside;
    if (!TraceOnce(BesideEdge(*described, ray, hit, turn_radians), &beside).is_hit) continue;
    if (is_near(beside)) return false;
    // Where the surface is seen edge-on, the turned ray meets it far behind.
    if (leak_guard.TouchesAtEdge(ray, &beside) && is_near(beside)) return false;
  }
  return true;
}

bool EmbreeScene::State::TraceBeside(const Ray& ray, RawHit* hit) const {
  PassedTriangles passed;
  while (passed.count < PassedTriangles::kCountMax && IsOpenBeside(ray, *hit)) {
    passed.ids[passed.count++] = hit->id;
    const FoundNearest found = TraceOnce(ray, hit, &passed);
    if (!found.is_hit) return false;
    if (!found.passes_beside) return true;
  }
  return true;
}

[[gnu::always_inline]] inline FoundAny EmbreeScene::State::SearchAnyFrom(
    const Contact* start, const Ray& ray, bool ends_at_passable) const {
  RTCRay r = ToRtc(ray);
  TraceContext context(*described, plane_bound, ray, start);
  context.ends_at_passable = ends_at_passable;
  r.tfar = context.SearchEndOf();
  TraceAny(scenes[0], &context, &r);
  return {r.tfar < 0, context.is_undecided, context.met_passable};
}

[[gnu::always_inline]] inline FoundAny EmbreeScene::State::SearchAny(const Ray& ray,
                                                                     bool ends_at_passable) const {
  if (!(ray.contact > 0)) [[likely]]
    return SearchAnyFrom(nullptr, ray, ends_at_passable);
  const std::optional<Contact> start = ContactOfSource(*described, ray);
  return SearchAnyFrom(start ? &*start : nullptr, ray, ends_at_passable);
}

bool EmbreeScene::State::LeaksAtEdge(const Ray& ray, RawHit* hit) const {
  if (ray.t_max < std::numeric_limits<float>::infinity()) return false;
  if (!leak_guard.MayLeak(ray)) return false;
  RawHit beside;
  const auto hits_beside = [&](int attempt) {
    const Ray nudged = NudgedRay(ray, attempt);
    if (Trace(nudged, &beside)) return true;
    for (int widening = 1; widening <= kWideningsMax; ++widening) {
      if (Trace(NudgedRay(ray, attempt, widening), &beside) &&
          leak_guard.TouchesAtEdge(nudged, &beside)) {
        return true;
      }
    }
    return false;
  };
  // Most rays that miss everything end here: they see the open sky.
  if (!Trace(NudgedRay(ray, 0, kWideningsMax), &beside)) return false;
  bool touches = false;
  for (int attempt = 0; attempt < kNudgeCount; ++attempt) {
    const bool is_wide = attempt < kWideNudgeCount;
    if (touches && !is_wide) break;
    if (!hits_beside(attempt)) {
      if (is_wide) return false;
      continue;
    }
    if (touches || !leak_guard.TouchesAtEdge(ray, &beside)) continue;
    touches = true;
    *hit = beside;
  }
  return touches;
}

bool EmbreeScene::Intersect(const Ray& ray, RawHit* hit) const {
  return state_->Trace(ray, hit) || state_->LeaksAtEdge(ray, hit);
}

bool EmbreeScene::Occluded(const Ray& ray) const {
  const FoundAny found = state_->SearchAny(ray, /*ends_at_passable=*/false);
  RawHit hit;
  if (found.is_undecided && !found.is_hidden) [[unlikely]]
    return Intersect(ray, &hit);
  return found.is_hidden || state_->LeaksAtEdge(ray, &hit);
}

Passage EmbreeScene::PassageOf(const Ray& ray) const {
  const FoundAny found = state_->SearchAny(ray, /*ends_at_passable=*/true);
  if (found.is_hidden) return found.met_passable ? Passage::kUnknown : Passage::kBlocked;
  RawHit hit;
  return found.is_undecided || state_->LeaksAtEdge(ray, &hit) ? Passage::kUnknown : Passage::kOpen;
}

uint64_t EmbreeScene::Replay(const std::vector<RecordedRay>& rays) const {
  uint64_t hits = 0;
  RawHit hit;
  for (const RecordedRay& recorded : rays) {
    hits += recorded.is_shadow ? Occluded(recorded.ray) : Intersect(recorded.ray, &hit);
  }
  return hits;
}

uint64_t EmbreeScene::memory_bytes() const {
  return static_cast<uint64_t>(std::max<int64_t>(0, state_->memory_bytes));
}

}  // namespace sheaf::render
