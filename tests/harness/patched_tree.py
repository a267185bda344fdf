# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""A copy of the working tree in which patches plant bugs one by one. It keeps its build, so that
only the first one takes minutes.
"""
import filecmp
import os
import shutil
import subprocess

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def tracked_files(folder):
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=folder, capture_output=True, check=True)
    return {os.fsdecode(name) for name in listed.stdout.split(b"\0") if name}


class PatchedTree:
    """patches: a folder of files NAME.patch. tree: where the copy is made."""

    def __init__(self, patches, tree):
        self.patches = patches
        self.tree = tree
        self.build_folder = os.path.join(tree, "build", "release")
        self.bin = os.path.join(self.build_folder, "bin")

    def names(self):
        return sorted(f[:-len(".patch")] for f in os.listdir(self.patches) if f.endswith(".patch"))

    def apply(self, name, *flags, tree=None):
        path = os.path.join(self.patches, name + ".patch")
        return subprocess.run(["git", "apply", *flags, path], cwd=tree or self.tree,
                              capture_output=True, text=True, check=False)

    def check(self):
        """Prints which patches do not apply to the working tree; returns the exit status."""
        failed = [(name, result.stderr) for name in self.names()
                  if (result := self.apply(name, "--check", tree=ROOT)).returncode != 0]
        for name, why in failed:
            print(f"{name}: does not apply: {why.strip()}")
        print(f"{len(self.names()) - len(failed)} of {len(self.names())} patches apply")
        return 1 if failed else 0

    def update(self):
        """Makes the copy equal to the tracked files as they are now; files that are equal keep
        their times, and so their objects."""
        if not os.path.isdir(os.path.join(self.tree, ".git")):
            os.makedirs(self.tree, exist_ok=True)
            # "git apply" looks for a repository.
            subprocess.run(["git", "init", "-q"], cwd=self.tree, check=True)
        wanted = {name for name in tracked_files(ROOT) if os.path.isfile(os.path.join(ROOT, name))}
        for name in wanted:
            source, copy = os.path.join(ROOT, name), os.path.join(self.tree, name)
            if os.path.isfile(copy) and filecmp.cmp(source, copy, shallow=False):
                continue
            os.makedirs(os.path.dirname(copy), exist_ok=True)
            shutil.copyfile(source, copy)
            shutil.copymode(source, copy)
        kept = {os.path.join(self.tree, ".git"), os.path.join(self.tree, "build")}
        for folder, folders, names in os.walk(self.tree):
            folders[:] = [f for f in folders if os.path.join(folder, f) not in kept]
            for name in names:
                path = os.path.join(folder, name)
                if os.path.relpath(path, self.tree) not in wanted:
                    os.remove(path)

    def configure(self, *arguments):
        subprocess.run(["cmake", "--preset", "release", "-DSHEAF_BUILD_TESTS=ON", *arguments],
                       cwd=self.tree, check=True, stdout=subprocess.DEVNULL)

    def build(self, targets, jobs):
        built = subprocess.run(["ninja", f"-j{jobs}", "-C", self.build_folder, *targets],
                               capture_output=True, text=True, check=False)
        if built.returncode != 0:
            raise SystemExit(f"{' '.join(targets)}: does not build:\n" + built.stdout[-4000:])
