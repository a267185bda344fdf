# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The package of python/, built as an installation does. Needs Debian's python3-grpcio."""
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import farm

PACKAGE = os.path.join(farm.ROOT, "python")


def build_package():
    """The folder for sys.path; it goes with the test module."""
    base = tempfile.mkdtemp(prefix="sheaf package ")
    unittest.addModuleCleanup(shutil.rmtree, base, ignore_errors=True)
    built = os.path.join(base, "lib")
    done = subprocess.run([sys.executable, "setup.py", "-q", "build", "--build-base", base,
                           "--build-lib", built], cwd=PACKAGE, capture_output=True, text=True,
                          check=False, timeout=60 * farm.PATIENCE)
    if done.returncode:
        raise AssertionError("the package cannot be built:\n" + done.stdout + done.stderr)
    return built
