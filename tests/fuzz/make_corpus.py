#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes the seed corpus tests/fuzz/corpus from our own scenes and from the messages below.

Usage: make_corpus.py [FOLDER]

Parts and images come from a small farm, so build before. Messages are written as text and encoded
by protoc. The corpus is in the repository; run this again when a format changes.
"""
import glob
import gzip
import json
import os
import struct
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path.insert(0, os.path.join(ROOT, "tests", "integration"))
sys.path.insert(0, os.path.join(ROOT, "tests", "gltf"))
import farm  # pylint: disable=wrong-import-position
import make_models  # pylint: disable=wrong-import-position

SCENES = os.path.join(ROOT, "scenes")
GLTF_BYTES_MAX = 2 << 10  # The small ones say enough about the format.
TEXT_BYTES_MAX = 12 << 10  # Longer files of scenes are left out.
TINY = """LookAt 0 0 -3  0 0 0  0 1 0
Camera "perspective" "float fov" 45
Film "rgb" "integer xresolution" 4 "integer yresolution" 4
WorldBegin
LightSource "infinite" "rgb L" [0.5 0.6 0.7]
Material "diffuse" "rgb reflectance" [0.2 0.4 0.8]
Shape "sphere"
"""

STATEMENTS = {
    "curves": """WorldBegin
Shape "curve" "point3 P" [0 0 0  0 1 0  1 1 0  1 2 0] "float width0" 0.1 "float width1" 0.01
Shape "curve" "string type" "ribbon" "integer degree" 2 "string basis" "bspline"
  "point3 P" [0 0 0  0 1 0  1 1 0  1 2 0] "normal N" [0 0 1  0 0 1  0 0 1]
""",
    "shapes": """Include "a.pbrt"
WorldBegin
Shape "plymesh" "string filename" "m.ply"
Shape "disk" "float height" 1 "float innerradius" 0.2
Shape "cylinder" "float zmin" -1 "float zmax" 1 "float phimax" 90
Shape "bilinearmesh" "point3 P" [0 0 0  1 0 0  0 1 0  1 1 1]
Shape "loopsubdiv" "integer levels" 2 "integer indices" [0 1 2 0 2 3 0 3 1 1 3 2]
  "point3 P" [-1 -1 5  1 -1 5  0 1 5  0 0 6]
""",
    "world": """Option "integer seed" 3
ColorSpace "rec2020"
Sampler "zsobol" "integer pixelsamples" 16
Integrator "volpath" "integer maxdepth" 9
Film "rgb" "integer xresolution" 8 "integer yresolution" 8 "float cropwindow" [0 0.5 0 1]
MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_a" [1 2 3] "float g" 0.5
MediumInterface "" "fog"
Camera "realistic" "string lensfile" "lens.dat"
WorldBegin
Attribute "shape" "float radius" 2
AttributeBegin Rotate 30 0 1 0 CoordSysTransform "camera" AttributeEnd
ObjectBegin "o" Shape "sphere" ObjectEnd
ObjectInstance "o"
Texture "t" "spectrum" "scale" "rgb tex" [1 0 0] "float scale" 0.5
MakeNamedMaterial "m" "string type" "coateddiffuse" "texture reflectance" "t"
NamedMaterial "m"
ActiveTransform EndTime Translate 0 1 0 ActiveTransform All
AreaLightSource "diffuse" "blackbody L" 5000
Shape "trianglemesh" "integer indices" [0 1 2] "point3 P" [0 0 0 1 0 0 0 1 0]
""",
    "patterns": """WorldBegin
Scale 2 3 4
Texture "f" "float" "fbm" "integer octaves" 3 "float roughness" 0.6
Texture "w" "float" "wrinkled" "integer octaves" 32
Texture "y" "float" "windy"
Texture "b" "float" "bilerp" "float v00" 0.2 "float v11" 0.7 "string mapping" "spherical"
Texture "m" "spectrum" "marble" "float scale" 3 "float variation" 2
Texture "d" "spectrum" "dots" "texture inside" "m" "rgb outside" [1 0 0] "float uscale" 9
Texture "x" "spectrum" "directionmix" "vector3 dir" [1 2 3] "texture tex1" "d" "rgb tex2" [0 1 0]
Texture "t" "spectrum" "mix" "texture tex1" "x" "texture tex2" "m" "texture amount" "f"
Texture "k" "float" "node" "string node" "voronoi" "string metric" "minkowski" "float exponent" 3
Texture "z" "spectrum" "ramp" "texture input" "k" "float positions" [0 .5]
  "float colors" [1 0 0 0 1 0]
