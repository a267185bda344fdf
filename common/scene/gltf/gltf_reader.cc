// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/gltf_reader.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/accessors.h"
#include "common/scene/gltf/animation.h"
#include "common/scene/gltf/camera_views.h"
#include "common/scene/gltf/deformation.h"
#include "common/scene/gltf/document.h"
#include "common/scene/gltf/draco_primitives.h"
#include "common/scene/gltf/extensions.h"
#include "common/scene/gltf/image_textures.h"
#include "common/scene/gltf/lights.h"
#include "common/scene/gltf/materials.h"
#include "common/scene/gltf/meshes.h"
#include "common/scene/gltf/meshopt_views.h"
#include "common/scene/gltf/node_tree.h"
#include "common/scene/gltf/skipped_parts.h"
#include "common/scene/gltf/thin_shapes.h"
#include "common/scene/gltf/values.h"
#include "common/scene/pbrt/principled_media.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/vertex_rounding.h"

namespace sheaf {
namespace gltf {
namespace {

constexpr int32_t kDefaultSamples = 64, kDefaultDepth = 12;

class Builder {
 public:
  Builder(tinygltf::Model& model, const std::string& main_file, FileSource* files,
          const GltfView& view, const SceneReaderLimits& limits, Diagnostics* diagnostics,
          SceneDescription* scene)
      : model_(model),
        main_file_(main_file),
        files_(files),
        view_(view),
        diagnostics_(diagnostics),
        scene_(scene),
        accessors_(&model, diagnostics, limits),
        textures_(&model, main_file, files, &accessors_, diagnostics, scene),
        materials_(&model, &textures_, &skipped_, diagnostics, scene),
        meshes_(&model, &accessors_, &skipped_, diagnostics, limits),
        skins_(&model, &world_start_, &world_end_, &accessors_, diagnostics),
        placements_max_(limits.placements_max),
        placements_left_(limits.placements_max) {}

  // Returns ReadSceneResult::eye_distance.
  float Build() {
    AddAll();
    skipped_.Report(diagnostics_);
    return eye_distance_;
  }
  void MakeDispersive() { materials_.MakeDispersive(); }

 private:
  // Mesh, primitive, sets of uv, and whether its colors emit.
  using MeshKey = std::tuple<int, size_t, UvSets, bool>;

  void AddAll() {
    CheckExtensions(model_, diagnostics_);
    if (!DecodeMeshoptViews(&model_, &accessors_, diagnostics_) ||
        !DecodeDracoPrimitives(&model_, &accessors_, diagnostics_)) {
      return;
    }
    std::optional<NodeTree> tree = NodeTree::Make(model_, diagnostics_);
    if (!tree) return;
    CountHidden(*tree);
    const Animations animations(model_, view_.animation, &accessors_, &skipped_, diagnostics_);
    if (diagnostics_->HasErrors()) return;
    start_ = animations.At(view_.time_s, tree->poses());
    moves_ = !animations.IsEmpty() && view_.shutter_s > 0;
    end_ = moves_ ? animations.At(view_.time_s + view_.shutter_s, tree->poses()) : start_;
    world_start_ = tree->WorldMatrices(start_);
    world_end_ = moves_ ? tree->WorldMatrices(end_) : world_start_;
    CountUses(tree->shown());
    scene_diagonal_ = SceneDiagonal(model_, tree->shown(), world_start_);
    for (const int node : tree->shown()) {
      if (diagnostics_->Exhausted()) return;
      AddMeshOf(node);
      AddLightOf(model_, node, PlaceOf(node), &skipped_, diagnostics_, scene_);
    }
    if (scene_->shapes.empty() && !diagnostics_->HasErrors()) {
      diagnostics_->Warning(kFile, "shows no mesh");
    }
    eye_distance_ = SetCameraOf(model_, tree->shown(), view_, world_start_, world_end_, bounds_,
                                diagnostics_, scene_);
    scene_->sampling.samples_per_pixel = kDefaultSamples;
    scene_->sampling.max_depth = kDefaultDepth;
    scene_->sampling.sampler = "zsobol";
    scene_->sampling.integrator = "volpath";
  }

