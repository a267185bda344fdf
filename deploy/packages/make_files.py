#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Makes what the Debian packages hold besides programs: one tree for each package.

Manual pages and completions come from the programs themselves: --help, --completion and "sheaf
completion". Units, accounts, settings and texts are copied from the repository. The Python package
is built by its setup.py. Called by deploy/packages/CMakeLists.txt; prints nothing.
"""
import argparse
import gzip
import os
import re
import shutil
import subprocess
import sys
import time

from man_page import man_page

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
PACKAGES = ("sheaf", "sheaf-coordinator", "sheaf-worker", "sheaf-common", "python3-sheaf")
# The help must not name this user: options have defaults in the home directory.
HOME = "/home/user"


def read(*names):
    with open(os.path.join(ROOT, *names), encoding="utf-8") as file:
        return file.read()


class Maker:
    def __init__(self, options):
        self.options = options

    def path(self, package, *names):
        path = os.path.join(self.options.out, package, *names)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        return path

    def write(self, text, package, *names):
        with open(self.path(package, *names), "w", encoding="utf-8") as file:
            file.write(text)

    def write_gzip(self, text, package, *names):
        # Without a name and a time, so that equal texts give equal files.
        with open(self.path(package, *names), "wb") as file:
            with gzip.GzipFile("", "wb", 9, file, mtime=0) as packed:
                packed.write(text.encode())

    def output_of(self, *command):
        environment = {"PATH": "/usr/bin:/bin", "HOME": HOME, "LANG": "C.UTF-8"}
        done = subprocess.run([os.path.join(self.options.bin, command[0]), *command[1:]],
                              env=environment, capture_output=True, text=True, check=True,
                              timeout=60)
        return done.stdout.replace(HOME, "~")

    def make_man_pages(self, program, section, see_also):
        """The page of a program and of each of its commands; see_also: of other programs."""
        text = self.output_of(program, "--help")
        listed = text.partition("\nSubcommands:\n")[2].split("\n\n")[0]
        commands = re.findall(r"^  ([a-z]+)  ", listed, re.M)
        date = time.strftime("%Y-%m-%d", time.gmtime(self.options.date))
        version = f"Sheaf {self.options.version}"
        pages = {program: text}
        for command in commands:
            pages[f"{program}-{command}"] = self.output_of(program, command, "--help")
        for name, help_text in pages.items():
            others = [f"{other}({section})" for other in pages if other != name]
            if name != program:  # A command points to its program, which lists all others.
                others = [f"{program}({section})"]
            page = man_page(name, section, help_text, date, version, others + see_also)
            self.write_gzip(page, program, "usr/share/man", f"man{section}",
                            f"{name}.{section}.gz")

    def make_completions(self, program, *command):
        places = {"bash": f"usr/share/bash-completion/completions/{program}",
                  "zsh": f"usr/share/zsh/vendor-completions/_{program}",
                  "fish": f"usr/share/fish/vendor_completions.d/{program}.fish"}
        for shell, place in places.items():
            self.write(self.output_of(program, *command, shell), program, place)

    def make_service(self, package):
        """Units with the programs of the package, the account and the settings."""
        systemd = os.path.join(ROOT, "deploy", "systemd")
        for unit in sorted(os.listdir(systemd)):
            if re.fullmatch(re.escape(package) + r"@?\.service", unit):
                text = read("deploy", "systemd", unit).replace("/usr/local/bin/", "/usr/bin/")
                self.write(text, package, self.options.units, unit)
        self.write(read("deploy", "systemd", package + ".sysusers.conf"), package,
                   "usr/lib/sysusers.d", package + ".conf")
        settings = package.partition("-")[2] + ".conf"
        self.write(read("deploy", "packages", settings), package, "etc/sheaf", settings)

    def make_texts(self):
        page_licences = ""
        with open(self.options.page_licences, encoding="utf-8") as file:
            for line in file.read().rstrip().split("\n"):
                page_licences += " " + (line or ".") + "\n"
        date = time.strftime("%a, %d %b %Y %H:%M:%S +0000", time.gmtime(self.options.date))
        debian = (read("deploy", "packages", "changelog.in").replace("@VERSION@",
                  self.options.version).replace("@DATE@", date))
        copyright_text = read("deploy", "packages", "copyright.in")
        for package in PACKAGES:
            folder = ("usr/share/doc", package)
            text = copyright_text.replace("@PAGE_LICENCES@", page_licences.rstrip("\n"))
            self.write(text, package, *folder, "copyright")
            self.write_gzip(debian, package, *folder, "changelog.Debian.gz")
            self.write_gzip(read("CHANGELOG.md"), package, *folder, "changelog.gz")
            overrides = os.path.join(HERE, "lintian", package)
            if os.path.exists(overrides):
                self.write(read("deploy", "packages", "lintian", package), package,
                           "usr/share/lintian/overrides", package)

    def make_documents(self):
        """Documents and example scenes."""
        listed = subprocess.run(
            ["git", "-c", "safe.directory=*", "ls-files", "README.md", "docs/*.md", "docs/*.png",
             "docs/techniques/*", "scenes"], cwd=ROOT,
            capture_output=True, text=True, check=True).stdout.split("\n")
        for name in filter(None, listed):
            if name.startswith("docs/adr/") or name.endswith(".py"):
                continue
            place = ("usr/share/doc/sheaf-common/examples/" + name if name.startswith("scenes/")
                     else "usr/share/doc/sheaf-common/" + name)
            shutil.copyfile(os.path.join(ROOT, name), self.path("sheaf-common", place))
        self.write(read("deploy", "monitoring", "sheaf.rules.yml"), "sheaf-coordinator",
                   "usr/share/doc/sheaf-coordinator/examples/sheaf.rules.yml")
        self.write(read("deploy", "monitoring", "sheaf.dashboard.json"), "sheaf-coordinator",
                   "usr/share/doc/sheaf-coordinator/examples/sheaf.dashboard.json")

    def make_python_package(self):
        work = os.path.join(self.options.out, "work")
        shutil.rmtree(work, ignore_errors=True)
        source = os.path.join(work, "python")
        # setup.py writes beside itself, and finds the version and the messages above itself.
        shutil.copytree(os.path.join(ROOT, "python"), source,
                        ignore=shutil.ignore_patterns("build", "*.egg-info", "v1", "__pycache__"))
        for name in ("CMakeLists.txt", "proto"):
            os.symlink(os.path.join(ROOT, name), os.path.join(work, name))
        place = self.path("python3-sheaf", "usr/lib/python3/dist-packages/sheaf")
        subprocess.run([sys.executable, "setup.py", "-q", "build", "--build-lib",
                        os.path.dirname(place), "egg_info", "--egg-base", os.path.dirname(place)],
                       cwd=source, check=True, capture_output=True, timeout=300)
        for name in ("SOURCES.txt", "dependency_links.txt"):
            os.remove(os.path.join(os.path.dirname(place), "sheaf.egg-info", name))
        examples = os.path.join(ROOT, "python", "examples")
        for name in sorted(os.listdir(examples)):
            if name.endswith(".py"):
                self.write(read("python", "examples", name), "python3-sheaf",
                           "usr/share/doc/python3-sheaf/examples", name)
        self.write(read("python", "README.md"), "python3-sheaf",
                   "usr/share/doc/python3-sheaf/README.md")
        shutil.rmtree(work)

    def make_all(self):
        shutil.rmtree(self.options.out, ignore_errors=True)
        self.make_man_pages("sheaf", 1, ["sheaf-worker(8)", "sheaf-coordinator(8)"])
        self.make_man_pages("sheaf-worker", 8, ["sheaf(1)", "sheaf-coordinator(8)"])
        self.make_man_pages("sheaf-coordinator", 8, ["sheaf(1)", "sheaf-worker(8)"])
        self.make_completions("sheaf", "completion")
        self.make_completions("sheaf-worker", "--completion")
        self.make_completions("sheaf-coordinator", "--completion")
        self.make_service("sheaf-coordinator")
        self.make_service("sheaf-worker")
        self.make_texts()
        self.make_documents()
        self.make_python_package()
        for folder, _, names in os.walk(self.options.out):
            os.chmod(folder, 0o755)
            for name in names:
                os.chmod(os.path.join(folder, name), 0o644)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--bin", required=True, help="folder of the programs")
    parser.add_argument("--page-licences", required=True, help="licences of the page's packages")
    parser.add_argument("--version", required=True, help="of the packages, e.g. 0.1.0-1~deb12u1")
    parser.add_argument("--date", required=True, type=int, help="of the changelog, as Unix time")
    parser.add_argument("--units", required=True, help="folder of units, without its first slash")
    parser.add_argument("--out", required=True, help="folder to write, which is emptied")
    options = parser.parse_args()
    options.out = os.path.abspath(options.out)
    Maker(options).make_all()


if __name__ == "__main__":
    main()