Material "diffuse" "texture reflectance" "t" "texture displacement" "w"
Shape "sphere"
""",
}

MESH = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float u
property float v
element face 2
property list uchar int vertex_indices
end_header
0 0 0 0 0
1 0 0 1 0
1 1 0 1 1
0 1 0 0 1
3 0 1 2
4 0 1 2 3
"""

IES = """IESNA:LM-63-2002
[TEST] none
TILT=NONE
1 1000 1.0 3 2 1 2 0 0 0
1.0 1.0 100
0 45 90
0 90
100 50 0
80 40 0
"""

SPECTRA = {"glass": "400 1.53\n500 1.52\n600 1.515\n700 1.51\n",
           "comment": "# nm value\n380 0.1\n\n720.5 0.9e0\n"}

DIGEST_A, DIGEST_B = "a" * 64, "b" * 64
FRAME = ('frame_number: %d scene { sha256_hex: "' + DIGEST_A + '" size_bytes: 10 } settings { '
         'width_px: 64 height_px: 48 window { x1_px: 64 y1_px: 48 } sample_count: 64 depth_max: 5 '
         'outputs: "position" } ')
PARTITION = "partition { tile_size_px: 16 pass_sample_count: 16 lease_pass_count: 2 } "
CREATE = {
    "plain": f'request_id: "r" title: "job" frames {{ {FRAME % 1} }} {PARTITION}',
    "rounds": f'request_id: "r" frames {{ {FRAME % 1} stop {{ target_error: 0.01 time_max '
              f'{{ seconds: 60 }} }} }} frames {{ {FRAME % 2} resumed_image {{ sha256_hex: '
              f'"{DIGEST_B}" size_bytes: 9 }} }} {PARTITION} priority: 3',
    "effects": f'request_id: "r" pilot: true frames {{ {FRAME % 1} }} {PARTITION} effect_costs '
               '{ name: "fog" problem: "p" ablation: "none" time_fraction: 0.5 }',
    "shared": f'request_id: "r" show: "film@7" frames {{ {FRAME % 1} }} {PARTITION} requirements '
              '{ pool: "gold" tags: "avx512" tags: "big" memory_min_bytes: 1073741824 }',
    "holds": f'request_id: "r" frames {{ {FRAME % 1} }} {PARTITION} approve_after_samples: 8 '
             'dependencies { job_name: "jobs/3" by_frame: true }',
}
REFINE = {"error": 'name: "jobs/1" stop { target_error: 0.001 cpu_max { seconds: 5 } }',
          "samples": 'name: "jobs/1" sample_count: 4096'}
REPORT = ('worker_id: "%s" host: "h" numeric_profile: "profile" thread_count: 2 '
          "requested_lease_count: 4 ")


def header(x, y, first):
    return (f'key {{ frame_digest: "{DIGEST_B}" tile {{ x0_px: {x} y0_px: {y} x1_px: {x + 32} '
            f"y1_px: {y + 32} }} block {{ first: {first} count: 16 }} }} lease_id: 1 worker_id: "
            f'"a" digest {{ sha256_hex: "{DIGEST_A}" size_bytes: 100 }} ray_count: 1000 '
            "cpu_duration { nanos: 1000000 }")


LEASE = ('leases { lease_id: 7 frame_name: "jobs/1/frames/1" key { frame_digest: "' + DIGEST_B
         + '" tile { x1_px: 16 y1_px: 16 } block { count: 16 } %s } scene { sha256_hex: "'
         + DIGEST_A + '" size_bytes: 10 } settings { width_px: 64 height_px: 48 window { x1_px: 64 '
         'y1_px: 48 } sample_count: 64 depth_max: 5 } } ')
