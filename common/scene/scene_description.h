// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription: what a scene file says, as plain structs and indices, independent of the file
// format. Readers produce it; RenderPlan and CompiledScene are made from it. Nothing here is
// derived: values are as written (after the format's defaults), every thing remembers where it was
// written.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/film/film_outputs.h"
#include "common/film/picture_color.h"
#include "common/math/transform.h"
#include "common/math/vec.h"
#include "common/scene/color_spec.h"
#include "common/scene/curve_set.h"
#include "common/scene/lens_description.h"
#include "common/scene/medium_description.h"

namespace sheaf {

// A number or colour that is constant, or multiplied in from a texture.
struct FloatInput {
  float value = 0;
  int32_t texture = kNone;  // Index in textures; then `value` is unused.
};
struct ColorInput {
  ColorSpec value;
  int32_t texture = kNone;
};

// --- Textures ----------------------------------------------------------------------------------

struct UvMapping {
  enum class Kind { kUv, kPlanar, kSpherical, kCylindrical };
  Kind kind = Kind::kUv;
  float scale_u = 1, scale_v = 1, offset_u = 0, offset_v = 0;
  Vec3f planar_u{1, 0, 0}, planar_v{0, 1, 0};
  Matrix4 texture_from_world;  // For planar, spherical, cylindrical and 3-D checkerboards.
};
enum class TextureWrap { kRepeat, kBlack, kClamp, kOctahedral };
enum class ColorEncoding {
  kAuto,
  kLinear,
  kSrgb,
  kGamma
};  // kAuto: sRGB for 8-bit files, else linear.

struct ConstantTexture {
  ColorSpec color;
  float value = 0;
};
struct ImageTexture {
  std::string file;  // Canonical name for FileSource.
  UvMapping mapping;
  TextureWrap wrap = TextureWrap::kRepeat;
  enum class Filter { kPoint, kBilinear, kTrilinear, kEwa } filter = Filter::kBilinear;
  ColorEncoding encoding = ColorEncoding::kAuto;
  float encoding_gamma = 1;
  float scale = 1;
  bool invert = false;
};
struct CheckerboardTexture {
  int32_t dimensions = 2;  // 2 or 3.
  UvMapping mapping;
  ColorInput color[2];
  FloatInput value[2];
};
struct ScaleTexture {
  ColorInput color;
  FloatInput value;
  FloatInput scale;
};
struct MixTexture {
  ColorInput color[2];
  FloatInput value[2];
  FloatInput amount;
};

struct TextureDescription {
  std::string name;
  bool is_color = false;  // "spectrum" textures; otherwise "float".
  ColorRole role = ColorRole::kReflectance;
  std::variant<ConstantTexture, ImageTexture, CheckerboardTexture, ScaleTexture, MixTexture>
      texture;
  SourceLocation location;
};

// --- Materials ---------------------------------------------------------------------------------

// Roughness as written; alpha = sqrt(roughness) where remap_roughness (pbrt-v4's rule), else
// itself.
struct RoughnessInput {
  FloatInput u, v;
  bool remap_roughness = true;
};
struct DiffuseMaterial {
  ColorInput reflectance;
};
// Lambertian on both sides: what comes in on one is reflected there or leaves on the other, scaled
// by `scale` and clamped to [0, 1].
struct DiffuseTransmissionMaterial {
  ColorInput reflectance, transmittance;
  float scale = 1;
};
struct ConductorMaterial {
  RoughnessInput roughness;
  bool has_reflectance = false;  // Then eta and k follow from reflectance; else from eta and k.
  ColorInput reflectance, eta, k;
};
// Relative index of refraction. mean is what RGB transport uses; spectrum is kRgb, and unused,
// where the index is the same at every wavelength. Its ends hold beyond them.
struct RefractiveIndex {
  float mean = 1.5f;
  ColorSpec spectrum;
  bool Disperses() const { return spectrum.kind != ColorSpec::Kind::kRgb; }
  // Matter of the same index on both sides neither bends nor reflects.
  bool IsMatched() const { return mean == 1 && !Disperses(); }
};
struct DielectricMaterial {
  RoughnessInput roughness;
  RefractiveIndex eta;
};
// The boundary of matter that scatters light beneath it.
struct SubsurfaceMaterial {
  RoughnessInput roughness;
  RefractiveIndex eta{1.33f, {}};
  int32_t medium = kNone;  // The matter: index in media, which has is_matter.
};
struct ThinDielectricMaterial {
  RefractiveIndex eta;
};
// A layer of index eta on top of a base.
struct ClearCoat {
  float eta = 1.5f;
  float thickness = 0.01f;  // In mean free paths of a purely absorbing coat, as in pbrt-v4.
  ColorInput albedo;        // Of the coat's medium; non-zero is not supported yet.
  float g = 0;
  int32_t max_depth = 10, sample_count = 1;
};
struct CoatedDiffuseMaterial : ClearCoat {
  RoughnessInput roughness;
  ColorInput reflectance;
};
struct CoatedConductorMaterial : ClearCoat {
  RoughnessInput roughness;     // Of the coat's interface. Neither roughness is a texture.
  ConductorMaterial conductor;  // Its index is against vacuum, as measured ones are.
};
// A fibre along dp/du; v goes across it, from one edge as seen to the other.
struct HairMaterial {
  enum class Pigment { kAbsorption, kReflectance, kMelanin };
  Pigment pigment = Pigment::kMelanin;
  ColorInput color;  // Absorption per radius of the fibre, or what a head of hair reflects.
  FloatInput eumelanin{.value = 1.3f}, pheomelanin{.value = 0};  // Concentrations.
  FloatInput eta{.value = 1.55f};
  FloatInput beta_m{.value = 0.3f}, beta_n{.value = 0.3f};  // Roughness along and around, [0, 1].
  FloatInput alpha_degrees{.value = 2};                     // Tilt of the scales, [-90, 90].

