# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Made-up prices and crops of a study. For study_fixture.py."""
import base64
import random
import struct
import zlib

CROP_WIDTH_PX, CROP_HEIGHT_PX = 128, 96
PRICE_SAMPLES = (16, 64, 256, 1024)
CPU_SECONDS_PER_SAMPLE = 0.075
THREAD_USE = 0.95


def png(noise, seed):
    """The bytes of a picture of a ramp with this noise."""
    source = random.Random(seed)
    rows = bytearray()
    for y in range(CROP_HEIGHT_PX):
        rows.append(0)  # No filter.
        for x in range(CROP_WIDTH_PX):
            level = 60 + 100 * x / CROP_WIDTH_PX + 60 * (y > CROP_HEIGHT_PX / 2)
            level = max(0, min(255, round(level * (1 + noise * source.gauss(0, 1)))))
            rows += bytes((level, level * 9 // 10, level * 7 // 10))
    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))
    header = struct.pack(">IIBBBBB", CROP_WIDTH_PX, CROP_HEIGHT_PX, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(bytes(rows))) + chunk(b"IEND", b""))


def crop(kind, x0, y0, error_of_one):
    errors = [error_of_one / n for n in PRICE_SAMPLES]
    images = [{"relative_mse": error,
               "png_base64": base64.b64encode(png(error**0.5, x0 + i)).decode()}
              for i, error in enumerate(errors)]
    return {"kind": kind, "x0": x0, "y0": y0, "x1": x0 + CROP_WIDTH_PX, "y1": y0 + CROP_HEIGHT_PX,
            "images": images}


def prices():
    """Members of a study: four prices, two crops and a farm of 8 workers."""
    return {"cpu_seconds_per_sample": CPU_SECONDS_PER_SAMPLE, "thread_use": THREAD_USE,
            "farm": {"address": "farm.example.org:7400", "worker_count": 8, "thread_count": 64,
                     "other_job_count": 1},
            "prices": [{"samples": n, "cpu_seconds": n * CPU_SECONDS_PER_SAMPLE,
                        "relative_mse": 0.48 / n, "relative_mse_error": 0.01 / n}
                       for n in PRICE_SAMPLES],
            "crops": [crop("largest error", 416, 352, 2.4), crop("representative", 64, 96, 0.5)]}