REPLIES = {"one": LEASE % "" + "next_synchronize_duration { nanos: 5000000 } "
                               "lease_duration { seconds: 30 }",
           "cells": LEASE % "cell_size_px: 8 cells: 5" + LEASE % ""}
JOB = ('name: "jobs/1" title: "t\\"\\n" state: STATE_RUNNING frames { name: "jobs/1/frames/1" spec '
       "{ " + FRAME % 1 + '} rounds { relative_mse: 0.1 sample_count: 16 } flip: 0.1 } create_time '
       "{ seconds: 1700000000 } progress { sample_count_done: 5 sample_count_total: 10 "
       "cpu_duration { seconds: 3 } }")
WORKER = ('name: "workers/a" host: "h" state: STATE_BUSY thread_count: 4 '
          'last_seen_time { seconds: 5 }')
PRICES = ("prices { target_error: 0.1 reached: true cpu_seconds { value: 1 low: 0.5 high: 2 } } "
          "thread_count: 4")

REQUESTS = {
    "get": "GET /api/v1/jobs?page_size=10&page_token=2\nHost: localhost\n\n",
    "job": "GET /api/v1/jobs/1?page_size=1\nHost: 127.0.0.1:80\n\n",
    "preview": "GET /api/v1/jobs/1/frames/1/preview.png?layer=error&round=0\nHost: [::1]\n\n",
    "priority": "POST /api/v1/jobs/2:priority?value=-7\nHost: farm.example\nX-Sheaf-Request: 1\n"
                "Origin: http://farm.example\n\n",
    "refine": "POST /api/v1/jobs/1:refine?target_error=1e-3&samples=64\nHost: localhost\n"
              "X-Sheaf-Request: 1\n\n",
    "price": "GET /api/v1/jobs/1/refine-price?target_error=0.1,1e-2\nHost: localhost\n\n",
    "escape": "GET /api/v1/jobs/%31/failures?a=%2f\nHost: localhost\n\n",
}
STREAMS = {
    "get": "GET /a HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "two": "GET /a HTTP/1.1\r\nHost: localhost\r\n\r\nGET /b HTTP/1.0\r\nHost: localhost\r\n\r\n",
    "post": "POST /a HTTP/1.1\r\nHost: localhost\r\nX-Sheaf-Request: 1\r\nContent-Length: 3\r\n\r\n"
            "abc",
    "chunked": "POST /a HTTP/1.1\r\nHost: localhost\r\nX-Sheaf-Request: 1\r\nTransfer-Encoding: "
               "chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n",
    "continue": "POST /a HTTP/1.1\r\nHost: localhost\r\nExpect: 100-continue\r\nContent-Length: "
                "70000\r\n\r\n",
}
LINES = {
    "job": "--samples=64\n--crop\n0,0,16,16\n--seed=3\n--color=spectral\n--aov=position,uv",
    "stop": "a.pbrt\n--target-error\n0.01\n--time=1h30m\n--budget\n5",
    "partition": "--tile-size=32\n--pass-samples=16\n--lease-passes=2\n--frames=1-24x5,30",
    "address": "--coordinator=host:7400\n--outptu=a.exr",
    "range": "1-100x5,200,300-301",
}
OCIO = """ocio_profile_version: 2
roles: {scene_linear: Raw, default: Raw}
file_rules: [!<Rule> {name: Default, colorspace: default}]
displays: {sRGB: [!<View> {name: Raw, colorspace: Raw}]}
colorspaces: [!<ColorSpace> {name: Raw, isdata: true}]
"""
ADDRESSES = ("localhost:7400", "[::1]:80", "farm.example", "127.0.0.1:65535", "[fe80::1]")
OUTPUTS = ("position,uv,object-id", "object,asset", "motion,normal,depth")


def encode(message, text):
    """The bytes of a message that is written as text."""
    file = "worker" if message in ("SynchronizeRequest", "SynchronizeResponse",
                                   "ResultHeader") else "job"
    file = "content" if message == "SceneManifest" else file
    return subprocess.run(["protoc", "-I", os.path.join(ROOT, "proto"),
                           f"--encode=sheaf.v1.{message}", f"sheaf/v1/{file}.proto"],
                          input=text.encode(), capture_output=True, check=True).stdout


