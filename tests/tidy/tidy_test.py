#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Project rules that a machine can check; CONTRIBUTING.md gives the reasons.

Run from anywhere: tests/tidy/tidy_test.py. Each check is one test; a failure lists every place.
"""
import graphlib
import io
import json
import os
import re
import subprocess
import tokenize
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SOURCE_FOLDERS = ("common", "worker", "coordinator", "cli", "tests")
LINE_LENGTH_MAX = 100
FILE_LINES_MAX = 450
FUNCTION_LINES_MAX = 80

# Those of CLI11; command_line.h has our own.
LIBRARY_VALIDATORS = re.compile(
    r"CLI::(Range|Bound|Is[A-Z]|As[A-Z]|Existing|Nonexistent|Positive|Non[A-Z]|Number|ValidIP|"
    r"TypeValidator|Transformer|Checked)")

# The folders of a module from the lowest to the highest: each may include those before it. "|"
# separates folders of one level, which do not include each other.
ROOMS = {
    "cli": ". < image | denoiser | usd < gltf < job/format | job/frames | job/identity < job "
           "| bundle < dropped | quote | view < study | profile < commands",
    "common/film": ". < denoise | display | light < error < exr",
    "common/scene": ". < spectrum < settings | formats | gltf/draco | gltf/surrounding "
                    "< pbrt/syntax < pbrt/statements < pbrt < gltf < reader",
    "coordinator/core": ". < job < frame | policy",
    "coordinator/service/farm": "state < jobs < delivery < intake | upkeep | queries < .",
    "coordinator/service/http": "image < server < api < .",
    "coordinator/store": "database < .",
    "worker/render": "traits < color < sampling < densities | light/choice < geometry "
                     "< accel | camera | bsdf | light < gather | guiding "
                     "< medium < material < plan < scene < integrator "
                     "< chains | eyes | mutations < . < ablation",
}

# A module may include the listed modules and itself, and no other of ours. common/* is below all.
LAYERS = {
    "common/base": (),
    "common/command_line": ("common/base",),
    "common/service_manager": ("common/base",),
    "common/tls": ("common/base",),
    "common/math": ("common/base",),
    "common/exr": (),
    "common/film": ("common/base", "common/exr", "common/math"),
    "common/image": ("common/base", "common/exr", "common/math", "common/process"),
    "common/process": ("common/base", "common/content"),
    "common/volume": ("common/base", "common/math", "common/process"),
    "common/scene": ("common/base", "common/math", "common/film", "common/volume"),
    "common/objects": ("common/base",),
    "common/content": ("common/base", "common/objects"),
    "common/rpc": ("common/base", "common/content", "common/film", "common/scene", "common/tls"),
    "worker/render": ("common/base", "common/math", "common/film", "common/image",
                      "common/scene", "common/volume"),
    "worker/agent": ("common/base", "common/film", "common/scene", "common/content",
                     "worker/render"),
    "worker/wire": ("common/", "worker/agent"),
    "worker/sandbox": ("common/", "worker/agent", "worker/wire", "worker/render"),
    "worker/yield": ("common/base",),
    "worker/service": ("common/", "worker/"),
    "coordinator/core": ("common/base", "common/math", "common/film", "common/scene",
                         "common/content"),
    "coordinator/scheduling": ("common/base", "common/film", "common/scene", "coordinator/core"),
    "coordinator/forecast": ("common/base", "common/math", "common/film", "common/scene",
                             "coordinator/core"),
    "coordinator/store": ("common/base", "common/film", "common/scene", "common/content",
                          "common/objects", "coordinator/core"),
    "coordinator/access": ("common/base", "common/tls", "coordinator/core", "coordinator/store"),
    "coordinator/service/view/json": ("common/base", "common/film", "common/scene",
                                      "coordinator/core", "coordinator/service/view"),
    "coordinator/service/view/messages": ("common/base", "common/content", "common/film",
                                          "common/rpc", "common/scene", "coordinator/core",
                                          "coordinator/service/view"),
    "coordinator/service/view": ("common/base", "common/film", "common/scene",
                                 "coordinator/core", "coordinator/forecast"),
    "coordinator/service/farm": ("common/", "coordinator/core", "coordinator/scheduling",
                                 "coordinator/forecast", "coordinator/store",
                                 "coordinator/service/view"),
    "coordinator/service/http": ("common/base", "common/film", "common/image", "common/scene",
                                 "common/tls", "coordinator/access", "coordinator/core",
                                 "coordinator/forecast",
                                 "coordinator/service/view"),
    "coordinator/service/grpc": ("common/", "coordinator/access", "coordinator/core",
                                 "coordinator/scheduling", "coordinator/forecast",
                                 "coordinator/service/view", "coordinator/service/farm"),
    "coordinator/service/dropped": ("common/base", "common/content", "common/process",
                                    "common/rpc", "coordinator/service/view"),
    "coordinator/service/server": ("common/", "coordinator/"),
    "cli": ("common/", "worker/", "coordinator/"),
}
FOLDER_SOURCES_MAX = 45
# A class is defined in its header and at most this many sources, all in the header's folder.
CLASS_SOURCES_MAX = 3
# Headers may be longer for a reason.
HEADER_LINES_MAX = 300
LONG_HEADERS = {
    "common/scene/scene_description.h": "the description of a scene, a list of plain structs",
    "coordinator/service/view/job_view.h": "each field of a view, twice: the member and its names",
    "coordinator/store/stored_rows.h": "each column of each table",
    "worker/render/bsdf/principled_at.h": "the lobes of one material, inlined into the integrator",
    "worker/render/integrator/surface_vertex.h": "a template over the configuration",
    "worker/render/integrator/two_ends.h": "a template over the configuration",
    "worker/render/medium/medium.h": "templates over color, inlined",
}

# Third-party headers and the files that may include them.
DOORS = {
    r"Imf\w+\.h|OpenEXR/|Imath":
        r"^common/(film/exr/exr_|image/(exr_reader|plain_image_test)\.cc$)",
    r"openssl/": r"^common/(base/(digest|secret)|tls/certificate)\.cc$",
    r"spdlog/": r"^common/base/log\.cc$",
    r"OpenImageIO/": r"^common/image/openimageio/",
    r"png\.h": r"^common/image/(png|png_reader|plain_image_test)\.cc$",
    r"jpeglib\.h": r"^common/image/(jpeg_reader|plain_image_test)\.cc$",
    r"OpenColorIO/": r"^cli/image/view_transform\.cc$",
    r"nanovdb/": r"^common/volume/nanovdb_door\.h$",
    r"common/volume/nanovdb_door\.h": r"^common/volume/",
    r"blosc\.h": r"^common/volume/",
    r"openvdb/|tbb/": r"^common/volume/openvdb/",
    r"zlib\.h": r"^common/(scene/formats|volume)/",
    r"zstd\.h": r"^common/content/",
    r"embree\d/": r"^worker/render/accel/embree_door\.h$",
    r"worker/render/accel/embree_(door|callbacks)\.h": r"^worker/render/accel/",
    r"archive(_entry)?\.h": r"^cli/dropped/zip_files\.cc$",
    r"curl/": r"^common/objects/http_client\.cc$",
    r"tiny_gltf\.h": r"^common/scene/gltf/tinygltf_door\.h$",
    r"common/scene/gltf/tinygltf_door\.h": r"^common/scene/gltf/",
    r"draco/(?!draco_mesh)": r"^common/scene/gltf/(draco/draco_mesh|compressed_gltf_test)\.cc$",
    r"meshoptimizer\.h": r"^common/scene/gltf/(meshopt_views|compressed_gltf_test)\.cc$",
    r"tinyxml2\.h": r"^common/objects/s3_xml\.cc$",
    r"seccomp\.h": r"^worker/sandbox/system_call_filter\.cc$",
    r"sqlite3\.h": r"^coordinator/store/database/sqlite_database\.cc$",
    r"libpq-fe\.h": r"^coordinator/store/database/postgres_connection\.cc$",
    r"boost/math/": r"^common/math/normal_distribution",
    r"boost/(?!math/)": r"^coordinator/service/http/",
    r"CLI/": r"^(cli/|common/command_line/)",
    r"nlohmann/": r"^(cli/|common/scene/gltf/(tinygltf|parsable_json)\.cc$|"
        r"coordinator/access/audit_log\.cc$|coordinator/service/(http|view/json)/)",
    r"grpcpp/|google/protobuf|sheaf/v1/":
        r"^(common/rpc/|worker/(sandbox|service|wire)/|"
        r"coordinator/service/(dropped|grpc|server|view/messages)/|cli/)",
}

# Where comments, messages and documents are plain English.
PLAIN_FOLDERS = tuple(f + "/" for f in (
    "coordinator", "proto", "dashboard/src", "python", "blender", "deploy", "docs", "cli",
    "common", "worker", "scenes", "tests", "cmake")) + (
    "CMakeLists.txt", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "README.md")
# Phrases that read as translated, and what to write instead.
PLAIN_ENGLISH = {
    r"\b[Nn]obody\b|\b[Ss]omebody\b": "name who acts: no worker, another user",
    r"\bshall\b": "must, or the present tense",
    r"\b(go|goes|going|went|gone) on\b(?! (a|an|the) )": "continue",
    r"\b(come|comes|came) to nothing\b": "gave no result",
    r"\b(this|earlier|last|next|other|another) (life|lives)\b": "run, since the start",
    r"\bso many\b": "this many, or the parameter's name",
    r"\b[Nn]othing happens\b": "a no-op if",
    r"\bwhatever (became|becomes)\b": "whatever their state",
    r"\bno more\b(?! than )": "no longer, no further",
    r"\bfor good\b": "permanently",
    r"\bdear(er)?\b": "expensive",
    r"\b(find|finds|found) out\b": "determine, detect",
    r"\b[Aa] person\b|\bpersons?\b": "user, operator",
    r"\bmade? good\b|\bmakes good\b": "repair",
    r"\bbreaks? off\b": "is truncated, is interrupted",
    r"\bThat of\b": "name the noun",
    r"(?:^|[.:;] )(Of (?!course)|What (?!to |do |you )|Who |Whose |Whom |Whoever )":
        "begin with the subject",
}
# Tokens of Python that hold prose; since 3.12 the text of an f-string is a token of its own.
PROSE_TOKENS = {tokenize.COMMENT, tokenize.STRING,
                getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}

LEFT_OVERS = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b|not (yet )?implemented|for now\b", re.I)


def tracked(*endings):
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT,
                            capture_output=True, text=True, check=True).stdout.splitlines()
    return [f for f in listed if f.endswith(endings) and os.path.exists(os.path.join(ROOT, f))]


def read(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as f:
        return f.read()


def cpp_files():
    return [f for f in tracked(".h", ".cc") if f.startswith(SOURCE_FOLDERS)]


def page_files():
    return [f for f in tracked(".ts", ".css") if f.startswith("dashboard/")]


def product_files():
    return [f for f in cpp_files() if not f.startswith("tests/") and "/tests/" not in f
            and not f.endswith("_test.cc")]


def function_lengths(text):
    """Yields (first line, number of lines) of the blocks that open at the end of a definition.

    A simple brace matcher, sufficient to find functions that no longer fit on a screen.
    """
    lines = text.split("\n")
    open_at, depth, base = None, 0, 0
    for number, line in enumerate(lines, 1):
        code = re.sub(r'"(\\.|[^"\\])*"|\'(\\.|[^\'\\])*\'|//.*', "", line)
        starts = re.search(r"\)\s*(const|noexcept|override|->.*)*\s*\{\s*$", code)
        if open_at is None and starts and not re.match(r"\s*(namespace|struct|class|enum)", code):
            open_at, base = number, depth
        depth += code.count("{") - code.count("}")
        if open_at is not None and depth <= base:
            yield open_at, number - open_at + 1
            open_at = None


def prose(path):
    """Yields (offset, text) of the comments and strings of a source, and of the lines of others.

    Adjacent comments, and the pieces of one string, are one text; in Python each line is one. A
    string of Python without a space is a name.
    """
    text = read(path)
    if path.endswith(".py"):
        starts = [0] + [line.end() for line in re.finditer("\n", text)]
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type in PROSE_TOKENS:
                start = starts[token.start[0] - 1] + token.start[1]
                for line in re.finditer(r"[^\n]+", token.string):
                    words = line.group().strip(" #*-/\"'`|")
                    if token.type == tokenize.COMMENT or " " in words:
                        yield start + line.start(), words
        return
    if not path.endswith((".h", ".cc", ".proto", ".ts")):
        for line in re.finditer(r"[^\n]+", text):
            yield line.start(), line.group().strip(" #*-/\"'`|")
        return
    start, whole, end = 0, "", 0
    for piece in re.finditer(r"//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'", text):
        words, is_comment = piece.group().strip("/\"'"), piece.group().startswith("//")
        between = text[end:piece.start()]
        if whole and between.isspace() and is_comment == text.startswith("//", start):
            whole += words if words.strip() else ". "
        else:
            yield start, whole.strip()
            start, whole = piece.start(), words
        end = piece.end()
    yield start, whole.strip()


class TidyTest(unittest.TestCase):
    def expect_none(self, problems, rule):
        self.assertFalse(problems, rule + ":\n  " + "\n  ".join(problems))

    def test_layers(self):
        problems = []
        for path in product_files():
            folder = next((f for f in LAYERS if path.startswith(f + "/")), None)
            self.assertIsNotNone(folder, path + " lies in no known layer")
            allowed = LAYERS[folder] + (folder,)
            for include in re.findall(r'#include "([^"]+)"', read(path)):
                if include.startswith(("common/", "worker/", "coordinator/", "cli/")):
                    if not include.startswith(allowed):
                        problems.append(f"{path} includes {include}")
                elif "/" in include and not include.startswith(("absl/", "sheaf/v1/")):
                    problems.append(f"{path} includes {include}: not from the repository's root")
        self.expect_none(problems, "a lower layer includes a higher one")

    def test_order_of_rooms(self):
        problems = []
        for module, order in ROOMS.items():
            level = {}
            for height, beside in enumerate(order.split(" < ")):
                for room in beside.split(" | "):
                    level[module if room == "." else f"{module}/{room}"] = height
            for path in (p for p in product_files() if p.startswith(module + "/")):
                room = os.path.dirname(path)
                self.assertIn(room, level, path + " lies in no known room")
                for include in re.findall(r'#include "([^"]+)"', read(path)):
                    other = os.path.dirname(include)
                    if other.startswith(module) and other != room:
                        if level.get(other, level[room]) >= level[room]:
                            problems.append(f"{path} includes {include}")
        self.expect_none(problems, "a lower room includes a higher one")

    def test_no_cycle_between_folders(self):
        below = {}
        product = set(product_files())
        for path in product:
            folder = os.path.dirname(path)
            for include in re.findall(r'#include "([^"]+)"', read(path)):
                if include in product and os.path.dirname(include) != folder:
                    below.setdefault(folder, set()).add(os.path.dirname(include))
        try:
            graphlib.TopologicalSorter(below).prepare()
        except graphlib.CycleError as error:
            self.fail("folders include each other: " + " > ".join(error.args[1]))

    def test_folders_are_small_and_described(self):
        problems = []
        sources = {}
        for path in product_files():
            sources.setdefault(os.path.dirname(path), []).append(path)
        for folder, files in sources.items():
            if len(files) > FOLDER_SOURCES_MAX:
                problems.append(f"{folder} holds {len(files)} sources")
        for module, order in ROOMS.items():
            for room in re.split(r" [<|] ", order):
                readme = os.path.normpath(os.path.join(module, room, "README.md"))
                if not os.path.exists(os.path.join(ROOT, readme)):
                    problems.append(readme + " is missing")
        self.expect_none(problems, "folders hold at most %d sources and say what they are for"
                         % FOLDER_SOURCES_MAX)

    def test_one_door_for_each_library(self):
        problems = []
        for path in product_files():
            for include in re.findall(r'#include [<"]([^>"]+)[>"]', read(path)):
                for library, door in DOORS.items():
                    if re.match(library, include) and not re.match(door, path):
                        problems.append(f"{path} includes {include}")
        self.expect_none(problems, "a third-party header outside its door")

    def test_refused_options_are_told_in_our_words(self):
        problems = [f"{p}:{n}: {line.strip()}" for p in cpp_files()
                    for n, line in enumerate(read(p).split("\n"), 1)
                    if LIBRARY_VALIDATORS.search(line)]
        self.expect_none(problems, "a validator of the argument library, whose messages do not say "
                                   "what to do; see common/command_line/command_line.h")

    def test_every_source_names_its_licence_and_purpose(self):
        problems = []
        for path in cpp_files() + tracked(".proto"):
            head = read(path).split("\n")[:6]
            if "SPDX-License-Identifier: Apache-2.0" not in "\n".join(head):
                problems.append(path + ": no SPDX line")
            if path.endswith(".h") and len(head) > 3 and not head[3].startswith("// "):
                problems.append(path + ": no paragraph that says what the file is for")
            if path.endswith(".h") and "#pragma once" not in read(path):
                problems.append(path + ": no #pragma once")
        for path in tracked(".cmake", "CMakeLists.txt", ".py", ".sh", ".ts", ".css"):
            if "SPDX-License-Identifier: Apache-2.0" not in read(path)[:400]:
                problems.append(path + ": no SPDX line")
        self.expect_none(problems, "file head")

    def test_lines_fit(self):
        problems = [f"{p}:{n}" for p in cpp_files() + page_files() + tracked(".proto", ".py")
                    for n, line in enumerate(read(p).split("\n"), 1) if len(line) > LINE_LENGTH_MAX]
        self.expect_none(problems, f"longer than {LINE_LENGTH_MAX} columns")

    def test_files_are_one_idea(self):
        problems = [f"{p}: {read(p).count(chr(10))} lines" for p in cpp_files() + page_files()
                    if read(p).count("\n") > FILE_LINES_MAX and not p.endswith("_data.cc")]
        self.expect_none(problems, f"longer than {FILE_LINES_MAX} lines")

    def test_headers_are_short_or_say_why_not(self):
        long = {p for p in product_files() if p.endswith(".h")
                and read(p).count("\n") > HEADER_LINES_MAX}
        self.expect_none(sorted(long - set(LONG_HEADERS)),
                         f"headers of more than {HEADER_LINES_MAX} lines; does one hold two ideas?")
        self.expect_none(sorted(set(LONG_HEADERS) - long), "headers that need no reason any longer")

    def test_classes_stand_in_few_sources_of_one_folder(self):
        sources = {}
        for path in (p for p in product_files() if p.endswith(".cc")):
            space = re.search(r"^namespace (sheaf[\w:]*) ", read(path), re.M)
            for name in re.findall(r"^(?![\s/#}])(?:[^\n;={()]*[ *&])?([A-Z]\w+)::~?\w+\(",
                                   read(path), re.M):
                sources.setdefault((space and space[1], name), set()).add(path)
        problems = [f"{name}: {', '.join(sorted(paths))}" for (_, name), paths in sources.items()
                    if len(paths) > CLASS_SOURCES_MAX
                    or len({os.path.dirname(path) for path in paths}) > 1]
        self.expect_none(problems, f"classes over more than {CLASS_SOURCES_MAX} sources, or over "
                                   "several folders; which functions need no member?")

    def test_functions_fit_a_screen(self):
        problems = [f"{p}:{at}: {n} lines" for p in product_files() + page_files()
                    if not p.endswith("_data.cc")
                    for at, n in function_lengths(read(p)) if n > FUNCTION_LINES_MAX]
        self.expect_none(problems, f"functions longer than {FUNCTION_LINES_MAX} lines")

    def test_nothing_is_left_over(self):
        own = os.path.relpath(os.path.abspath(__file__), ROOT)
        problems = [f"{p}:{n}: {line.strip()}"
                    for p in tracked(".h", ".cc", ".proto", ".py", ".sh", ".ts", ".md", ".cmake")
                    if p != own
                    for n, line in enumerate(read(p).split("\n"), 1) if LEFT_OVERS.search(line)]
        self.expect_none(problems, "left-over markers")

    def test_english_is_plain(self):
        own = os.path.relpath(os.path.abspath(__file__), ROOT)
        any_phrase = re.compile("|".join(PLAIN_ENGLISH))
        problems = []
        for path in tracked(".h", ".cc", ".proto", ".ts", ".py", ".md", ".yml", ".yaml", ".json",
                            ".conf", ".service", ".toml", ".sh", ".cmake", "CMakeLists.txt"):
            if not path.startswith(PLAIN_FOLDERS) or path == own:
                continue
            for offset, text in prose(path):
                if not any_phrase.search(text):
                    continue
                line = read(path).count("\n", 0, offset) + 1
                for phrase, instead in PLAIN_ENGLISH.items():
                    for found in re.finditer(phrase, text):
                        problems.append(f'{path}:{line}: "{found.group().strip()}": {instead}')
        self.expect_none(problems, "phrases that read as translated")

    def test_tables_have_a_head_and_equal_rows(self):
        # A blank line within a table ends it: the rest is a block without a head.
        problems = []
        for path in tracked(".md"):
            text = re.sub(r"^```.*?^```", lambda fence: "\n" * fence.group().count("\n"),
                          read(path), flags=re.M | re.S)
            for block in re.finditer(r"(?:^\|.*\n)+", text, re.M):
                rows = [re.sub(r"`+[^`]*`+|\\\|", "", row) for row in block.group().splitlines()]
                has_head = len(rows) > 1 and re.fullmatch(r"[|:\- ]+", rows[1])
                if not has_head or len({row.rstrip().count("|") for row in rows}) > 1:
                    problems.append(f"{path}:{text.count(chr(10), 0, block.start()) + 1}")
        self.expect_none(problems, "a table without a head, or with rows of unequal length")

    def test_every_proto_field_is_documented(self):
        problems = []
        for path in tracked(".proto"):
            previous = ""
            for number, line in enumerate(read(path).split("\n"), 1):
                code = line.strip()
                if re.match(r"(message|service|enum|rpc)\b|(repeated |optional )?[\w.]+ \w+ = \d+;|"
                            r"[A-Z_]+ = \d+;", code) and not previous.startswith("//"):
                    problems.append(f"{path}:{number}: {code}")
                previous = code
        self.expect_none(problems, "no comment")

    def test_every_source_is_built(self):
        lists = "\n".join(read(p) for p in tracked("CMakeLists.txt", ".cmake"))
        problems = [p for p in cpp_files() + page_files() if p.endswith((".cc", ".ts", ".css"))
                    and os.path.basename(p) not in lists and not p.startswith("tests/fuzz/")]
        self.expect_none(problems, "in no CMake list")


    def test_the_page_locks_versions_and_no_registry(self):
        lock = read("dashboard/package-lock.json")
        self.assertNotIn('"resolved"', lock, "the lock file names a registry")
        package = json.loads(read("dashboard/package.json"))
        versions = {**package["dependencies"], **package["devDependencies"]}
        loose = [f"{name} {version}" for name, version in versions.items()
                 if not re.fullmatch(r"\d+\.\d+\.\d+", version)]
        self.expect_none(loose, "not an exact version")


if __name__ == "__main__":
    unittest.main(verbosity=2)
