# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""sheaf study as people run it: one command on a scene of this repository, its page in real
headless Chromium, and its results compared with known properties of the scene.

Screenshots are kept in SHEAF_ARTEFACTS. Ends with "N passed, N failed".
"""
import base64
import json
import math
import os
import re
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path += [HERE, os.path.join(HERE, "..", "integration")]
from browser import Browser  # noqa: E402
from farm import ALL_TESTS, PATIENCE, ROOT, TIME_SCALE, programs  # noqa: E402
from page_test import artefact, run_checks  # noqa: E402
from study_checks import check_study_page  # noqa: E402

# The short form has no time for statistics: it has a study made, and checks what is true of any.
MINUTES = 0.6 if ALL_TESTS else 0.3
# For a frame with light paths, whose settings cost twice as much.
LIGHT_MINUTES = 1.2 * TIME_SCALE
# Longer for a guided frame: each of its settings is trained.
GUIDED_MINUTES = 0.6 * TIME_SCALE
# On any machine; compiling scenes and the last block add to the requested time.
SECONDS_MAX = 60 * MINUTES * PATIENCE
# Exit code of `sheaf study` where the minutes are too few for the scene, and how often the test
# gives it those that it asks for.
REFUSED = 4
TRIALS_MAX = 4
ENTRIES_MIN = 5


# A bulb in a globe of frosted glass, as in scenes/frosted.pbrt, before bare walls. No path from
# the camera can sample the bulb.
LAMP = """
Film "rgb" "integer xresolution" 64 "integer yresolution" 48
Integrator "path" "integer maxdepth" 5
LookAt -0.7 2.7 -7.6   0.2 0.98 0   0 1 0
Camera "perspective" "float fov" 32
WorldBegin
Material "diffuse" "rgb reflectance" [0.5 0.5 0.5]
Shape "bilinearmesh" "point3 P" [-6 0 -9   6 0 -9   -6 0 1.8   6 0 1.8]
Shape "bilinearmesh" "point3 P" [-6 0 1.8   6 0 1.8   -6 9 1.8   6 9 1.8]
Translate 0.1 1.2 -0.35
Material "dielectric" "float eta" 1.5 "float roughness" 0.5
Shape "sphere" "float radius" 0.85
AttributeBegin
  ReverseOrientation
  Shape "sphere" "float radius" 0.8