def sequence(*items):
    """Messages to a farm, as worker_messages_fuzz.cc reads them."""
    return b"".join(struct.pack("<BH", kind, len(data)) + data for kind, data in items)


class Corpus:
    """The folder to which files are written."""

    def __init__(self, folder):
        self.folder = folder

    def add(self, target, name, data):
        folder = os.path.join(self.folder, target)
        os.makedirs(folder, exist_ok=True)
        with open(os.path.join(folder, name), "wb") as file:
            file.write(data.encode() if isinstance(data, str) else data)


def add_scene_files(corpus):
    for path in glob.glob(os.path.join(SCENES, "*.pbrt")):
        text = farm.read_bytes(path)
        if len(text) <= TEXT_BYTES_MAX:
            corpus.add("scene", os.path.basename(path), text)
    for name, text in STATEMENTS.items():
        corpus.add("scene", name, text)
    corpus.add("lens", "double-gauss",
               farm.read_bytes(os.path.join(SCENES, "lenses", "double-gauss-50mm.dat")))
    corpus.add("ply", "ascii", MESH)
    corpus.add("ply", "gzip", gzip.compress(MESH.encode(), mtime=0))
    binary = MESH.split("end_header\n")[0].replace("ascii", "binary_little_endian").replace(
        "face 2", "face 1") + "end_header\n"
    corpus.add("ply", "binary", binary.encode() + struct.pack("<20f", *range(20))
               + struct.pack("<B3i", 3, 0, 1, 2))
    corpus.add("ies", "two-planes", IES)
    for name, text in SPECTRA.items():
        corpus.add("spectrum", name, text)
    corpus.add("measured", "small", tensor_file())


def tensor_file():
    """A measured material of two directions, all of it 1."""
    def floats(*shape):
        count = 1
        for size in shape:
            count *= size
        return 10, shape, struct.pack(f"<{count}f", *([1.0] * count))

    fields = {"description": (1, (4,), b"test"), "phi_i": (10, (1,), struct.pack("<f", 0)),
              "theta_i": (10, (2,), struct.pack("<2f", 0, 1)),
              "wavelengths": (10, (2,), struct.pack("<2f", 400, 700)), "ndf": floats(2, 2),
              "sigma": floats(2, 2), "vndf": floats(1, 2, 2, 2), "luminance": floats(1, 2, 2, 2),
              "spectra": floats(1, 2, 2, 2, 2), "jacobian": (1, (1,), b"\1")}
    head_bytes = 18 + sum(2 + len(name) + 2 + 1 + 8 + 8 * len(shape)
                          for name, (_, shape, _) in fields.items())
    head, data = b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)), b""
    for name, (kind, shape, values) in fields.items():
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack(f"<HBQ{len(shape)}Q", len(shape), kind, head_bytes + len(data), *shape)
        data += values
    assert len(head) == head_bytes
    return head + data


