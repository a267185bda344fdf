#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The converter of USD gives the values that small files of ours say, and sheaf renders them.

Usage: converter_test.py SCRIPT, the converter that the build made.
"""
import json
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zipfile
import zlib

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "integration")]
import crate_writer  # pylint: disable=wrong-import-position
import farm  # pylint: disable=wrong-import-position

SCRIPT = sys.argv.pop(1) if len(sys.argv) > 1 and sys.argv[1].endswith(".cjs") else ""
SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
QUAD = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
"""
# Tries what a converter must not do, and says what came of it.
PROBE = """
const fs = require('fs'), net = require('net'), child = require('child_process');
const answer = {};
const attempt = (name, action) => {
  try { action(); answer[name] = 'done'; } catch (error) { answer[name] = error.code; }
};
const folder = require('path').dirname(process.argv[2]);
attempt('read', () => fs.readFileSync('/etc/passwd'));
attempt('write', () => fs.writeFileSync(folder + '/written', 'x'));
attempt('list', () => fs.readdirSync(folder));
answer.start = child.spawnSync('/bin/ls').error?.code ?? 'done';
const socket = net.connect(80, '127.0.0.1');
const end = (word) => { answer.connect = word; console.log(JSON.stringify(answer)); };
socket.on('error', (error) => end(error.code));
socket.on('connect', () => end('done'));
"""
SURFACE = """
    def Material "%s"
    {
        token outputs:surface.connect = </Looks/%s/Surface.outputs:surface>
        def Shader "Surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            %s
            token outputs:surface
        }
        %s
    }
"""


def png(width, height, pixels):
    """RGB rows from the top."""
    def chunk(name, data):
        body = name + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))
    rows = b"".join(b"\0" + bytes(pixels[y * width * 3:(y + 1) * width * 3]) for y in range(height))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) +
            chunk(b"IEND", b""))


class Gltf:
    """The parts of a converted file."""

    def __init__(self, answer, data):
        self.notes = answer["notes"]
        size = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20:20 + size])
        self.bytes = data[28 + size:]

    def values(self, index):
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        count = accessor["count"] * SIZES[accessor["type"]]
        kind = {5126: "f", 5125: "I", 5123: "H"}[accessor["componentType"]]
        return list(struct.unpack_from(f"<{count}{kind}", self.bytes, view["byteOffset"]))

    def node(self, name):
        return next(n for n in self.json["nodes"] if n.get("name") == name)

    def image(self, index):
        view = self.json["bufferViews"][self.json["images"][index]["bufferView"]]
        return self.bytes[view["byteOffset"]:view["byteOffset"] + view["byteLength"]]

    def primitive(self, name, index=0):
        return self.json["meshes"][self.node(name)["mesh"]]["primitives"][index]

    def material(self, primitive):
        return self.json["materials"][primitive["material"]]


class ConverterTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="sheaf usd ")
        self.addCleanup(self.folder.cleanup)

    def write(self, name, data):
        path = os.path.join(self.folder.name, name)
        with open(path, "wb") as out:
            out.write(data if isinstance(data, bytes) else data.encode())
        return path

    def answer(self, path):
        with open(SCRIPT, "rb") as script:
            done = subprocess.run(["node", "-", path], stdin=script, capture_output=True,
                                  check=True, timeout=60 * farm.PATIENCE)
        head, _, rest = done.stdout.partition(b"\n")
        return json.loads(head), rest

    def convert(self, path):
        answer, data = self.answer(path)
        self.assertNotIn("error", answer)
        self.assertEqual(answer["glb"], len(data))
        return Gltf(answer, data)

    def scene(self, text, meta="metersPerUnit = 1", name="scene.usda"):
        return self.convert(self.write(name, f"#usda 1.0\n(\n{meta}\n)\n{text}"))

    def close(self, values, expected, delta=1e-6):
        self.assertEqual(len(values), len(expected))
        for value, wanted in zip(values, expected):
            self.assertAlmostEqual(value, wanted, delta=delta)

    def test_polygons_become_triangles_with_their_attributes(self):
        gltf = self.scene(f"""def Mesh "Quad" {{ {QUAD}
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "faceVarying")
    normal3f[] normals = [(0, 0, 1)] (interpolation = "uniform")
    color3f[] primvars:displayColor = [(0.5, 0.25, 1)]
    uniform bool doubleSided = 1
}}""")
        primitive = gltf.primitive("Quad")
        self.assertEqual(gltf.values(primitive["indices"]), [0, 1, 2, 0, 2, 3])
        attributes = primitive["attributes"]
        self.close(gltf.values(attributes["POSITION"]), [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0])
        self.close(gltf.values(attributes["NORMAL"]), [0, 0, 1] * 4)
        self.close(gltf.values(attributes["COLOR_0"]), [0.5, 0.25, 1, 1] * 4)
        self.assertTrue(gltf.material(primitive)["doubleSided"])
        self.assertEqual(gltf.notes, [])

    def test_concave_polygons_and_left_hands(self):
        gltf = self.scene("""def Mesh "Arrow" {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (2, -1, 0), (0.5, 0, 0), (2, 1, 0)]
    uniform token subdivisionScheme = "none"
    uniform token orientation = "leftHanded"
}""")
        primitive = gltf.primitive("Arrow")
        points = gltf.values(primitive["attributes"]["POSITION"])
        indices = gltf.values(primitive["indices"])
        area = 0
        for i in range(0, len(indices), 3):
            a, b, c = (points[j * 3:j * 3 + 2] for j in indices[i:i + 3])
            area += ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2
        self.assertAlmostEqual(area, -0.5, delta=1e-6)

    def test_a_cube_with_a_texture_in_a_package(self):
        image = png(2, 1, [255, 0, 0, 0, 0, 255])
        texture = """def Shader "Image" {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @textures/red.png@
                float2 inputs:st.connect = </Looks/Red/Place.outputs:result>
                token inputs:wrapS = "clamp"
                float3 outputs:rgb
            }
            def Shader "Place" {
                uniform token info:id = "UsdTransform2d"
                float inputs:rotation = 90
                float2 inputs:scale = (2, 3)
                float2 inputs:translation = (0.25, 0.5)
                float2 inputs:in.connect = </Looks/Red/St.outputs:result>
            }
            def Shader "St" {
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "map1"
            }"""
        look = SURFACE % ("Red", "Red", """
            color3f inputs:diffuseColor.connect = </Looks/Red/Image.outputs:rgb>
            float inputs:roughness = 0.25
            float inputs:clearcoat = 1
            color3f inputs:emissiveColor = (0, 4, 2)""", texture)
        text = f"""#usda 1.0
(
    metersPerUnit = 1
)
def Scope "Looks" {{ {look} }}
def Mesh "Quad" {{ {QUAD}
    texCoord2f[] primvars:map1 = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    rel material:binding = </Looks/Red>
}}"""
        path = os.path.join(self.folder.name, "cube.usdz")
        with zipfile.ZipFile(path, "w") as package:
            package.writestr("cube.usda", text)
            package.writestr("textures/red.png", image)
        gltf = self.convert(path)
        primitive = gltf.primitive("Quad")
        material = gltf.material(primitive)
        pbr = material["pbrMetallicRoughness"]
        self.assertEqual(gltf.image(0), image)
        self.assertEqual(gltf.json["samplers"][0]["wrapS"], 33071)
        self.assertEqual((pbr["roughnessFactor"], pbr["metallicFactor"]), (0.25, 0))
        self.close(material["emissiveFactor"], [0, 1, 0.5])
        extensions = material["extensions"]
        self.assertEqual(extensions["KHR_materials_emissive_strength"]["emissiveStrength"], 4)
        self.assertEqual(extensions["KHR_materials_clearcoat"]["clearcoatFactor"], 1)
        self.check_place(gltf, primitive, pbr["baseColorTexture"])

    def check_place(self, gltf, primitive, reference):
        """At each corner glTF reads the texel that USD does, with v from the other end."""
        place = reference["extensions"]["KHR_texture_transform"]
        uv = gltf.values(primitive["attributes"]["TEXCOORD_0"])
        c, s = math.cos(place["rotation"]), math.sin(place["rotation"])
        for i, (u, v) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
            x, y = uv[i * 2] * place["scale"][0], uv[i * 2 + 1] * place["scale"][1]
            read = (c * x + s * y + place["offset"][0], c * y - s * x + place["offset"][1])
            wanted = (0.25 - 3 * v, 1 - (0.5 + 2 * u))
            self.close(read, wanted)

    def test_subsets_have_materials_of_their_own(self):
        looks = SURFACE % ("A", "A", "color3f inputs:diffuseColor = (1, 0, 0)", "")
        looks += SURFACE % ("B", "B", "float inputs:metallic = 1\nfloat inputs:opacity = 0.5", "")
        gltf = self.scene(f"""def Scope "Looks" {{ {looks} }}
def Mesh "Two" (rel material:binding = </Looks/A>) {{
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    rel material:binding = </Looks/A>
    def GeomSubset "Second" {{
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </Looks/B>
    }}
}}""".replace(' (rel material:binding = </Looks/A>) ', ' '))
        second, first = gltf.primitive("Two", 0), gltf.primitive("Two", 1)
        self.close(gltf.material(first)["pbrMetallicRoughness"]["baseColorFactor"], [1, 0, 0, 1])
        self.assertEqual(gltf.material(second)["pbrMetallicRoughness"]["metallicFactor"], 1)
        self.assertEqual(gltf.material(second)["alphaMode"], "BLEND")
        self.close(gltf.values(second["attributes"]["POSITION"]), [0, 0, 0, 1, 1, 0, 0, 1, 0])

    def test_stacks_of_transforms(self):
        gltf = self.scene(f"""def Xform "Turned" {{
    double3 xformOp:translate = (1, 2, 3)
    float xformOp:rotateZ = 90
    double3 xformOp:scale = (2, 3, 4)
    float3 xformOp:translate:pivot = (5, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:pivot",
        "xformOp:rotateZ", "xformOp:scale", "!invert!xformOp:translate:pivot"]
    def Mesh "Quad" {{ {QUAD} }}
}}""")
        # (1, 0, 0) - pivot, scaled, turned, + pivot, + (1, 2, 3).
        m = gltf.node("Turned")["matrix"]
        self.close([m[i] + m[12 + i] for i in range(3)], [6, 2 - 8, 3])

    def test_z_up_and_units(self):
        gltf = self.scene(f'def Mesh "Quad" {{ {QUAD} }}', 'upAxis = "Z"\nmetersPerUnit = 0.5')
        root = gltf.json["nodes"][gltf.json["scenes"][0]["nodes"][0]]
        self.close(root["rotation"], [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)])
        self.assertEqual(root["scale"], [0.5] * 3)

    def test_cameras(self):
        gltf = self.scene(f"""def Mesh "Quad" {{ {QUAD} }}
def Camera "Eye" {{
    float focalLength = 35
    float horizontalAperture = 36
    float verticalAperture = 24
    float2 clippingRange = (0.1, 100)
}}""")
        camera = gltf.json["cameras"][gltf.node("Eye")["camera"]]["perspective"]
        self.assertAlmostEqual(camera["yfov"], 2 * math.atan(12 / 35))
        self.assertAlmostEqual(camera["aspectRatio"], 1.5)

    def test_lights(self):
        gltf = self.scene(f"""def Mesh "Quad" {{ {QUAD} }}
def RectLight "Lamp" {{
    float inputs:intensity = 10
    float inputs:exposure = 1
    color3f inputs:color = (1, 0.5, 0.25)
    float inputs:width = 2
    float inputs:height = 4
    bool inputs:normalize = 1
}}
def DistantLight "Sun" {{
    float inputs:intensity = 3
    bool inputs:normalize = 1
}}
def SphereLight "Point" {{
    float inputs:intensity = 7
    float inputs:radius = 0
    bool treatAsPoint = 1
}}
def SphereLight "Spot" {{
    float inputs:intensity = 5
    float inputs:radius = 2
    float inputs:shaping:cone:angle = 30
    float inputs:shaping:cone:softness = 0.5
}}""")
        lamp = gltf.material(gltf.primitive("Lamp"))
        self.close(lamp["emissiveFactor"], [1, 0.5, 0.25])
        strength = lamp["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]
        self.assertAlmostEqual(strength, 20 / 8)
        punctual = gltf.json["extensions"]["KHR_lights_punctual"]["lights"]
        lights = {light["name"]: light for light in punctual}
        self.assertAlmostEqual(lights["Sun"]["intensity"], 3)
        self.assertAlmostEqual(lights["Spot"]["intensity"], 5 * math.pi * 4)
        self.assertAlmostEqual(lights["Point"]["intensity"], 7 / 4)
        self.assertAlmostEqual(lights["Spot"]["spot"]["outerConeAngle"], math.radians(30))
        self.assertAlmostEqual(lights["Spot"]["spot"]["innerConeAngle"], math.radians(15))

    def test_dome_lights(self):
        text = (f'def Mesh "Quad" {{ {QUAD} }}\n'
                'def DomeLight%s "Sky" { float inputs:intensity = 3 }')
        # The center of the image is +z of the dome, and so +y or +z of the scene; its right -x.
        for kind, axis, center, top in (("", "Y", [0, 0, 1], [0, 1, 0]),
                                        ("", "Z", [0, 1, 0], [0, 0, -1]),
                                        ("_1", "Z", [0, 0, 1], [0, 1, 0])):
            path = self.write("sky.usda", f'#usda 1.0\n(\nupAxis = "{axis}"\n)\n' + text % kind)
            answer, data = self.answer(path)
            sky = answer["environment"]
            self.close(sky["rotation"], center + top + [-1, 0, 0])
            self.assertEqual(sky["scale"], [3] * 3)
            self.assertEqual(data[answer["glb"]:][:10], b"#?RADIANCE")
            self.assertEqual(len(data), answer["glb"] + sky["image"])

    def test_images_of_domes_by_srgb(self):
        self.write("sky.png", png(2, 1, [255, 0, 0, 188, 188, 188]))
        path = self.write("sky.usda", f"""#usda 1.0
def Mesh "Quad" {{ {QUAD} }}
def DomeLight "Sky" {{ asset inputs:texture:file = @sky.png@ }}""")
        answer, data = self.answer(path)
        image = data[answer["glb"]:]
        # A mantissa of 8 bits, and the exponent of the largest.
        self.assertEqual(image[-8:], bytes([128, 0, 0, 129, 129, 129, 129, 128]))

    def test_composition(self):
        self.write("part.usda", f"""#usda 1.0
(
    defaultPrim = "Part"
)
def Xform "Part" (
    variants = {{
        string side = "left"
    }}
    variantSets = "side"
) {{
    variantSet "side" = {{
        "left" {{
            def Mesh "Left" {{ {QUAD} }}
        }}
        "right" {{
            def Mesh "Right" {{ {QUAD} }}
        }}
    }}
}}""")
        self.write("layer.usda", '#usda 1.0\nover "B" { token visibility = "invisible" }')
        gltf = self.scene("""def "A" (references = @part.usda@
    variants = { string side = "right" }) {}
def "B" (payload = @part.usda@</Part>) {}
def "C" (references = </A>) {}
""", "metersPerUnit = 1\nsubLayers = [@layer.usda@]")
        names = [node.get("name") for node in gltf.json["nodes"] if "mesh" in node]
        self.assertEqual(names, ["Right", "Right"])
        self.assertEqual(len(gltf.json["meshes"]), 1)

    def test_point_instances(self):
        gltf = self.scene(f"""def PointInstancer "Many" {{
    rel prototypes = [</Many/Quad>]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(1, 0, 0), (0, 2, 0)]
    float3[] scales = [(1, 1, 1), (3, 3, 3)]
    quath[] orientations = [(1, 0, 0, 0), (0, 0, 0, 1)]
    def Mesh "Quad" {{ {QUAD} }}
}}""")
        matrices = [node["matrix"] for node in gltf.json["nodes"] if "matrix" in node]
        self.close(matrices[0][12:15], [1, 0, 0])
        self.close(matrices[1], [-3, 0, 0, 0, 0, -3, 0, 0, 0, 0, 3, 0, 0, 2, 0, 1])
        self.assertEqual(sum("mesh" in node for node in gltf.json["nodes"]), 2)

    def test_animations(self):
        gltf = self.scene(f"""def Mesh "Quad" {{ {QUAD}
    double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 0), 25: (2, 0, 0) }}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}""", "metersPerUnit = 1\nstartTimeCode = 1\ntimeCodesPerSecond = 24")
        animation = gltf.json["animations"][0]
        channel = next(c for c in animation["channels"] if c["target"]["path"] == "translation")
        sampler = animation["samplers"][channel["sampler"]]
        self.close(gltf.values(sampler["input"]), [0, 1])
        self.close(gltf.values(sampler["output"]), [0, 0, 0, 2, 0, 0])

    def test_skins(self):
        gltf = self.scene(f"""def SkelRoot "Root" {{
    def Skeleton "Bones" {{
        uniform token[] joints = ["a", "a/b"]
        uniform matrix4d[] bindTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)),
            ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,2,0,1))]
        uniform matrix4d[] restTransforms = [((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1)),
            ((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,2,0,1))]
    }}
    def Mesh "Quad" {{ {QUAD}
        rel skel:skeleton = </Root/Bones>
        int[] primvars:skel:jointIndices = [0, 1, 1, 0, 1, 0, 0, 0] (elementSize = 2
            interpolation = "vertex")
        float[] primvars:skel:jointWeights = [1, 0, 1, 0, 0.5, 0.5, 1, 0] (elementSize = 2
            interpolation = "vertex")
    }}
}}""")
        skin = gltf.json["skins"][gltf.node("Quad")["skin"]]
        self.assertEqual([gltf.json["nodes"][j]["name"] for j in skin["joints"]], ["a", "b"])
        self.close(gltf.values(skin["inverseBindMatrices"])[28:31], [0, -2, 0])
        attributes = gltf.primitive("Quad")["attributes"]
        self.close(gltf.values(attributes["WEIGHTS_0"])[8:12], [0.5, 0.5, 0, 0])

    def test_crates_say_what_text_says(self):
        gltf = self.convert(self.write("quad.usdc", crate_writer.quad()))
        primitive = gltf.primitive("Quad")
        self.assertEqual(gltf.values(primitive["indices"]), [0, 1, 2, 0, 2, 3])
        self.close(gltf.values(primitive["attributes"]["POSITION"]),
                   [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0])
        root = gltf.json["nodes"][gltf.json["scenes"][0]["nodes"][0]]
        self.assertEqual(root["scale"], [0.25] * 3)

    def test_broken_crates_are_refused(self):
        """Each is an answer in time: none hangs, ends the process, or takes what it claims."""
        data = crate_writer.quad()
        for at in range(8, len(data), 41):
            path = self.write("broken.usdc", data[:at] + b"\xff" + data[at + 1:])
            answer, _ = self.answer(path)
            self.assertTrue("error" in answer or "glb" in answer, at)

    def test_the_process_is_confined(self):
        path = self.write("scene.usda", "#usda 1.0")
        program = os.path.join(farm.programs(), "sheaf-usd-reader")
        done = subprocess.run([program, shutil.which("node"), os.path.realpath(path),
                               str(1 << 31), "60"], input=PROBE, capture_output=True, text=True,
                              timeout=60 * farm.PATIENCE, check=True)
        answer = json.loads(done.stdout)
        self.assertEqual((answer["list"], answer["connect"], answer["start"]),
                         ("done", "EPERM", "EPERM"))
        # Landlock, which some systems lack.
        if answer["read"] != "done":
            self.assertEqual((answer["read"], answer["write"]), ("EACCES", "EACCES"))

    def test_sheaf_renders_and_notes(self):
        path = self.write("scene.usda", f"""#usda 1.0
(
    metersPerUnit = 1
)
def Mesh "Quad" {{ {QUAD} }}
def NurbsPatch "Patch" {{ }}
""")
        image = os.path.join(self.folder.name, "image.exr")
        done = subprocess.run([os.path.join(farm.programs(), "sheaf"), "render", path, "--size",
                               "32x24", "--samples", "1", "-o", image], capture_output=True,
                              text=True, timeout=60 * farm.PATIENCE, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("scene.usda: note: prims of the type NurbsPatch are left out (/Patch)",
                      done.stderr)
        self.assertTrue(os.path.exists(image))


if __name__ == "__main__":
    unittest.main(verbosity=2)
