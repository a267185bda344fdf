# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Made-up studies in the JSON format of `sheaf study`. For study_page_test.py."""

from study_crops_fixture import prices

REFERENCE_ERROR = 1.2e-5
# Curves that the chart of errors shows at once.
SHOWN_MAX = 5
SAMPLES = (4, 16, 64, 256, 1024)
# Name, how, seconds per sample, error of one sample, bias floor, rate.
ENTRIES = [
    ("as given", "depth 8, RGB, 16 sequences", 0.075, 0.48, 0, 1.02),
    ("depth 4", "depth 4 for 8", 0.048, 0.44, 2.1e-3, 1.0),
    ("no caustics", "caustics left out", 0.07, 0.21, 6e-3, 1.01),
    ("spectral", "8 wavelengths a path for RGB", 0.11, 0.5, 0, 1.03),
    ("guided & <b>bold</b> </script>", "a name that is to be shown as it is", 0.14, 0.2, 0, 1.1),
    ("one sequence", "errors without true bars", 0.075, 0.3, 0, 1.05),
    ("light tree of clusters, all lamps", "chosen by an estimate of what they bring", 0.09, 0.3, 0,
     0.97),
]
PATHS = [
    ("direct", "light that comes from a lamp to what is seen", 0.61, 0.12, 0.09),
    ("indirect", "light that surfaces throw on others", 0.27, 0.15, 0.13),
    ("caustic", "light that specular surfaces throw on others", 0.1, 0.7, 0.94),
    ("volume", "light that a medium scatters", 0.02, 0.03, 0.2),
]
TILE_PX = 16


def entry(name, how, seconds, error, floor, rate):
    points = [{"samples": n, "cpu_seconds": seconds * n, "relative_mse": error / n**rate + floor,
               "relative_mse_error": 0.03 * (error / n**rate + floor), "on_pareto_front": False}
              for n in SAMPLES]
    return {"name": name, "how": how, "flag": "--max-depth 4" if name == "depth 4" else "",
            "is_base": name == "as given", "is_unbiased": floor == 0, "keeps_error_bars": True,
            "points": points,
            "rate": rate, "rate_error": 0.04,
            "bias_floor": {"relative_mse": floor or 1e-6, "error": (0.05 * floor) or 2e-6,
                           "is_significant": floor > 0},
            "gain": {"value": 0.036 / (seconds * error), "error": 0.08}}


def mark_front(entries):
    points = [point for e in entries if e["is_unbiased"] for point in e["points"]]
    for point in points:
        point["on_pareto_front"] = not any(
            other["cpu_seconds"] <= point["cpu_seconds"]
            and other["relative_mse"] <= point["relative_mse"]
            and (other["cpu_seconds"], other["relative_mse"])
            != (point["cpu_seconds"], point["relative_mse"]) for other in points)


def whole_study():
    """A study with content for every part of the page, some of it unusual."""
    entries = [entry(*values) for values in ENTRIES]
    mark_front(entries)
    entries[-1]["points"][-1]["samples"] = 1020.4
    entries[2]["gain"]["error"] = 1e-9
    del entries[0]["gain"]
    entries[-1].update(rate=None, rate_error=None, bias_floor=None, gain=None)
    effects = [
        {"name": "lens", "ablation": "a pinhole", "time_fraction": 0.1, "time_ratio": 1.11,
         "time_ratio_error": 0.01, "variance_ratio": 1.3, "mean_change": -0.01,
         "mean_change_error": 0.001, "relative_mse": 0.01, "problem": None},
        {"name": "indirect light", "ablation": "the first scattering alone", "time_fraction": 0.55,
         "time_ratio": 2.22, "time_ratio_error": 0.03, "variance_ratio": 2.6, "mean_change": -0.31,
         "mean_change_error": 0.002, "relative_mse": 0.14, "problem": None},
        {"name": "bump maps", "ablation": "smooth surfaces", "time_fraction": -0.01,
         "time_ratio": 0.99, "time_ratio_error": 0.02, "variance_ratio": 0.97,
         "mean_change": 0.0004, "mean_change_error": 0.001, "relative_mse": -1e-6, "problem": None},
        {"name": "motion", "problem": "no time was left"}]
    paths = [{"name": name, "meaning": meaning, "light_fraction": light, "noise_fraction": noise,
              "largest_replicate_fraction": rare} for name, meaning, light, noise, rare in PATHS]
    tiles = [{"x0": x, "y0": y, "x1": x + TILE_PX, "y1": y + TILE_PX,
              "path": "volume" if x < 200 else "caustic", "fraction": 0.5 + 0.49 * (x % 7) / 7}
             for y in range(320, 480, TILE_PX) for x in range(96, 640, 2 * TILE_PX)]
    return {"format": 2, **prices(), "assessed_tile_count": 200,
            "scene": "scenes/glass-and-water.pbrt", "width_px": 800, "height_px": 600,
            "pixels": 51200, "seconds": 612.0, "threads": 2,
            "reference": {"samples": 4096, "relative_mse": REFERENCE_ERROR, "cpu_seconds": 200.0},
            "entries": entries, "effects": effects, "paths": paths, "unreliable_tiles": tiles,
            "recommendation": [
                "As given, 1024 samples per pixel have an error of ±2.0 % (relMSE 0.00041).",
                "“depth 4” is biased and renders another image: never below ±4.6 %.",
                "Caustics make 70 % of the noise and 10 % of the light."],
            "not_studied": ["guiding: Sheaf has none"]}


def light_study():
    """A study of a guided frame with light paths."""
    study = whole_study()
    study["light"] = {"shrink": 3, "width_px": 267, "height_px": 200, "paths_shrink": 5,
                      "reference_passes": 48, "cpu_seconds_per_pass": 0.03}
    study["training_cpu_seconds"] = 57.0
    return study


def empty_study():
    """A study without any results."""
    return {"format": 2, "scene": "scenes/empty.pbrt", "width_px": 64, "height_px": 48,
            "pixels": None, "seconds": 0.2, "threads": 1, "reference": None, "entries": [],
            "effects": [], "paths": [], "unreliable_tiles": [], "recommendation": [],
            "not_studied": []}


def bare_study():
    """A study of one entry with one point, in which everything optional is unknown."""
    study = empty_study()
    study["entries"] = [{
        "name": "as given", "how": "", "is_base": True, "is_unbiased": True,
        "points": [{"samples": 1, "cpu_seconds": 0.002, "relative_mse": 0.5,
                    "relative_mse_error": None, "on_pareto_front": True},
                   {"samples": 4, "cpu_seconds": None, "relative_mse": None,
                    "relative_mse_error": None, "on_pareto_front": False}],
        "rate": None, "rate_error": None,
        "bias_floor": {"relative_mse": -1e-4, "error": 0.01, "is_significant": False},
        "gain": {"value": 1, "error": None}}]
    return study
