# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Renders a scene on a farm of its own until an error is reached, and prints how it falls.

    python3 watch_error.py SCENE.pbrt [ERROR]
"""
import sys

import sheaf


def main(scene: str, target: str = "0.01") -> None:
    with sheaf.Farm() as farm:
        job = farm.client.submit(scene, target_error=float(target))
        shown = 0
        for job in farm.client.watch(job):
            rounds = job.frames[0].rounds
            for done in rounds[shown:]:
                print(f"{done.sample_count} samples, {done.cpu_seconds:.1f} s of CPU time: relMSE "
                      f"{done.relative_mse:.3g}, at most {done.relative_mse_upper:.3g}")
            shown = len(rounds)
        print(job.state.name.lower())


if __name__ == "__main__":
    main(*sys.argv[1:])