AttributeEnd
AreaLightSource "diffuse" "rgb L" [340 238 133]
Shape "sphere" "float radius" 0.08
"""


def write_lamp():
    path = artefact("lamp.pbrt")
    with open(path, "w", encoding="utf-8") as file:
        file.write(LAMP)
    return path


class Study:
    """A study of a scene: its page, its JSON and its output."""

    def __init__(self, name, scene, minutes, *flags):
        self.page = artefact(f"{name}.html")
        data = artefact(f"{name}.json")
        for _ in range(TRIALS_MAX):
            done = subprocess.run(
                [os.path.join(programs(), "sheaf"), "study", scene, *flags,
                 "--minutes", str(minutes), "-o", self.page, "--json-output", data],
                capture_output=True, text=True, timeout=PATIENCE * 60 * minutes, check=False)
            asked = re.search(r"are too few for .*; give --minutes (\d+)", done.stderr)
            if done.returncode != REFUSED or asked is None:
                break
            # Other programs on the machine take the processor: the study says what it needs.
            minutes = int(asked[1])
        assert done.returncode == 0, (done.returncode, done.stderr)
        self.words = done.stdout
        with open(data, encoding="utf-8") as file:
            self.data = json.load(file)
        self.entries = {entry["name"]: entry for entry in self.data["entries"]}


def check_page(browser, study):
    counts = check_study_page(browser, study.page, ENTRIES_MIN,
                              lambda name: browser.screenshot(artefact(f"study-{name}.png")))
    for chart in ("prices-cards", "chart-error", "chart-gain", "chart-bias", "chart-rate",
                  "chart-effects", "chart-paths"):
        assert counts[chart] > 0, counts


def check_words_are_those_of_the_page(_, study):
    assert study.words.splitlines() == study.data["recommendation"]


def check_options_of_images_are_refused(_, __):
    done = subprocess.run(
        [os.path.join(programs(), "sheaf"), "study",
         os.path.join(ROOT, "scenes/cornell-box.pbrt"), "--samples", "16"],
        capture_output=True, text=True, timeout=SECONDS_MAX, check=False)
    assert done.returncode == 2 and "give --minutes instead" in done.stderr, done


def check_errors_fall(_, study):
    base = study.entries["as given"]
    assert base["is_base"] and 0.7 < base["rate"] < 1.6, base
    errors = [point["relative_mse"] for point in base["points"]]
    assert errors == sorted(errors, reverse=True), errors
    assert study.data["reference"]["relative_mse"] < errors[-1]


def check_no_bias_where_there_is_none(_, study):
    for entry in study.data["entries"]:
        floor = entry["bias_floor"]
        if entry["is_unbiased"] and floor:
            assert abs(floor["relative_mse"]) < 5 * floor["error"], entry


def check_bias_is_found(_, study):
    """Without indirect light this room is dark: the bias is many times the remaining noise."""
    floor = study.entries["depth 1"]["bias_floor"]
    assert floor["is_significant"] and floor["relative_mse"] > 0.05, floor


def check_generic_variant_costs_no_bits(_, study):
    """The same samples give the same errors."""
    base, generic = study.entries["as given"], study.entries["generic variant"]
    for a, b in zip(base["points"], generic["points"]):
        assert a["relative_mse"] == b["relative_mse"]


def check_generic_variant_costs_time_alone(_, study):
    """The same errors, and a gain of less than 1."""
    check_generic_variant_costs_no_bits(_, study)
    gain = study.entries["generic variant"]["gain"]
    assert gain["value"] < 1, gain


def check_crops_are_rendered(_, study):
    """Two regions at four prices; more samples cost more and have less error."""
    prices, crops = study.data["prices"], study.data["crops"]
    assert [crop["kind"] for crop in crops] == ["largest error", "representative"], crops
    assert len(prices) == 4, prices
    for crop in crops:
        errors = [image["relative_mse"] for image in crop["images"]]
        assert errors == sorted(errors, reverse=True) and len(errors) == len(prices), errors
        for image in crop["images"]:
            assert base64.b64decode(image["png_base64"]).startswith(b"\x89PNG")
    costs = [price["cpu_seconds"] for price in prices]
    assert costs == sorted(costs) and costs[0] > 0, costs
    errors = [price["relative_mse"] for price in prices]
    assert errors == sorted(errors, reverse=True), errors
    assert study.data["farm"] is None


def check_first_advice_keeps_error_bars(_, study):
    advice = [line for line in study.data["recommendation"] if line.startswith("Use ")]
    assert all("one sequence" not in line for line in advice), advice


def check_front_is_of_one_image(_, study):
    for entry in study.data["entries"]:
        if not entry["is_unbiased"]:
            assert not any(point["on_pareto_front"] for point in entry["points"]), entry["name"]


def check_shares_add_up(_, study):
    for share in ("light_fraction", "noise_fraction"):
        total = math.fsum(path[share] for path in study.data["paths"])
        assert abs(total - 1) < 1e-6, total


def check_light_paths_are_compared(browser, _):
    """A lamp that paths from the camera find by chance alone."""
    study = Study("study-light", write_lamp(), LIGHT_MINUTES, "--techniques", "camera+light")
    check_study_page(browser, study.page, 2,
                     lambda name: browser.screenshot(artefact(f"study-light-{name}.png")))
    base, without = study.entries["as given"], study.entries["no light paths"]
    assert without["flag"] == "--techniques camera", without
    assert base["is_base"] and base["points"], base
    # A sample costs more with light paths, and far less is needed.
    cost, alone = (e["points"][0]["cpu_seconds"] / e["points"][0]["samples"]
                   for e in (base, without))
    assert cost > 1.5 * alone, (cost, alone)
    assert any(line.startswith("Light paths pay here: without them (--techniques camera)")
               for line in study.data["recommendation"]), study.data["recommendation"]
    light = study.data["light"]
    assert light["shrink"] >= 1 and light["width_px"] * light["shrink"] > 50, light
    assert light["reference_passes"] >= 16 and study.data["training_cpu_seconds"] == 0, light
    assert 0 < light["cpu_seconds_per_pass"] < study.data["cpu_seconds_per_sample"], light
    most = study.data["prices"][-1]["samples"]
    assert most <= light["reference_passes"], (most, light)
    assert abs(math.fsum(path["light_fraction"] for path in study.data["paths"]) - 1) < 1e-6
    # Without indirect light, the lamp lights nothing.
    assert study.entries["depth 1"]["bias_floor"]["relative_mse"] > 0.2, study.entries["depth 1"]


def check_training_is_in_every_price(_, __):
    """A training comes before the first sample, so that it is in each price and each point."""
    study = Study("study-guided", write_lamp(), GUIDED_MINUTES, "--techniques", "camera+guiding")
    training, per_sample = study.data["training_cpu_seconds"], study.data["cpu_seconds_per_sample"]
    assert training > 0 and "light" not in study.data, training
    prices, points = study.data["prices"], study.entries["as given"]["points"]
    assert prices and points, study.data
    for price in prices:
        expected = training + price["samples"] * per_sample
        assert abs(price["cpu_seconds"] / expected - 1) < 1e-6, (price, expected)
    assert all(point["cpu_seconds"] > training for point in points), (training, points)


def check_light_paths_are_chosen_by_measurement(_, __):
    done = subprocess.run(
        [os.path.join(programs(), "sheaf"), "study", write_lamp(), "--techniques", "auto",
         "--minutes", "0.2"],
        capture_output=True, text=True, timeout=SECONDS_MAX, check=False)
    assert "techniques: camera+light" in done.stderr, done
    # A busy machine may have too little time for more.
    assert "Light paths" in done.stdout or "minutes are too few" in done.stderr, done


def main():
    checks = [check_page, check_words_are_those_of_the_page, check_errors_fall,
              check_no_bias_where_there_is_none, check_bias_is_found,
              check_generic_variant_costs_time_alone, check_shares_add_up,
              check_crops_are_rendered, check_first_advice_keeps_error_bars,
              check_front_is_of_one_image,
              check_options_of_images_are_refused, check_light_paths_are_compared,
              check_light_paths_are_chosen_by_measurement, check_training_is_in_every_price]
    if not ALL_TESTS:
        checks = [check_words_are_those_of_the_page, check_generic_variant_costs_no_bits,
                  check_shares_add_up, check_front_is_of_one_image,
                  check_options_of_images_are_refused]
    study = Study("study", os.path.join(ROOT, "scenes/cornell-box.pbrt"), MINUTES)
    with Browser() as browser:
        passed, failed = run_checks(checks, browser, study)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