  TransformOverTime PlaceOf(int node) const {
    const auto n = static_cast<size_t>(node);
    return {.start = world_start_[n], .end = world_end_[n]};
  }

  // Meshes and lights of other scenes of the file.
  void CountHidden(const NodeTree& tree) {
    std::vector<bool> is_shown(model_.nodes.size());
    for (const int node : tree.shown()) is_shown[static_cast<size_t>(node)] = true;
    for (size_t n = 0; n < model_.nodes.size(); ++n) {
      const tinygltf::Node& node = model_.nodes[n];
      if (is_shown[n] || (node.mesh < 0 && !node.extensions.contains("KHR_lights_punctual"))) {
        continue;
      }
      skipped_.Add(Named("node", static_cast<int>(n), node.name),
                   "it is not of the scene that the file shows, and is left out");
    }
  }

  const tinygltf::Value* Instancing(const tinygltf::Node& node) const {
    return Find(node.extensions, kInstancing);
  }

  // How often each mesh is placed as it is: several placements become instances.
  void CountUses(const std::vector<int>& shown) {
    for (const int n : shown) {
      const tinygltf::Node& node = model_.nodes[static_cast<size_t>(n)];
      if (node.skin < 0) uses_[node.mesh] += Instancing(node) != nullptr ? 2 : 1;
    }
  }

  void AddMeshOf(int n) {
    const tinygltf::Node& node = model_.nodes[static_cast<size_t>(n)];
    if (node.mesh < 0) return;
    const std::string what = Named("node", n, node.name);
    if (!HasIndex(model_.meshes, node.mesh)) {
      diagnostics_->Error(kFile, absl::StrCat(what, " has the mesh ", node.mesh,
                                              ", which does not exist; export the file again"));
      return;
    }
    std::vector<TransformOverTime> places = {PlaceOf(n)};
    if (Instancing(node) != nullptr && !ReadInstances(node, what, &places)) return;
    const Joints* const joints = skins_.Get(node.skin, what);
    const tinygltf::Mesh& mesh = model_.meshes[static_cast<size_t>(node.mesh)];
    if (joints == nullptr || !ChargePlacements(mesh.primitives.size() * places.size())) return;
    std::vector<ShapeDescription> shapes;
    bool emits = false, is_shared = uses_[node.mesh] > 1;
    for (size_t p = 0; p < mesh.primitives.size(); ++p) {
      const tinygltf::Primitive& source = mesh.primitives[p];
      const Surface surface =
          materials_.Get(source.material, source.attributes.contains("COLOR_0"));
      const PrimitiveUse use{surface.light_of_colors.has_value(),
                             scene_diagonal_ / LargestScale(world_start_[static_cast<size_t>(n)])};
      const Primitive* primitive = meshes_.Get(node.mesh, p, surface.uv_sets, use);
      if (primitive == nullptr) continue;
      ShapeDescription shape;
      shape.material = surface.material;
      shape.area_light = surface.light_of_colors ? LightOfColors(node.mesh, p, surface, *primitive)
                                                 : surface.area_light;
      shape.alpha = surface.alpha;
      shape.has_alpha = surface.has_alpha;
      shape.location = {0, n + 1, static_cast<int32_t>(p) + 1};
      emits = emits || shape.area_light != kNone;
      const bool moves = moves_ && shape.area_light == kNone;
      const std::vector<double>& weights_start = WeightsOf(start_, n, mesh);
      const std::vector<double>& weights_end = WeightsOf(end_, n, mesh);
      const bool has_skin = !joints->start.empty() && primitive->influences > 0;
      if (has_skin || Morphs(*primitive, weights_start) || Morphs(*primitive, weights_end)) {
        is_shared = false;
        shape.shape = MeshShape{AddDeformed(
            Deformed(*primitive, weights_start, joints->start),
            moves ? std::optional(Deformed(*primitive, weights_end, joints->end)) : std::nullopt,
            *primitive)};
      } else {
        const MeshKey key(node.mesh, p, surface.uv_sets, use.emits_colors);
        shape.shape = MeshShape{MeshIndex(key, *primitive)};
      }
      if (diagnostics_->HasErrors()) return;
      shapes.push_back(std::move(shape));
    }
    // A skin alone says where its mesh is.
    if (!joints->start.empty()) places = {TransformOverTime()};
    if (is_shared && !emits) {
      PlaceInstances(n, shapes, places, what);
    } else {
      for (const TransformOverTime& at : places) PlaceShapes(shapes, at, what);
    }
  }