  // What constants must lie within.
  static constexpr float kIndexMin = 0.1f, kIndexMax = 10, kConcentrationMax = 1e6f;
};
struct MeasuredMaterial {
  std::string file;             // Canonical name for FileSource of an RGL file (.bsdf).
  bool is_anisotropic = false;  // It was measured in more than one direction around the normal.
};
struct MixMaterial {
  int32_t material[2] = {kNone, kNone};
  FloatInput amount;
};
struct InterfaceMaterial {};  // Invisible; bounds a medium.

struct MaterialDescription {
  std::string name;  // Empty for unnamed ones.
  std::variant<DiffuseMaterial, DiffuseTransmissionMaterial, ConductorMaterial, DielectricMaterial,
               ThinDielectricMaterial, CoatedDiffuseMaterial, CoatedConductorMaterial, HairMaterial,
               MeasuredMaterial, MixMaterial, InterfaceMaterial, SubsurfaceMaterial>
      material;
  SourceLocation location;
  int32_t normal_map = kNone;  // Index in textures: red, green, blue from [0, 1] to [-1, 1].
  // A bump map's height, in scene units; unused with normal_map.
  FloatInput displacement{0, kNone};
  // Which matter is there where closed shapes overlap: that of the highest. Materials without one
  // take no part. Only dielectrics, interfaces and subsurface matter have one.
  std::optional<int32_t> priority = std::nullopt;
};

// --- Geometry ----------------------------------------------------------------------------------

// A mesh's vertices at another time.
struct VertexStep {
  std::vector<Vec3f> positions;  // As many as the mesh has.
  std::vector<Vec3f> normals;    // Empty where the mesh has none, else as many.
};
struct TriangleMesh {
  std::vector<Vec3f> positions;   // Object space.
  std::vector<Vec3f> normals;     // Empty or one per position.
  std::vector<Vec2f> uvs;         // Empty or one per position.
  std::vector<uint32_t> indices;  // Three per triangle; every index is < positions.size().
  std::string file;               // Canonical name of the mesh file, empty for inline meshes.
  // Of a mesh that deforms: positions and normals above are those when the shutter opens, these
  // follow at even steps of time, the last when it closes. Vertices go straight between two steps.
  std::vector<VertexStep> steps = {};
};
// Bilinear patches: corners at (u, v) = (0,0), (1,0), (0,1), (1,1), in this order.
struct BilinearMesh {
  std::vector<Vec3f> positions;   // Object space.
  std::vector<Vec3f> normals;     // Empty or one per position.
  std::vector<Vec2f> uvs;         // Empty (u and v themselves) or one per position.
  std::vector<uint32_t> indices;  // Four per patch; every index is < positions.size().
};
struct SphereShape {
  float radius = 1, z_min = -1, z_max = 1, phi_max_degrees = 360;
};
struct DiskShape {
  float radius = 1, inner_radius = 0, height = 0, phi_max_degrees = 360;
};
struct CylinderShape {
  float radius = 1, z_min = -1, z_max = 1, phi_max_degrees = 360;
};
struct MeshShape {
  int32_t mesh = kNone;  // Index in meshes: equal files share one mesh.
  // How far the surface is moved along its normals, in object space. The mesh is refined before
  // until no edge is longer than edge_length, in the space that the shape's transform leads to.
  FloatInput displacement{0, kNone};
  float edge_length = 1;