def add_messages(corpus):
    for name, text in CREATE.items():
        corpus.add("job_messages", "create-" + name, b"\0" + encode("CreateJobRequest", text))
    for name, text in REFINE.items():
        corpus.add("job_messages", "refine-" + name, b"\1" + encode("RefineJobRequest", text))
    corpus.add("job_messages", "name", b"\2jobs/7/frames/12")
    reports = [encode("SynchronizeRequest", REPORT % worker) for worker in "ab"]
    results = [encode("ResultHeader", header(32 * (i & 1), 16 * (i & 2), 16 * (i // 4)))
               for i in range(16)]
    corpus.add("worker_messages", "whole-job",
               sequence((0, reports[0]), (0, reports[1]), *((1, r) for r in results)))
    failing = encode("SynchronizeRequest", REPORT % "a" + "leases { lease_id: 2 phase: "
                     "PHASE_RENDERING } failures { lease_id: 1 kind: KIND_SCENE message: 'm' }")
    corpus.add("worker_messages", "failures",
               sequence((0, reports[0]), (0, failing), (255, b""), (0, reports[1]),
                        (1, results[0]), (1, results[0])))
    for name, text in REPLIES.items():
        corpus.add("worker_replies", name, encode("SynchronizeResponse", text))
    corpus.add("client_messages", "job", b"\0" + encode("Job", JOB))
    corpus.add("client_messages", "worker", b"\1" + encode("Worker", WORKER))
    corpus.add("client_messages", "prices", b"\2" + encode("PriceRefinementResponse", PRICES))
    files = "".join(f'files {{ name: "{name}" digest {{ sha256_hex: "{digest}" size_bytes: 5 }} }} '
                    for name, digest in (("a.pbrt", DIGEST_A), ("b/c.png", DIGEST_B)))
    corpus.add("manifest", "two-files", encode("SceneManifest", 'main_file: "a.pbrt" ' + files))


def add_texts(corpus):
    for name, text in REQUESTS.items():
        corpus.add("http_request", name, text)
    for name, text in STREAMS.items():
        corpus.add("http_stream", name, text)
    for name, text in LINES.items():
        corpus.add("command_line", name, text)
    for i, text in enumerate(ADDRESSES):
        corpus.add("address", str(i), text)
    for i, text in enumerate(OUTPUTS):
        corpus.add("outputs", str(i), text)
    corpus.add("client_files", "ocio", "\1" + OCIO)
    corpus.add("client_files", "scene", "\0" + TINY)
    corpus.add("client_files", "usd", "\0#usda 1.0\n")


def add_images(corpus):
    """Parts, an image and a chunk from a farm, and textures from our scenes."""
    with farm.Farm() as f:
        f.start_worker()
        scene = f.path("tiny.pbrt")
        with open(scene, "w", encoding="utf-8") as file:
            file.write(TINY)
        for name, options in (("plain", ()), ("outputs", ("--aov", "position,object-id"))):
            done = f.sheaf("submit", scene, "--samples", 16, "--tile-size", 8, *options, "--wait",
                           "-o", f.path(name + ".exr"), "--json")
            job = json.loads(done.stdout.splitlines()[0])["name"].rpartition("/")[2]
            parts = glob.glob(f.path("state", "parts", job, "**", "*"), recursive=True)
            part = next(path for path in sorted(parts) if os.path.isfile(path))
            corpus.add("part", name, farm.read_bytes(part))
            corpus.add("frame_image", name, farm.read_bytes(f.path(name + ".exr")))
            f.sheaf("bundle", job + ":1:0", "-o", f.path("a.tar"))
            corpus.add("bundle", name, farm.read_bytes(f.path("a.tar")))
        corpus.add("image", "exr", b"\0" + farm.read_bytes(f.path("plain.exr")))
        f.sheaf("render", scene, "--samples", 1, "-o", f.path("a.exr"), "--png", f.path("a.png"))
        corpus.add("image", "png", b"\1" + farm.read_bytes(f.path("a.png")))
    corpus.add("image", "hdr", b"\2#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n"
               b"\x80\x40\x20\x81\x10\x20\x30\x80")
    corpus.add("image", "pfm", b"\3PF\n2 1\n-1.0\n" + struct.pack("<6f", *range(6)))
    corpus.add("image", "tga", b"\6" + struct.pack("<BBBHHBHHHHBB", 0, 0, 2, 0, 0, 0, 0, 0, 2, 1,
                                                     24, 0) + bytes(range(6)))
    corpus.add("chunk", "stored", b"\x28\xb5\x2f\xfd\x20" + bytes([len(TINY)])
               + struct.pack("<I", len(TINY) << 3 | 1)[:3] + TINY.encode())


def add_gltf(corpus):
    with tempfile.TemporaryDirectory() as folder:
        for path, _ in make_models.write_models(folder):
            with open(path, "rb") as file:
                content = file.read()
            if len(content) <= GLTF_BYTES_MAX:
                corpus.add("gltf", os.path.basename(path), content)


def main():
    corpus = Corpus(sys.argv[1] if len(sys.argv) > 1 else os.path.join(HERE, "corpus"))
    add_scene_files(corpus)
    add_messages(corpus)
    add_texts(corpus)
    add_images(corpus)
    add_gltf(corpus)


if __name__ == "__main__":
    main()