  static bool Morphs(const Primitive& primitive, const std::vector<double>& weights) {
    return !primitive.targets.empty() &&
           std::any_of(weights.begin(), weights.end(), [](double w) { return w != 0; });
  }

  static const std::vector<double>& WeightsOf(const std::vector<Pose>& poses, int node,
                                              const tinygltf::Mesh& mesh) {
    const std::vector<double>& own = poses[static_cast<size_t>(node)].weights;
    return own.empty() ? mesh.weights : own;
  }

  // The light of a primitive whose colors emit. kNone without them, or after an error.
  int32_t LightOfColors(int mesh, size_t primitive, const Surface& surface,
                        const Primitive& source) {
    if (source.emission.empty()) return kNone;
    const auto [entry, is_new] =
        lights_of_colors_.try_emplace(std::tuple(mesh, primitive, surface.material), kNone);
    if (!is_new) return entry->second;
    AreaLightDescription light = *surface.light_of_colors;
    light.file = absl::StrCat(main_file_, ".colors-", mesh, "-", primitive, ".pfm");
    const absl::Status status = files_->DerivedPath(light.file, source.emission).status();
    if (absl::IsNotFound(status)) {
      light.file.clear();  // A job that an earlier version submitted has no such file.
    } else if (!status.ok()) {
      diagnostics_->Error(kFile, std::string(status.message()));
      return kNone;
    }
    entry->second = static_cast<int32_t>(scene_->area_lights.size());
    scene_->area_lights.push_back(std::move(light));
    return entry->second;
  }

  int32_t MeshIndex(const MeshKey& key, const Primitive& source) {
    const auto [entry, is_new] = mesh_indices_.try_emplace(key, kNone);
    if (is_new && accessors_.Charge(BytesOf(source.mesh))) entry->second = AddMesh(source.mesh);
    return entry->second;
  }

  int32_t AddDeformed(VertexStep start, std::optional<VertexStep> end, const Primitive& source) {
    if (!accessors_.Charge(2 * BytesOf(source.mesh))) return kNone;
    TriangleMesh mesh = source.mesh;
    mesh.positions = std::move(start.positions);
    mesh.normals = std::move(start.normals);
    mesh.tangents.clear();  // They are those of the mesh at rest.
    if (end && !(end->positions == mesh.positions)) mesh.steps.push_back(*std::move(end));
    const auto is_finite = [](const Vec3f& p) {
      return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
    };
    bool finite = std::all_of(mesh.positions.begin(), mesh.positions.end(), is_finite);
    for (const VertexStep& step : mesh.steps) {
      finite = finite && std::all_of(step.positions.begin(), step.positions.end(), is_finite);
    }
    if (!finite) {
      diagnostics_->Error(kFile,
                          "a skin or morph target moves vertices beyond all numbers; export "
                          "the file again");
      return kNone;
    }
    return AddMesh(std::move(mesh));
  }

  int32_t AddMesh(TriangleMesh mesh) {
    if (const auto why = WhyImprecise(mesh.positions, mesh.indices, 3)) {
      diagnostics_->Note(kFile, absl::StrCat("a mesh: ", *why));
    }
    Bounds bounds;
    for (const Vec3f& p : mesh.positions) bounds.Add(ToDouble(p));
    mesh_bounds_.push_back(bounds);
    scene_->meshes.push_back(std::move(mesh));
    return static_cast<int32_t>(scene_->meshes.size() - 1);
  }