  bool IsDisplaced() const { return displacement.texture != kNone || displacement.value != 0; }
};
struct BilinearMeshShape {
  int32_t mesh = kNone;
};  // Index in bilinear_meshes: each shape has its own.
struct CurveShape {
  int32_t curves = kNone;
};  // Index in curve_sets: each shape has its own.

// Where something is over the shutter. `end` equals `start` for what stands still.
struct TransformOverTime {
  Matrix4 start, end;
  float start_time = 0, end_time = 1;
  bool IsAnimated() const { return !(start == end); }
};

struct ShapeDescription {
  std::variant<MeshShape, SphereShape, DiskShape, CylinderShape, BilinearMeshShape, CurveShape>
      shape;
  TransformOverTime world_from_object;  // For shapes of an object definition: object_from_shape.
  int32_t material = kNone;
  int32_t area_light = kNone;    // Index in area_lights.
  FloatInput alpha{.value = 1};  // Cut-out by stochastic alpha.
  bool reverse_orientation = false;
  bool has_alpha = false;
  MediumBoundary media;
  SourceLocation location;
};
struct ObjectDefinition {
  std::string name;
  std::vector<int32_t> shapes;  // Indices in shapes.
  SourceLocation location;
};
struct ObjectInstance {
  int32_t object = kNone;
  TransformOverTime world_from_instance;
  SourceLocation location;
};

// --- Lights ------------------------------------------------------------------------------------

// scale multiplies the colour; power_w > 0 fixes the light's total power (pbrt-v4's "power").
struct LightScale {
  float scale = 1;
  float power_w = -1;
};

struct AreaLightDescription {
  ColorSpec radiance;  // Used where file is empty.
  LightScale scale;
  bool two_sided = false;
  SourceLocation location;
  std::string group = kDefaultLightGroup;
  std::string file;  // Picture of what is emitted, over uv.
};
struct InfiniteLight {
  ColorSpec radiance;         // Used where file is empty.
  std::string file;           // Equal-area (Clarberg 2008) square map.
  float illuminance_lx = -1;  // > 0: scales so that the map gives this illuminance on a plane.
  // World space; none, or four corners in order around a rectangle through which alone the map is
  // seen. Its light comes from where (corner 3 - corner 0) x (corner 1 - corner 0) points.
  std::vector<Vec3d> portal;
};
struct DistantLight {
  ColorSpec radiance;
  Vec3d from{0, 0, 0}, to{0, 0, 1};
  float illuminance_lx = -1;
};
struct PointLight {
  ColorSpec intensity;
  Vec3d from{0, 0, 0};
};
struct SpotLight {
  ColorSpec intensity;
  Vec3d from{0, 0, 0}, to{0, 0, 1};
  float cone_angle_degrees = 30, cone_delta_angle_degrees = 5;
};
// A luminaire as measured: candelas by the angle from straight down, in planes about the vertical.
struct CandelaTable {
  std::vector<float> vertical_degrees;    // Ascending, in [0, 180]; dark outside of them.
  std::vector<float> horizontal_degrees;  // Ascending, in [0, 360); one is symmetry about the axis.
  std::vector<float> candelas;            // [horizontal][vertical]; none where there is no table.
  bool dims_when_tilted = false;          // The file says how, which is not followed.
};
// At the origin. The map is about the light's +y, and its values (the mean of the channels)
// multiply the intensity; without one the light is a point light.
struct GoniometricLight {
  ColorSpec intensity;
  std::string file;    // Equal-area (Clarberg 2008) square map; may be empty.
  CandelaTable table;  // Instead of the map's where the file is IES; down is the light's -y.
};
// At the origin, shines a picture along +z. Upright when seen from the light with +y up.
struct ProjectionLight {
  std::string file;
  float fov_degrees = 90;  // Of the picture's shorter side.
};
struct LightDescription {
  std::variant<InfiniteLight, DistantLight, PointLight, SpotLight, GoniometricLight,
               ProjectionLight>
      light;
  LightScale scale;
  Matrix4 world_from_light;
  SourceLocation location;
  std::string group = kDefaultLightGroup;
};

// --- Camera and film ---------------------------------------------------------------------------

struct CameraDescription {
  // Spherical cameras see every direction, about +y: kEquirectangular along lines of longitude and
  // latitude, kEqualArea by the map of Clarberg 2008, where a pixel is a share of all directions.
  enum class Kind {
    kPerspective,
    kOrthographic,
    kEquirectangular,
    kEqualArea,
    kRealistic
  } kind = Kind::kPerspective;
  TransformOverTime world_from_camera;  // Camera looks along +z, x right, y up (left-handed).
  float fov_degrees = 90;               // Of the shorter side. Perspective cameras only.
  float lens_radius = 0;                // Scene units; 0 is a pinhole, as spherical cameras are.
  float focal_distance = 1e6f;          // Scene units along +z.
  int32_t blade_count = 0;              // Of a lens with an opening of straight blades; 0: round.
  float blade_rotation_degrees = 0;     // Of the first corner from +x towards +y.
  LensDescription lens;                 // kRealistic only; then scene units are metres.
  double screen_window[4] = {-1, 1, -1,
                             1};  // x0 x1 y0 y1; filled in from the aspect by the reader.
  float shutter_open = 0, shutter_close = 1;
  int32_t medium = kNone;  // Index in media: what the camera is in.
  // How open the shutter is: time (0 at shutter_open, 1 at shutter_close, ascending) and openness,
  // straight in between. Empty: as open all the time.
  std::vector<Vec2f> shutter_shape;
  SourceLocation location;

