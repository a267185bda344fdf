// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription: the contents of a scene file as plain structs and indices, independent of the
// file format. Readers produce it; RenderPlan and CompiledScene are made from it. Nothing here is
// derived: values are as written (after the format's defaults), and every object remembers its
// location in the file.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/film/film_outputs.h"
#include "common/film/image_color.h"
#include "common/math/transform.h"
#include "common/math/vec.h"
#include "common/scene/color_spec.h"
#include "common/scene/curve_set.h"
#include "common/scene/lens_description.h"
#include "common/scene/material_description.h"
#include "common/scene/medium_description.h"
#include "common/scene/pattern_textures.h"
#include "common/scene/ray_kinds.h"

namespace sheaf {

// --- Textures ----------------------------------------------------------------------------------

enum class TextureWrap { kRepeat, kBlack, kClamp, kOctahedral, kMirror };
enum class ColorEncoding { kSrgb, kLinear, kGamma };  // For files of integers; floats are linear.

struct ConstantTexture {
  ColorSpec color;
  float value = 0;
};
struct ImageTexture {
  std::string file;  // Canonical name for FileSource.
  UvMapping mapping;
  TextureWrap wrap = TextureWrap::kRepeat;
  std::optional<TextureWrap> wrap_v = {};  // If it differs along v; neither is kOctahedral then.
  enum class Filter { kPoint, kBilinear, kTrilinear, kEwa } filter = Filter::kBilinear;
  ColorEncoding encoding = ColorEncoding::kSrgb;
  float encoding_gamma = 1;
  float scale = 1;
  bool invert = false;
  Rgb tint = Rgb::Gray(1);  // Multiplies colors, beside scale.
  // For float textures: the channel (0: red ... 3: alpha) that gives the value. Without it, alpha
  // or the mean of the colors does, as in pbrt-v4. An image without alpha has an alpha of 1.
  std::optional<int32_t> channel = {};
  // For float textures: values become 1 where they are at least this, and 0 elsewhere.
  std::optional<float> threshold = {};
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

// A value times the color that a mesh gives its vertices; as a float texture, times its alpha.
struct VertexColorTexture {
  ColorInput color = {};
  FloatInput value = {};
};

struct TextureDescription {
  std::string name;
  bool is_color = false;  // "spectrum" textures; otherwise "float".
  ColorRole role = ColorRole::kReflectance;
  std::variant<ConstantTexture, ImageTexture, CheckerboardTexture, ScaleTexture, MixTexture,
               VertexColorTexture, NoiseTexture, MarbleTexture, DotsTexture, DirectionMixTexture,
               BilerpTexture, NodeTexture, RampTexture>
      texture;
  SourceLocation location;
};

// --- Geometry ----------------------------------------------------------------------------------

// Red, green and blue in linear sRGB, and alpha, in [0, 1]; or a second set of uv
// (UvMapping::Kind::kSecondUv).
using VertexColor = std::array<float, 4>;

// A mesh's vertices at another time.
struct VertexStep {
  std::vector<Vec3f> positions;  // As many as the mesh has.
  std::vector<Vec3f> normals;    // Empty if the mesh has none, else as many.
};
struct TriangleMesh {
  std::vector<Vec3f> positions;   // Object space.
  std::vector<Vec3f> normals;     // Empty or one per position.
  std::vector<Vec2f> uvs;         // Empty or one per position.
  std::vector<uint32_t> indices;  // Three per triangle; every index is < positions.size().
  std::string file;               // Canonical name of the mesh file, empty for inline meshes.
  // For a deforming mesh: positions and normals above are those at shutter opening; the steps
  // follow at equal intervals of time, the last at shutter closing. Vertices move linearly between
  // steps.
  std::vector<VertexStep> steps = {};
  // Empty or one per position: directions of the surface from which anisotropic materials and
  // normal maps count, in place of those along u.
  std::vector<Vec3f> tangents = {};
  std::vector<VertexColor> colors = {};  // Empty (white and opaque) or one per position.
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
  int32_t mesh = kNone;  // Index in meshes: shapes of equal files share one mesh.
  // Distance by which the surface is moved along its normals, in object space. The mesh is first
  // refined until no edge is longer than edge_length, in the target space of the shape's transform.
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

// A transform over the shutter interval. `end` equals `start` for static objects.
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
  FloatInput alpha{.value = 1};  // Opacity, applied as a stochastic cut-out.
  bool reverse_orientation = false;
  bool has_alpha = false;
  MediumBoundary media;
  SourceLocation location;
  int32_t matte_name = kNone;  // Index in matte_names, where the scene gives a name.
  RayKinds invisible = 0;      // The kinds of rays that do not see the shape.
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
  int32_t matte_name = kNone;  // As for shapes.
};

// --- Lights ------------------------------------------------------------------------------------

// scale multiplies the color; power_w > 0 fixes the light's total power (pbrt-v4's "power").
struct LightScale {
  float scale = 1;
  float power_w = -1;
};

// How the image of an area light lies on its surface; by default as in pbrt-v4.
struct EmissionPlacement {
  UvMapping mapping;                                                       // A mapping of kind kUv.
  TextureWrap wrap_u = TextureWrap::kClamp, wrap_v = TextureWrap::kClamp;  // Or kRepeat, kMirror.
  bool is_nearest = false;  // Texels are not interpolated.
};
struct AreaLightDescription {
  ColorSpec radiance;  // Used where file is empty.
  LightScale scale;
  bool two_sided = false;
  SourceLocation location;
  std::string group = kDefaultLightGroup;
  std::string file;  // Image of the emitted radiance, over uv.
  EmissionPlacement placement;
  Rgb tint = Rgb::Gray(1);  // Multiplies the image.
};
struct InfiniteLight {
  ColorSpec radiance;         // Used where file is empty.
  std::string file;           // Equal-area (Clarberg 2008) square map.
  float illuminance_lx = -1;  // > 0: scales the map to give this illuminance on a plane.
  // World space. Empty, or the four corners in order of a rectangle through which alone the map is
  // visible. Its light arrives from the side to which (corner 3 - corner 0) x (corner 1 - corner 0)
  // points.
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
  std::vector<float> vertical_degrees;  // Ascending, in [0, 180]; dark outside of them.
  std::vector<float>
      horizontal_degrees;         // Ascending, in [0, 360); a single one means axial symmetry.
  std::vector<float> candelas;    // [horizontal][vertical]; empty if there is no table.
  bool dims_when_tilted = false;  // The file describes dimming by tilt, which is ignored.
};
// A point light at the origin. The map is centered about the light's +y, and its values (the mean
// of the channels) multiply the intensity; without a map the light is isotropic.
struct GoniometricLight {
  ColorSpec intensity;
  std::string file;    // Equal-area (Clarberg 2008) square map; may be empty.
  CandelaTable table;  // Replaces the map if the file is IES; down is the light's -y.
};
// At the origin, projects an image along +z. Upright when seen from the light with +y up.
struct ProjectionLight {
  std::string file;
  float fov_degrees = 90;  // Along the image's shorter side.
};
struct LightDescription {
  std::variant<InfiniteLight, DistantLight, PointLight, SpotLight, GoniometricLight,
               ProjectionLight>
      light;
  LightScale scale;
  Matrix4 world_from_light;
  SourceLocation location;
  std::string group = kDefaultLightGroup;
  RayKinds invisible = 0;  // The kinds of rays that do not see the light; never kShadow.
};

// --- Camera and film ---------------------------------------------------------------------------

struct CameraDescription {
  // Spherical cameras see every direction, about +y: kEquirectangular by longitude and latitude,
  // kEqualArea by the map of Clarberg 2008, in which all pixels cover equal solid angles.
  enum class Kind {
    kPerspective,
    kOrthographic,
    kEquirectangular,
    kEqualArea,
    kRealistic
  } kind = Kind::kPerspective;
  TransformOverTime world_from_camera;  // The camera looks along +z, x right, y up (left-handed).
  float fov_degrees = 90;               // Along the shorter side. Perspective cameras only.
  float lens_radius = 0;                // Scene units; 0: a pinhole. Spherical cameras have 0.
  float focal_distance = 1e6f;          // Scene units along +z.
  int32_t blade_count = 0;              // Number of straight blades of the aperture; 0: round.
  float blade_rotation_degrees = 0;     // Angle of the first corner from +x towards +y.
  LensDescription lens;                 // kRealistic only; then scene units are meters.
  double screen_window[4] = {-1, 1, -1, 1};  // x0 x1 y0 y1, from the aspect ratio.
  float shutter_open = 0, shutter_close = 1;
  int32_t medium = kNone;  // Index in media: the medium around the camera.
  // The camera's rays begin at the first and end at the second of these planes: camera space z,
  // distances from a spherical camera. 0 <= near_clip < far_clip.
  float near_clip = 0, far_clip = std::numeric_limits<float>::infinity();
  // The opening of the shutter: (time, openness) pairs, linear in between; time runs from 0 at
  // shutter_open to 1 at shutter_close, ascending. Empty: fully open throughout.
  std::vector<Vec2f> shutter_shape;
  SourceLocation location;