  // False, with a note, where a node is scaled to nothing, as exporters hide things.
  bool IsVisible(const TransformOverTime& at, const std::string& what) {
    Matrix4 inverse;
    if (Invert(at.start, &inverse) && Invert(at.end, &inverse)) return true;
    skipped_.Add(what, "it is scaled to nothing, and left out");
    return false;
  }

  void AddBounds(const ShapeDescription& shape, const Matrix4& world) {
    const Bounds& bounds = mesh_bounds_[static_cast<size_t>(std::get<MeshShape>(shape.shape).mesh)];
    for (int corner = 0; corner < 8; ++corner) {
      bounds_.Add(TransformPoint(world, {(corner & 1) != 0 ? bounds.lower.x : bounds.upper.x,
                                         (corner & 2) != 0 ? bounds.lower.y : bounds.upper.y,
                                         (corner & 4) != 0 ? bounds.lower.z : bounds.upper.z}));
    }
  }

  void PlaceShapes(const std::vector<ShapeDescription>& shapes, const TransformOverTime& at,
                   const std::string& what) {
    if (!IsVisible(at, what) || !accessors_.Charge(shapes.size() * sizeof(ShapeDescription)))
      return;
    for (ShapeDescription shape : shapes) {
      shape.world_from_object = at;
      if (shape.area_light != kNone && at.IsAnimated()) {
        shape.world_from_object.end = at.start;
        skipped_.Add(what, "what emits stays where it is while the shutter is open");
      }
      AddBounds(shape, at.start);
      scene_->world_shapes.push_back(static_cast<int32_t>(scene_->shapes.size()));
      scene_->shapes.push_back(std::move(shape));
    }
  }

  void PlaceInstances(int node, const std::vector<ShapeDescription>& shapes,
                      const std::vector<TransformOverTime>& places, const std::string& what) {
    if (shapes.empty()) return;
    const int mesh = model_.nodes[static_cast<size_t>(node)].mesh;
    const auto [entry, is_new] =
        objects_.try_emplace(mesh, static_cast<int32_t>(scene_->objects.size()));
    if (is_new) {
      ObjectDefinition object;
      object.location = {0, node + 1, 1};
      const std::string& name = model_.meshes[static_cast<size_t>(mesh)].name;
      object.name = name;
      if (name.empty() || !object_names_.insert(name).second) {
        object.name = absl::StrCat(name, "mesh-", mesh);
      }
      for (const ShapeDescription& shape : shapes) {
        object.shapes.push_back(static_cast<int32_t>(scene_->shapes.size()));
        scene_->shapes.push_back(shape);
      }
      scene_->objects.push_back(std::move(object));
    }
    if (!accessors_.Charge(places.size() * sizeof(ObjectInstance))) return;
    for (const TransformOverTime& at : places) {
      if (!IsVisible(at, what)) continue;
      ObjectInstance instance;
      instance.object = entry->second;
      instance.world_from_instance = at;
      instance.location = {0, node + 1, 1};
      scene_->instances.push_back(instance);
      for (const ShapeDescription& shape : shapes) AddBounds(shape, at.start);
    }
  }

