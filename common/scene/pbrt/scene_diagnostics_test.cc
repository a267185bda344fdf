// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests every kind of mistake in a scene file, with the location and the text of its diagnostic.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

void WriteFaultyText(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

const std::string kHeader =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";

struct BadScene {
  const char* name;
  const char* text;
  const char* expected;  // Location and the beginning of the message.
};

void PrintTo(const BadScene& bad, std::ostream* out) { *out << bad.name; }

class BadSceneTest : public ::testing::TestWithParam<BadScene> {
 public:
  static std::string Directory() {
    return ::testing::TempDir() + "sheaf-bad-scene-" + GetParam().name;
  }
};

TEST_P(BadSceneTest, ErrorsHaveLocationAndReason) {
  const std::string directory = Directory();
  ASSERT_TRUE(MakeDirectories(directory).ok());
  WriteFaultyText(directory + "/main.pbrt", GetParam().text);
  WriteFaultyText(directory + "/loop.pbrt", "Include \"loop.pbrt\"\n");
  WriteFaultyText(directory + "/open.pbrt", "AttributeBegin\n");
  WriteFaultyText(directory + "/bad.ply", "ply\nformat ascii 1.0\n");
  WriteFaultyText(directory + "/one.ply", kHeader + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  WriteFaultyText(directory + "/two.ply", kHeader + "0 0 0\n1 0 0\n0 1 0\n3 0 2 1\n");
  WriteFaultyText(directory + "/bad.spd", "400 1 x\n");
  WriteFaultyText(directory + "/bad.IES", "TILT=NONE\nx\n");
  DirectoryFileSource files(directory);
  const absl::StatusOr<ReadSceneResult> result = ReadScene("main.pbrt", files);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(result.status().message()), HasSubstr(GetParam().expected));
}

constexpr BadScene kBadScenes[] = {
    {"Utf16", "\xff\xfeW", "main.pbrt:1:1: the file is text in UTF-16; save it as UTF-8"},
    {"Backslash", "WorldBegin\nShape \"plymesh\" \"string filename\" \"models\\\\a.ply\"\n",
     "does not exist (looked for "},
    {"BackslashIsNamed", "WorldBegin\nShape \"plymesh\" \"string filename\" \"a\\new.ply\"\n",
     "; its name is written with a backslash, between folders write /"},
    {"BackslashAsEscape", "WorldBegin\nShape \"plymesh\" \"string filename\" \"a\\ply\"\n",
     "main.pbrt:2:35: the string holds an unknown escape after \\; between folders write /"},
    {"Empty", "", "main.pbrt:1:1: the scene has no WorldBegin"},
    {"UnknownDirective", "WorldBegin\n  Shapes \"sphere\"\n",
     "main.pbrt:2:3: unknown directive \"Shapes\"; did you mean \"Shape\"?"},
    {"StrayString", "\"x\"\n", "main.pbrt:1:1: expected a directive"},
    {"OpenString", "WorldBegin\nShape \"sph\n", "main.pbrt:2:7: the string is not closed"},
    {"BadEscape", "WorldBegin\nShape \"s\\qh\"\n",
     "main.pbrt:2:7: the string holds an unknown escape"},
    {"OpenList", "WorldBegin\nShape \"sphere\" \"float radius\" [ 1\nShape \"disk\"\n",
     "main.pbrt:3:1: parameter \"radius\" has no ] before \"Shape\""},
    {"OpenListAtEnd", "WorldBegin\nShape \"sphere\" \"float radius\" [ 1",
     "parameter \"radius\" has no ] before the end of the file"},
    {"NoValue", "WorldBegin\nShape \"sphere\" \"float radius\"\nShape \"disk\"\n",
     "main.pbrt:3:1: parameter \"radius\" has no value before \"Shape\""},
    {"UnknownType", "WorldBegin\nShape \"sphere\" \"flaot radius\" 1\n",
     "main.pbrt:2:16: parameter \"radius\" has the unknown type \"flaot\"; did you mean "
     "\"float\"?"},
    {"NoName", "WorldBegin\nShape \"sphere\" \"float\" 1\n",
     "main.pbrt:2:16: parameter \"float\" needs a type and a name"},
    {"Twice", "WorldBegin\nShape \"sphere\" \"float radius\" 1 \"float radius\" 2\n",
     "main.pbrt:2:33: parameter \"radius\" is given twice"},
    {"NotANumber", "WorldBegin\nShape \"sphere\" \"float radius\" nan\n",
     "main.pbrt:2:31: parameter \"radius\": \"nan\" is not a number"},
    {"TooLarge", "WorldBegin\nShape \"sphere\" \"float radius\" 1e39\n",
     "main.pbrt:2:31: parameter \"radius\": \"1e39\" is not a number that a 32-bit float holds"},
    {"NotAnInteger", "Sampler \"sobol\" \"integer pixelsamples\" 4.5\nWorldBegin\n",
     "main.pbrt:1:40: parameter \"pixelsamples\": \"4.5\" is not a 32-bit integer"},
    {"QuotedBool", "WorldBegin\nAreaLightSource \"diffuse\" \"bool twosided\" \"true\"\n",
     "main.pbrt:2:43: parameter \"twosided\" of type bool has the string"},
    {"Components", "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [1 2]\n",
     "main.pbrt:2:22: parameter \"P\" of type point3 needs a multiple of 3"},
    {"UnknownParameter", "WorldBegin\nShape \"sphere\" \"float raduis\" 1\n",
     "main.pbrt:2:16: shape \"sphere\": parameter \"raduis\" is unknown here; did you mean "
     "\"radius\"?"},
    {"WrongType", "WorldBegin\nShape \"sphere\" \"integer radius\" 1\n",
     "main.pbrt:2:16: shape \"sphere\": parameter \"radius\" must be of type float, not integer"},
    {"TwoValues", "WorldBegin\nShape \"sphere\" \"float radius\" [1 2]\n",
     "parameter \"radius\" needs 1 value but has 2"},
    {"ShortTransform", "Transform [1 0 0 0]\nWorldBegin\n",
     "main.pbrt:1:19: Transform needs 16 numbers; number 5 is missing"},
    {"ZeroAxis", "Rotate 30 0 0 0\nWorldBegin\n", "main.pbrt:1:1: Rotate about a zero axis"},
    {"DegenerateLookAt", "LookAt 1 1 1 1 1 1 0 1 0\nWorldBegin\n",
     "main.pbrt:1:1: LookAt gives no direction"},
    {"SingularShape", "WorldBegin\nScale 1 0 1\nShape \"sphere\"\n",
     "main.pbrt:3:1: shape \"sphere\": the transformation is singular"},
    {"ActiveTransform", "ActiveTransform Never\nWorldBegin\n",
     "main.pbrt:1:17: ActiveTransform needs one of"},
    {"UnknownSystem", "WorldBegin\nCoordSysTransform \"camera\"\n",
     "main.pbrt:2:1: coordinate system \"camera\" is not defined"},
    {"BeforeWorld", "Shape \"sphere\"\nWorldBegin\n",
     "main.pbrt:1:1: Shape must stand after WorldBegin"},
    {"AfterWorld", "WorldBegin\nFilm \"rgb\"\n",
     "main.pbrt:2:1: Film must stand before WorldBegin"},
    {"EndsNothing", "WorldBegin\nAttributeEnd\n", "main.pbrt:2:1: AttributeEnd ends nothing"},
    {"EndsOther", "WorldBegin\nObjectBegin \"o\"\nAttributeEnd\nObjectEnd\n",
     "main.pbrt:3:1: AttributeEnd ends nothing: the innermost open block is the ObjectBegin at "
     "main.pbrt:2:1"},
    {"NeverEnded", "WorldBegin\nAttributeBegin\n", "main.pbrt:2:1: AttributeBegin is not closed"},
    {"OpenInImport", "WorldBegin\nImport \"open.pbrt\"\nShape \"sphere\"\n",
     "open.pbrt:1:1: AttributeBegin is not closed"},
    {"Cycle", "WorldBegin\nInclude \"loop.pbrt\"\n",
     "loop.pbrt:1:1: the files include each other in a cycle: main.pbrt > loop.pbrt > loop.pbrt"},
    {"MissingInclude", "WorldBegin\nInclude \"gone.pbrt\"\n",
     "main.pbrt:2:1: cannot read \"gone.pbrt\": file \"gone.pbrt\" does not exist"},
    {"ImportBeforeWorld", "Import \"open.pbrt\"\nWorldBegin\n",
     "main.pbrt:1:1: Import must stand after WorldBegin"},
    {"ObjectInObject", "WorldBegin\nObjectBegin \"a\"\nObjectBegin \"b\"\nObjectEnd\n",
     "main.pbrt:3:1: ObjectBegin inside of another object"},
    {"UndefinedObject", "WorldBegin\nObjectInstance \"a\"\n",
     "main.pbrt:2:1: object \"a\" is used here but not defined"},
    {"UnknownShape", "WorldBegin\nShape \"paraboloid\"\n",
     "main.pbrt:2:1: shape \"paraboloid\" is not supported; supported: trianglemesh, plymesh, "
     "loopsubdiv, bilinearmesh, levelset, sphere, disk, cylinder and curve"},
    {"UnknownCamera", "Camera \"fisheye\"\nWorldBegin\n",
     "main.pbrt:1:1: camera \"fisheye\" is not supported; supported: perspective, "
     "orthographic, spherical and realistic"},
    {"UnknownLight", "WorldBegin\nLightSource \"laser\"\n",
     "main.pbrt:2:1: light \"laser\" is not supported; supported: infinite, distant, point, "
     "spot, goniometric and projection"},
    {"NoSlide", "WorldBegin\nLightSource \"projection\" \"float fov\" 30\n",
     "main.pbrt:2:1: light \"projection\" needs an image to project; give \"string filename\""},
    {"WideSlide", "WorldBegin\nLightSource \"projection\" \"float fov\" 180\n",
     "main.pbrt:2:1: light \"projection\": fov 180 is outside (0, 180) degrees"},
    {"MissingSlide", "WorldBegin\nLightSource \"projection\" \"string filename\" \"no.png\"\n",
     "main.pbrt:2:26: light \"projection\": parameter \"filename\" cannot be read: file \"no.png\" "
     "does not exist"},
    {"MissingGoniogram", "WorldBegin\nLightSource \"goniometric\" \"string filename\" \"no.exr\"\n",
     "main.pbrt:2:27: light \"goniometric\": parameter \"filename\" cannot be read: file "
     "\"no.exr\" does not exist"},
    {"Portal", "WorldBegin\nLightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 0]\n",
     "main.pbrt:2:24: light \"infinite\": parameter \"portal\" needs the image"},
    {"PortalOfNoShape",
     "WorldBegin\nLightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0 0 1 1]\n",
     "main.pbrt:2:24: light \"infinite\": parameter \"portal\" is not a rectangle"},
    {"PortalOfThreeCorners",
     "WorldBegin\nLightSource \"infinite\" \"point3 portal\" [0 0 0 1 0 0 1 1 0]\n",
     "main.pbrt:2:24: light \"infinite\": parameter \"portal\" is not a rectangle"},
    {"UnknownMaterial", "WorldBegin\nMaterial \"velvet\"\n",
     "main.pbrt:2:1: material \"velvet\": type \"velvet\" is unknown"},
    {"NearestMaterial", "WorldBegin\nMaterial \"difuse\"\n",
     "main.pbrt:2:1: material \"difuse\": type \"difuse\" is unknown; did you mean "
     "\"diffuse\"?; supported: diffuse, "},
    {"NearestShape", "WorldBegin\nShape \"spher\"\n",
     "main.pbrt:2:1: shape \"spher\" is not supported; did you mean \"sphere\"?; supported: "},
    {"HairOutsideOfItsRange", "WorldBegin\nMaterial \"hair\" \"float alpha\" 91\n",
     "main.pbrt:2:17: material \"hair\": parameter \"alpha\" is 91 but must lie in [-90, 90]"},
    {"MeasuredWithoutItsFile", "WorldBegin\nMaterial \"measured\" \"string filename\" \"a.bsdf\"\n",
     "main.pbrt:2:21: material \"measured\": parameter \"filename\" cannot be read: "},
    {"CoatOverReflectanceAndIndex",
     "WorldBegin\nMaterial \"coatedconductor\" \"rgb reflectance\" [1 1 1] "
     "\"spectrum conductor.k\" \"metal-Cu-k\"\n",
     "reflectance excludes conductor.eta and conductor.k; give one or the other"},
    {"ScatteringCoat", "WorldBegin\nMaterial \"coatedconductor\" \"rgb albedo\" [0.5 0.5 0.5]\n",
     "main.pbrt:2:28: material \"coatedconductor\": parameter \"albedo\" is not supported unless "
     "0"},
    {"CoatOfTexturedRoughness",
     "Texture \"t\" \"float\" \"constant\"\nWorldBegin\n"
     "Material \"coatedconductor\" \"texture interface.roughness\" \"t\"\n",
     "parameter \"interface.roughness\" is not supported as a texture; give a number"},
    {"UnknownTexture", "WorldBegin\nTexture \"t\" \"float\" \"ptex\"\n",
     "main.pbrt:2:1: texture \"t\": class \"ptex\" is not supported"},
    {"TextureOfNumbers", "WorldBegin\nTexture \"t\" \"spectrum\" \"fbm\"\n",
     "main.pbrt:2:1: texture \"t\": class \"fbm\" is a float texture; for a color, give it to "
     "\"mix\" as \"texture amount\""},
    {"UnknownNode", "WorldBegin\nTexture \"t\" \"float\" \"node\" \"string node\" \"noize\"\n",
     "main.pbrt:2:28: texture \"t\": parameter \"node\" is \"noize\"; it must be one of noise, "},
    {"FallingRamp",
     "WorldBegin\nTexture \"t\" \"float\" \"ramp\" \"float positions\" [1 0] "
     "\"float values\" [0 1]\n",
     "texture \"t\": parameter \"positions\" must not decrease"},
    {"MissingNormalMap", "WorldBegin\nMaterial \"diffuse\" \"string normalmap\" \"no.png\"\n",
     "main.pbrt:2:20: material \"diffuse\": parameter \"normalmap\" cannot be read: file "
     "\"no.png\""},
    {"MissingEmission", "WorldBegin\nAreaLightSource \"diffuse\" \"string filename\" \"no.png\"\n",
     "main.pbrt:2:27: area light \"diffuse\": parameter \"filename\" cannot be read: file "
     "\"no.png\""},
    {"FilmType", "Film \"deep\"\nWorldBegin\n", "main.pbrt:1:1: film \"deep\" is unknown"},
    {"Sensor", "Film \"rgb\" \"string sensor\" \"canon_eos_101d\"\nWorldBegin\n",
     "main.pbrt:1:12: film \"rgb\": parameter \"sensor\" \"canon_eos_101d\" is unknown; did you "},
    {"Filter", "PixelFilter \"catmull\"\nWorldBegin\n",
     "main.pbrt:1:1: filter \"catmull\" is not supported"},
    {"Integrator", "Integrator \"ambientocclusion\"\nWorldBegin\n",
     "main.pbrt:1:1: integrator \"ambientocclusion\" is not supported, because it does not "
     "show"},
    {"OldFilm", "Camera \"perspective\"\nFilm \"image\" \"integer xresolution\" 8\nWorldBegin\n",
     "main.pbrt:2:1: this is pbrt-v3 (Film \"image\"), and Sheaf reads pbrt-v4; pbrt-v4's own "
     "program "
     "rewrites such a file: pbrt --upgrade"},
    {"OldMaterial", "WorldBegin\nMakeNamedMaterial \"m\" \"string type\" \"uber\"\n",
     "main.pbrt:2:1: this is pbrt-v3 (\"string type\" \"uber\")"},
    {"OldParameter", "WorldBegin\nMaterial \"diffuse\" \"rgb Kd\" [1 1 1]\n",
     "main.pbrt:2:1: this is pbrt-v3 (parameter \"Kd\" of Material)"},
    {"OldColor", "WorldBegin\nLightSource \"point\" \"color I\" [1 1 1]\n",
     "main.pbrt:2:21: this is pbrt-v3 (\"color I\")"},
    {"OldTexture",
     "WorldBegin\nTexture \"t\" \"color\" \"imagemap\" \"string filename\" \"a.png\"\n",
     "main.pbrt:2:1: this is pbrt-v3 (a texture of type color)"},
    {"Sampler", "Sampler \"best\"\nWorldBegin\n", "main.pbrt:1:1: sampler \"best\" is unknown"},
    {"ColorSpace", "ColorSpace \"prophoto\"\nWorldBegin\n",
     "main.pbrt:1:1: color space \"prophoto\" is unknown; supported: srgb, aces2065-1, "
     "rec2020, dci-p3"},
    {"BadLuminaire", "WorldBegin\nLightSource \"goniometric\" \"string filename\" \"bad.IES\"\n",
     "main.pbrt:2:27: light \"goniometric\": parameter \"filename\" cannot be read: bad.IES:2:1: "
     "expected the number of lamps, a number, not \"x\""},
    {"UnknownMapping", "Camera \"spherical\" \"string mapping\" \"cube\"\nWorldBegin\n",
     "main.pbrt:1:20: camera \"spherical\": parameter \"mapping\" \"cube\" is not supported; "
     "supported: equalarea and equirectangular"},
    {"Option", "Option \"forcediffuse\" true\nWorldBegin\n",
     "main.pbrt:1:1: option \"forcediffuse\" is not supported"},
    {"Medium", "MediumInterface \"\" \"fog\"\nWorldBegin\n",
     "main.pbrt:1:1: medium \"fog\" is used here but not defined"},
    {"NoMaterial",
     "WorldBegin\nNamedMaterial \"golb\"\nMakeNamedMaterial \"gold\" \"string type\" \"diffuse\"\n",
     "main.pbrt:2:1: material \"golb\" is used here but not defined; did you mean \"gold\"?"},
    {"MaterialTwice",
     "WorldBegin\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\"\nMakeNamedMaterial \"a\" "
     "\"string type\" \"diffuse\"\n",
     "main.pbrt:3:1: named material \"a\" is defined twice; the first is at main.pbrt:2:1"},
    {"MixOfItself",
     "WorldBegin\nMakeNamedMaterial \"a\" \"string type\" \"mix\" \"string materials\" [\"a\" "
     "\"a\"]\n",
     "main.pbrt:2:1: the mix material \"a\" contains itself"},
    {"NoTexture", "WorldBegin\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n",
     "main.pbrt:2:20: the spectrum texture \"t\" is used here but not declared"},
    {"TextureOfItself", "WorldBegin\nTexture \"t\" \"float\" \"scale\" \"texture tex\" \"t\"\n",
     "main.pbrt:2:29: texture \"t\": parameter \"tex\" refers to the float texture \"t\", which is "
     "not declared before"},
    {"MissingImage",
     "WorldBegin\nTexture \"t\" \"float\" \"imagemap\" \"string filename\" \"no.png\"\n",
     "main.pbrt:2:32: texture \"t\": parameter \"filename\" cannot be read: file \"no.png\" does "
     "not exist"},
    {"MissingMesh", "WorldBegin\nShape \"plymesh\" \"string filename\" \"no.ply\"\n",
     "main.pbrt:2:17: shape \"plymesh\": parameter \"filename\" cannot be read"},
    {"TruncatedMesh", "WorldBegin\nShape \"plymesh\" \"string filename\" \"bad.ply\"\n",
     "cannot be read: bad.ply: the file ends too early"},
    {"IndexRange",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 "
     "3]\n",
     "parameter \"indices\" holds 3 in triangle 0, outside [0, 3)"},
    {"NegativeIndex",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 "
     "-1]\n",
     "parameter \"indices\" holds -1 in triangle 0"},
    {"PatchIndexCount",
     "WorldBegin\nShape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0] \"integer "
     "indices\" "
     "[0 1 3]\n",
     "main.pbrt:2:59: shape \"bilinearmesh\": parameter \"indices\" needs four indices a patch, "
     "but "
     "has 3"},
    {"PatchIndexRange",
     "WorldBegin\nShape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0] \"integer "
     "indices\" "
     "[0 1 2 4]\n",
     "parameter \"indices\" holds 4 in patch 0, outside [0, 4)"},
    {"PatchIndicesMissing",
     "WorldBegin\n Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n",
     "main.pbrt:2:2: shape \"bilinearmesh\" needs \"integer indices\" where it has more than one "
     "patch"},
    {"PatchesWithoutVertices", "WorldBegin\nShape \"bilinearmesh\" \"integer indices\" [0 1 2 3]\n",
     "main.pbrt:2:1: shape \"bilinearmesh\" needs \"point3 P\", its vertices"},
    {"PatchUvCount",
     "WorldBegin\nShape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0] \"point2 uv\" [0 "
     "1]\n",
     "parameter \"uv\" has 1 entries, but P has 4 vertices"},
    {"EdgeLength",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n"
     "  \"float displacement\" 1 \"float displacement.edgelength\" 0\n",
     "main.pbrt:3:26: shape \"trianglemesh\": parameter \"displacement.edgelength\" must be "
     "greater "
     "than 0"},
    {"EdgeScale", "Option \"float displacementedgescale\" -1\nWorldBegin\n",
     "main.pbrt:1:1: option \"displacementedgescale\": \"-1\" is not a number greater than 0"},
    {"StepCount",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n"
     "  \"point3 P1\" [0 0 0 1 0 0]\n",
     "main.pbrt:3:3: shape \"trianglemesh\": parameter \"P1\" has 2 entries, but P has 3"},
    {"StepWithoutNormals",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n"
     "  \"normal N\" [0 0 1 0 0 1 0 0 1] \"point3 P1\" [0 0 0 1 0 0 0 1 1]\n",
     "main.pbrt:3:34: shape \"trianglemesh\": parameter \"P1\" needs \"normal N1\" where there is"},
    {"StepMissing",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n"
     "  \"point3 P2\" [0 0 0 1 0 0 0 1 1]\n",
     "main.pbrt:3:3: shape \"trianglemesh\": parameter \"P2\" is unknown here"},
    {"StepsOfALight",
     "WorldBegin\nAreaLightSource \"diffuse\"\n"
     "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"point3 P1\" [0 0 0 1 0 0 0 1 1]\n",
     "main.pbrt:3:1: shape \"trianglemesh\": a mesh that deforms cannot be an area light"},
    {"DisplacedSteps",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n"
     "  \"point3 P1\" [0 0 0 1 0 0 0 1 1] \"float displacement\" 1\n",
     "main.pbrt:3:35: shape \"trianglemesh\": parameter \"displacement\" is not supported for a "
     "mesh "
     "that deforms"},
    {"StepFile",
     "WorldBegin\nShape \"plymesh\" \"string filename\" \"one.ply\" \"string filename1\" "
     "\"two.ply\"\n",
     "main.pbrt:2:45: shape \"plymesh\": parameter \"filename1\" does not fit \"filename\""},
    {"CylinderRadius", "WorldBegin\nShape \"cylinder\" \"float radius\" 0\n",
     "main.pbrt:2:1: shape \"cylinder\": needs radius > 0 and zmin other than zmax, but has radius "
     "0"},
    {"CylinderHeight", "WorldBegin\nShape \"cylinder\" \"float zmin\" 1\n",
     "main.pbrt:2:1: shape \"cylinder\": needs radius > 0 and zmin other than zmax"},
    {"NormalCount",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"normal N\" [0 0 1]\n",
     "parameter \"N\" has 1 entries, but P has 3 vertices"},
    {"TangentCount",
     "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"vector3 S\" [0 0 1]\n",
     "parameter \"S\" has 1 entries, but P has 3 vertices"},
    {"MovingAreaLight",
     "WorldBegin\nActiveTransform EndTime Translate 1 0 0 AreaLightSource \"diffuse\"\n"
     "Shape \"sphere\"\n",
     "main.pbrt:3:1: shape \"sphere\": an area light cannot move while the shutter is open"},
    {"BrightSurface", "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [0.5 1.5 0.5]\n",
     "parameter \"reflectance\" has a component greater than 1"},
    {"NegativeLight", "WorldBegin\nLightSource \"point\" \"rgb I\" [1 -1 1]\n",
     "parameter \"I\" has a negative component"},
    {"UnknownSpectrum", "WorldBegin\nMaterial \"conductor\" \"spectrum eta\" \"metal-Ac-eta\"\n",
     "names no known spectrum"},
    {"BadSpectrumFile", "WorldBegin\nMaterial \"conductor\" \"spectrum eta\" \"bad.spd\"\n",
     "cannot use the spectrum file \"bad.spd\": line 1, column 7: expected a number"},
    {"OddSpectrum", "WorldBegin\nLightSource \"point\" \"spectrum I\" [400 1 500]\n",
     "needs pairs of wavelength in nm and value"},
    {"SpectrumOrder", "WorldBegin\nLightSource \"point\" \"spectrum I\" [500 1 400 1]\n",
     "has wavelengths that do not increase"},
    {"NonManifold",
     "WorldBegin\nShape \"loopsubdiv\" \"point3 P\" [0 0 0 1 0 0 0 1 0 0 0 1 0 -1 0] \"integer "
     "indices\" [0 1 2 0 1 3 0 1 4]\n",
     "main.pbrt:2:1: shape \"loopsubdiv\": the edge between vertices 0 and 1 belongs to more than "
     "two triangles"},
};
INSTANTIATE_TEST_SUITE_P(Diagnostics, BadSceneTest, ::testing::ValuesIn(kBadScenes),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(SceneNotesTest, ByteOrderMarksAreSkipped) {
  const std::string directory = ::testing::TempDir() + "sheaf-scene-bom";
  ASSERT_TRUE(MakeDirectories(directory).ok());
  WriteFaultyText(directory + "/main.pbrt", "\xef\xbb\xbfWorldBegin\nInclude \"more.pbrt\"\n");
  WriteFaultyText(directory + "/more.pbrt", "\xef\xbb\xbf");
  DirectoryFileSource files(directory);
  EXPECT_TRUE(ReadScene("main.pbrt", files).ok());
  WriteFaultyText(directory + "/more.pbrt", "\xef\xbb\xbfShap \"sphere\"\n");
  EXPECT_THAT(std::string(ReadScene("main.pbrt", files).status().message()),
              HasSubstr("more.pbrt:1:1: unknown directive \"Shap\""));
}

TEST(SceneNotesTest, WhatMeshFilesHoldWithoutEffectIsNotedOnce) {
  const std::string directory = ::testing::TempDir() + "sheaf-scene-skipped";
  ASSERT_TRUE(MakeDirectories(directory).ok());
  const std::string points =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nend_header\n0 0 0 1\n1 0 0 1\n";
  for (const char* name : {"/a.ply", "/b.ply"}) WriteFaultyText(directory + name, points);
  WriteFaultyText(directory + "/main.pbrt",
                  "WorldBegin\nShape \"plymesh\" \"string filename\" \"a.ply\"\n"
                  "Shape \"plymesh\" \"string filename\" \"b.ply\"\n"
                  "Shape \"plymesh\" \"string filename\" \"a.ply\"\n");
  DirectoryFileSource files(directory);
  const absl::StatusOr<ReadSceneResult> read = ReadScene("main.pbrt", files);
  ASSERT_TRUE(read.ok()) << read.status();
  std::vector<std::string> texts;
  for (const SceneDiagnostic& d : read->diagnostics) texts.push_back(d.text);
  EXPECT_EQ(
      texts,
      (std::vector<std::string>{
          "main.pbrt:2:17: shape \"plymesh\": a.ply:7: the property red of 4 rows of the "
          "element \"vertex\" has no effect (the sum of 2 files, of which this is the first)",
          "main.pbrt:2:17: shape \"plymesh\": a.ply: there are no faces, only points, and its "
          "4 vertices are not shown; export it with faces, or remove the shape (the sum of 2 "
          "files, of which this is the first)"}));
}

TEST(SceneMemoryTest, RefinementRespectsTheMemoryLimit) {
  const std::string directory = ::testing::TempDir() + "sheaf-scene-memory";
  ASSERT_TRUE(MakeDirectories(directory).ok());
  SceneReaderLimits limits;
  limits.memory_bytes_max = uint64_t{900} << 20;
  limits.memory_limit = "what this machine has";
  const auto read = [&](const std::string& levels) {
    WriteFaultyText(directory + "/main.pbrt",
                    "WorldBegin\nShape \"loopsubdiv\" \"integer levels\" " + levels +
                        " \"integer indices\" [0 1 2 0 2 3]\n"
                        "\"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0]\n");
    DirectoryFileSource files(directory);
    return ReadScene("main.pbrt", files, limits).status();
  };
  const absl::Status status = read("11");
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  const std::string message(status.message());
  EXPECT_THAT(message, HasSubstr("main.pbrt:2:1: "));
  EXPECT_THAT(message, HasSubstr("11 levels make 8388608 triangles of its 2"));
  EXPECT_THAT(message, HasSubstr("1.2 GiB"));
  EXPECT_THAT(message, HasSubstr("what this machine has"));
  EXPECT_TRUE(read("3").ok());
}

}  // namespace
}  // namespace sheaf
