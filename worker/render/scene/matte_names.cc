// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/matte_names.h"

#include <map>
#include <set>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/film/cryptomatte.h"

namespace sheaf::render {
namespace {

// In the order of MaterialDescription::material.
constexpr const char* kMaterialTypes[] = {
    "diffuse",       "diffusetransmission", "conductor", "dielectric", "thindielectric",
    "coateddiffuse", "coatedconductor",     "hair",      "measured",   "mix",
    "interface",     "subsurface",          "principled"};
static_assert(std::size(kMaterialTypes) ==
              std::variant_size_v<decltype(MaterialDescription::material)>);
// In the order of ShapeDescription::shape.
constexpr const char* kShapeKinds[] = {"mesh",     "sphere",       "disk",
                                       "cylinder", "bilinearmesh", "curve"};
static_assert(std::size(kShapeKinds) == std::variant_size_v<decltype(ShapeDescription::shape)>);

std::string MaterialBase(const MaterialDescription& material) {
  return material.name.empty() ? kMaterialTypes[material.material.index()] : material.name;
}

std::string ShapeBase(const SceneDescription& scene, const ShapeDescription& shape) {
  const std::string material =
      shape.material == kNone ? "none"
                              : MaterialBase(scene.materials[static_cast<size_t>(shape.material)]);
  return absl::StrCat(material, ".", kShapeKinds[shape.shape.index()]);
}

std::string Numbered(const std::string& base, uint32_t number) {
  return absl::StrCat(base, "#", number);
}

// Numbers the things of equal bases.
class Numbers {
 public:
  void Take(std::string_view name) { taken_.insert(CryptomatteIdBits(name)); }
  uint32_t Next(const std::string& base) {
    uint32_t& last = last_[base];
    // Ends: there are fewer things (kIdMax) than ids.
    while (!taken_.insert(CryptomatteIdBits(Numbered(base, ++last))).second) {
    }
    return last;
  }

 private:
  std::unordered_set<uint32_t> taken_;
  std::unordered_map<std::string, uint32_t> last_;
};

std::vector<bool> ShapesOfObjects(const SceneDescription& scene) {
  std::vector<bool> are(scene.shapes.size());
  for (const ObjectDefinition& object : scene.objects) {
    for (const int32_t shape : object.shapes) are[static_cast<size_t>(shape)] = true;
  }
  return are;
}

void AddCollisions(const std::set<std::string>& names, const char* what,
                   std::vector<std::string>* lines) {
  std::map<uint32_t, const std::string*> by_id;
  for (const std::string& name : names) {
    const auto [first, is_new] = by_id.emplace(CryptomatteIdBits(name), &name);
    if (is_new || lines->size() == kMatteCollisionsShown) continue;
    lines->push_back(absl::StrCat("the names \"", *first->second, "\" and \"", name, "\" of ", what,
                                  " have the same Cryptomatte id, so they are one matte; rename "
                                  "one of them"));
  }
}

}  // namespace

MatteNames::MatteNames(const SceneDescription& scene)
    : number_of_shape_(scene.shapes.size()),
      number_of_instance_(scene.instances.size()),
      number_of_material_(scene.materials.size()) {
  Numbers objects, materials;
  for (const std::string& name : scene.matte_names) objects.Take(name);
  for (size_t i = 0; i < scene.instances.size(); ++i) {
    const ObjectInstance& instance = scene.instances[i];
    if (instance.matte_name != kNone) continue;
    number_of_instance_[i] = objects.Next(scene.objects[static_cast<size_t>(instance.object)].name);
  }
  const std::vector<bool> is_of_object = ShapesOfObjects(scene);
  for (size_t i = 0; i < scene.shapes.size(); ++i) {
    if (is_of_object[i] || scene.shapes[i].matte_name != kNone) continue;
    number_of_shape_[i] = objects.Next(ShapeBase(scene, scene.shapes[i]));
  }
  for (const MaterialDescription& material : scene.materials) {
    if (!material.name.empty()) materials.Take(material.name);
  }
  for (size_t i = 0; i < scene.materials.size(); ++i) {
    if (!scene.materials[i].name.empty()) continue;
    number_of_material_[i] = materials.Next(MaterialBase(scene.materials[i]));
  }
}

std::string MatteNames::OfShape(const SceneDescription& scene, size_t shape) const {
  const ShapeDescription& description = scene.shapes[shape];
  if (description.matte_name != kNone) {
    return scene.matte_names[static_cast<size_t>(description.matte_name)];
  }
  return Numbered(ShapeBase(scene, description), number_of_shape_[shape]);
}

std::string MatteNames::OfInstance(const SceneDescription& scene, size_t instance) const {
  const ObjectInstance& description = scene.instances[instance];
  if (description.matte_name != kNone) {
    return scene.matte_names[static_cast<size_t>(description.matte_name)];
  }
  return Numbered(scene.objects[static_cast<size_t>(description.object)].name,
                  number_of_instance_[instance]);
}

std::string MatteNames::OfMaterial(const SceneDescription& scene, size_t material) const {
  const MaterialDescription& description = scene.materials[material];
  if (!description.name.empty()) return description.name;
  return Numbered(MaterialBase(description), number_of_material_[material]);
}

std::vector<std::string> MatteCollisions(const SceneDescription& scene) {
  std::vector<std::string> lines;
  AddCollisions({scene.matte_names.begin(), scene.matte_names.end()}, "objects", &lines);
  std::set<std::string> materials;
  for (const MaterialDescription& material : scene.materials) {
    if (!material.name.empty()) materials.insert(material.name);
  }
  AddCollisions(materials, "materials", &lines);
  return lines;
}

}  // namespace sheaf::render
