#!/usr/bin/env python3
# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""How long /healthz and /metrics take while a coordinator encodes previews that are in no cache: 24
of an image of 2048 x 2048 at once, by default.

Prints one line of JSON. The target is .2 s at most for /healthz.

    tests/bench/probe_seconds.py [EDGE_PX] [PREVIEWS]
"""
import json
import os
import sys
import threading
import time
from urllib.request import urlopen

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "integration"))
import farm  # noqa: E402
from client_case import SCENE  # noqa: E402

CHOICES = ["layer=image", "layer=image&size=full", "layer=light", "layer=error", "layer=samples",
           "layer=time"]
PAUSE_SECONDS = 0.02


def fetch(f, path):
    """Seconds that the answer takes, and its size."""
    begin = time.monotonic()
    with urlopen(f"http://{f.http}{path}", timeout=60 * farm.PATIENCE) as answer:
        size = len(answer.read())
    return time.monotonic() - begin, size


def main():
    edge = int(sys.argv[1]) if len(sys.argv) > 1 else 2048
    previews = int(sys.argv[2]) if len(sys.argv) > 2 else 24
    with farm.Farm() as f:
        with open(f.path("scene.pbrt"), "w", encoding="utf-8") as file:
            file.write(SCENE.replace("48", str(edge)).replace("32", str(edge)))
        worker = f.start_worker(threads=2)
        f.sheaf("submit", f.path("scene.pbrt"), "--samples", 1, "--tile-size", 512,
                "--wait", "-o", f.path("o.exr"))
        worker.terminate()
        worker.wait()
        route = "/api/v1/jobs/1/frames/1/preview.png"
        alone = max(fetch(f, "/healthz")[0] for _ in range(20))
        took, ended = [], threading.Event()

        def encode(number):
            took.append(fetch(f, f"{route}?{CHOICES[number % len(CHOICES)]}")[0])

        probes = {path: [] for path in ("/healthz", "/metrics")}

        def probe(path):
            while not ended.is_set():
                probes[path].append(fetch(f, path)[0])
                time.sleep(PAUSE_SECONDS)

        encoders = [threading.Thread(target=encode, args=(n,)) for n in range(previews)]
        probers = [threading.Thread(target=probe, args=(path,)) for path in probes]
        for thread in encoders + probers:
            thread.start()
        for thread in encoders:
            thread.join()
        ended.set()
        for thread in probers:
            thread.join()
    print(json.dumps({"edge_px": edge, "previews": len(took),
                      "previews_seconds_max": round(max(took), 3),
                      "healthz_seconds_alone_max": round(alone, 4),
                      "healthz_seconds_max": round(max(probes["/healthz"]), 4),
                      "metrics_seconds_max": round(max(probes["/metrics"]), 4),
                      "probes": len(probes["/healthz"])}))


if __name__ == "__main__":
    main()
