#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The build id (cmake/BuildId.cmake) names the sources and the flags, and nothing else."""

import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = "common/math;common/volume"


def build_id(source_dir, header, build_with="gcc 12 -O2"):
    subprocess.run(
        ["cmake", f"-DSOURCE_DIR={source_dir}", f"-DFOLDERS={FOLDERS}", f"-DHEADER={header}",
         f"-DBUILD_WITH={build_with}", "-P", str(ROOT / "cmake/BuildId.cmake")], check=True)
    return re.search(r'SHEAF_BUILD_ID "([0-9a-f]{12})"', header.read_text()).group(1)


class BuildIdTest(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)
        self.header = self.folder / "id.h"
        self.copy = self.folder / "another place"
        for name in FOLDERS.split(";"):
            shutil.copytree(ROOT / name, self.copy / name)
        self.id = build_id(ROOT, self.header)

    def tearDown(self):
        self.temporary.cleanup()

    def id_of_copy(self):
        return build_id(self.copy, self.folder / "copy.h")

    def test_equal_sources_elsewhere_have_the_same_id(self):
        self.assertEqual(self.id_of_copy(), self.id)

    def test_another_source_has_another_id(self):
        source = next(self.copy.glob("common/math/*.h"))
        source.write_text(source.read_text() + "// changed\n")
        self.assertNotEqual(self.id_of_copy(), self.id)

    def test_a_renamed_source_has_another_id(self):
        source = next(self.copy.glob("common/math/*.h"))
        source.rename(source.with_name("renamed.h"))
        self.assertNotEqual(self.id_of_copy(), self.id)

    def test_tests_and_texts_do_not_count(self):
        (self.copy / "common/math/new_test.cc").write_text("int x;\n")
        (self.copy / "common/math/README.md").write_text("other\n")
        self.assertEqual(self.id_of_copy(), self.id)

    def test_other_flags_have_another_id(self):
        self.assertNotEqual(build_id(ROOT, self.folder / "flags.h", "gcc 12 -O3"), self.id)

    def test_an_equal_id_leaves_the_header_alone(self):
        os.utime(self.header, (1, 1))
        build_id(ROOT, self.header)
        self.assertEqual(self.header.stat().st_mtime, 1)


if __name__ == "__main__":
    unittest.main()