  bool IsSpherical() const { return kind == Kind::kEquirectangular || kind == Kind::kEqualArea; }
  bool IsRealistic() const { return kind == Kind::kRealistic; }
  bool Clips() const { return near_clip > 0 || far_clip < std::numeric_limits<float>::infinity(); }
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
  // The sensor's imaging ratio: ISO / 100; for camera sensors also times the shutter's length.
  float exposure_scale = 1;
  std::string sensor;  // Name of a camera's sensor (IsSensor); empty: the CIE 1931 observer.
  float max_component_value = 0;           // Samples are clamped to this; 0: no clamping.
  Primaries primaries = Primaries::kSrgb;  // Primaries of the image.
  float white_balance_k = 0;  // Temperature of the light that should look white; 0: none.
  FilmOutputs outputs;        // Those of "gbuffer".
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
  std::vector<ShapeDescription> shapes;  // All, including those of object definitions.
  std::vector<int32_t> world_shapes;     // Those placed in the world directly.
  std::vector<ObjectDefinition> objects;
  std::vector<ObjectInstance> instances;
  std::vector<std::string> matte_names;  // Shapes and instances ("string name"), none twice.
  std::vector<AreaLightDescription> area_lights;
  std::vector<LightDescription> lights;
};

// "scenes/room.pbrt:41:7"; without line: "scenes/room.glb"; "(no location)" if there is no file.
std::string FormatLocation(const SceneDescription& scene, SourceLocation location);

}  // namespace sheaf