  bool IsSpherical() const { return kind == Kind::kEquirectangular || kind == Kind::kEqualArea; }
  bool IsRealistic() const { return kind == Kind::kRealistic; }
};
struct FilterDescription {
  enum class Kind { kBox, kTriangle, kGaussian, kMitchell, kSinc } kind = Kind::kGaussian;
  float radius_x_px = 1.5f, radius_y_px = 1.5f;
  float sigma = 0.5f;              // Gaussian.
  float b = 1.f / 3, c = 1.f / 3;  // Mitchell.
  float tau = 3;                   // Sinc: first zero of its window, in pixels.
  SourceLocation location;
};
struct FilmDescription {
  int32_t width_px = 1280, height_px = 720;
  double crop_window[4] = {0, 1, 0, 1};  // x0 x1 y0 y1 as fractions.
  bool has_pixel_bounds = false;
  int32_t pixel_bounds[4] = {0, 0, 0, 0};  // x0 x1 y0 y1, half-open.
  // Sensor's imaging ratio: ISO / 100, of cameras' sensors times the shutter's length.
  float exposure_scale = 1;
  std::string sensor;             // Of a camera, by IsSensor; empty: the CIE 1931 observer.
  float max_component_value = 0;  // What samples are clamped to; 0: they are not.
  Primaries primaries = Primaries::kSrgb;  // Of the picture.
  float white_balance_k = 0;               // Temperature of what shall be white; 0: none.
  FilmOutputs outputs;                     // Those of "gbuffer".
  std::string filename;
  SourceLocation location;
};
struct SamplingDescription {
  int32_t samples_per_pixel = 16;
  int32_t max_depth = 5;  // Bounces; 0 sees only emission.
  uint64_t seed = 0;
  std::string sampler, integrator;  // As the file names them.
  SourceLocation sampler_location, integrator_location;
};

struct SceneDescription {
  std::vector<std::string> files;  // Canonical names; files[0] is the main scene file.
  CameraDescription camera;
  FilterDescription filter;
  FilmDescription film;
  SamplingDescription sampling;
  std::vector<TextureDescription> textures;
  std::vector<MaterialDescription> materials;
  std::vector<MediumDescription> media;
  std::vector<TriangleMesh> meshes;
  std::vector<BilinearMesh> bilinear_meshes;
  std::vector<CurveSet> curve_sets;
  std::vector<ShapeDescription> shapes;  // All, also those of object definitions.
  std::vector<int32_t> world_shapes;     // Those placed in the world directly.
  std::vector<ObjectDefinition> objects;
  std::vector<ObjectInstance> instances;
  std::vector<AreaLightDescription> area_lights;
  std::vector<LightDescription> lights;
};

// "scenes/room.pbrt:41:7"; "(no location)" where there is none.
std::string FormatLocation(const SceneDescription& scene, SourceLocation location);

}  // namespace sheaf
