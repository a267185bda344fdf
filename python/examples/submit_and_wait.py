# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Submits a scene to the farm at SHEAF_COORDINATOR, waits and writes the image.

    python3 submit_and_wait.py SCENE.pbrt IMAGE.exr
"""
import sys

import sheaf


def main(scene: str, output: str) -> None:
    with sheaf.connect() as client:
        job = client.submit(scene, samples=64)
        job = client.wait(job, on_change=lambda now: print(f"{now.name}: "
                                                           f"{now.progress.fraction:.0%}"))
        client.download(job, output)
        image = client.image(job)
        height, width, _ = image.rgb.shape
        print(f"{output}: {width} x {height}, relMSE {image.relative_mse}, mean {image.rgb.mean()}")


if __name__ == "__main__":
    main(*sys.argv[1:])