  // Replaces the node's place by those of EXT_mesh_gpu_instancing.
  bool ReadInstances(const tinygltf::Node& node, const std::string& what,
                     std::vector<TransformOverTime>* places) {
    const tinygltf::Value* attributes = Member(Instancing(node), "attributes");
    std::vector<float> numbers[3];
    const char* const names[3] = {"TRANSLATION", "ROTATION", "SCALE"};
    for (const std::string& key :
         attributes != nullptr ? attributes->Keys() : std::vector<std::string>()) {
      if (std::find(std::begin(names), std::end(names), key) == std::end(names)) {
        skipped_.Add(what, absl::StrCat("\"", key, "\" of instances has no effect"));
      }
    }
    const size_t widths[3] = {3, 4, 3};
    size_t count = 0;
    for (size_t i = 0; i < 3; ++i) {
      const int accessor = IndexOf(attributes, names[i]);
      if (accessor < 0) continue;
      auto read = accessors_.Floats(accessor, static_cast<int>(widths[i]),
                                    absl::StrCat(what, ", ", names[i], " of instances"));
      if (!read) return false;
      numbers[i] = *std::move(read);
      const size_t found = numbers[i].size() / widths[i];
      if (found > kGltfInstancesMax || (count != 0 && found != count)) {
        diagnostics_->Error(kFile,
                            absl::StrCat(what, " has instances of unequal counts, or more than ",
                                         kGltfInstancesMax, "; export it again"));
        return false;
      }
      count = found;
    }
    if (!accessors_.Charge(count * sizeof(TransformOverTime))) return false;
    const TransformOverTime parent = places->front();
    places->clear();
    for (size_t i = 0; i < count; ++i) {
      const auto at = [&](size_t list, size_t c, double fallback) {
        return numbers[list].empty() ? fallback
                                     : static_cast<double>(numbers[list][i * widths[list] + c]);
      };
      const Matrix4 local =
          MatrixOf({at(0, 0, 0), at(0, 1, 0), at(0, 2, 0)},
                   Normalized({at(1, 0, 0), at(1, 1, 0), at(1, 2, 0), at(1, 3, 1)}),
                   {at(2, 0, 1), at(2, 1, 1), at(2, 2, 1)});
      TransformOverTime place = parent;
      place.start = parent.start * local;
      place.end = parent.end * local;
      places->push_back(place);
    }
    return true;
  }

  bool ChargePlacements(uint64_t count) {
    if (count <= placements_left_) {
      placements_left_ -= count;
      return true;
    }
    diagnostics_->MemoryError(
        kFile, absl::StrCat("nodes and instances place primitives more often than the limit of ",
                            placements_max_, " (placements_max); join primitives of one material"));
    return false;
  }

  tinygltf::Model& model_;
  const std::string main_file_;
  FileSource* files_;
  const GltfView& view_;
  Diagnostics* diagnostics_;
  SceneDescription* scene_;
  SkippedParts skipped_;
  Accessors accessors_;
  ImageTextures textures_;
  Materials materials_;
  Meshes meshes_;
  Skins skins_;
  bool moves_ = false;
  std::vector<Pose> start_, end_;  // When the shutter opens and closes.
  std::vector<Matrix4> world_start_, world_end_;
  const uint64_t placements_max_;
  uint64_t placements_left_;
  std::map<int, int> uses_;         // By mesh.
  std::map<int, int32_t> objects_;  // By mesh.
  std::set<std::string> object_names_;
  std::map<MeshKey, int32_t> mesh_indices_;
  std::map<std::tuple<int, size_t, int32_t>, int32_t> lights_of_colors_;  // By material, too.
  std::vector<Bounds> mesh_bounds_;  // As SceneDescription::meshes.
  Bounds bounds_;
  double scene_diagonal_ = 1;
  float eye_distance_ = 0;
};

}  // namespace
}  // namespace gltf

absl::StatusOr<ReadSceneResult> ReadGltf(const std::string& main_file, FileSource& files,
                                         const GltfView& view, const SceneReaderLimits& limits) {
  ReadSceneResult result;
  result.scene.files.push_back(main_file);
  std::string warning;
  const absl::StatusOr<std::unique_ptr<tinygltf::Model>> model =
      gltf::LoadDocument(main_file, files, limits, &warning);
  if (!model.ok()) return model.status();
  Diagnostics diagnostics(&result.scene, limits);
  if (!warning.empty()) diagnostics.Note(gltf::kFile, warning);
  const SceneReaderLimits fitting = gltf::LimitsFor(**model, main_file, files, limits);
  gltf::Builder builder(**model, main_file, &files, view, fitting, &diagnostics, &result.scene);
  result.eye_distance = builder.Build();
  gltf::AddEnvironment(view.environment, main_file, &files, &diagnostics, &result.scene);
  if (absl::Status status = diagnostics.ToStatus(); !status.ok()) return status;
  AddPrincipledMedia(&result.scene, &diagnostics);
  builder.MakeDispersive();
  result.diagnostics = diagnostics.TakeAll();
  return result;
}

}  // namespace sheaf
