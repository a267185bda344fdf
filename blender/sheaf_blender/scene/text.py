# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Writes directives of the pbrt-v4 format."""
import contextlib
import io
import math


def number(value):
    """The shortest text that gives the float32 again."""
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot stand in a scene; correct the value in Blender")
    return format(value, ".9g")


def quoted(text):
    """A string; line ends and control characters become spaces."""
    plain = "".join(c if c >= " " else " " for c in text)
    return '"' + plain.replace("\\", "\\\\").replace('"', '\\"') + '"'


def value_text(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return number(value)
    if isinstance(value, str):
        return quoted(value)
    return "[" + " ".join(map(value_text, value)) + "]"


def parameters_text(parameters):
    """parameters: {"rgb reflectance": (0.1, 0.2, 0.3), "float roughness": 0.1 ...}."""
    return "".join(f" {quoted(name)} {value_text(value)}" for name, value in parameters.items())


def matrix_text(matrix):
    """A matrix in Blender's rows, converted to the columns of the format."""
    return "[" + " ".join(number(matrix[row][column]) for column in range(4)
                          for row in range(4)) + "]"


class SceneText:
    """Directives in the order of their calls."""

    def __init__(self, file):
        self._file = file
        self._of_lights = {}
        self.has_ray_kinds = False  # Whether some kinds of rays do not see all.

    def directive(self, name, *arguments, **_):
        """Arguments: strings are quoted, dictionaries are parameters."""
        text = name
        if name in ("LightSource", "AreaLightSource") and self._of_lights:
            arguments = (*arguments, self._of_lights)
        self.has_ray_kinds |= any("string invisible" in argument for argument in arguments
                                  if isinstance(argument, dict))
        for argument in arguments:
            text += (parameters_text(argument) if isinstance(argument, dict)
                     else " " + quoted(argument))
        self.raw(text)

    def raw(self, text):
        """text: whole lines without the last line end."""
        self._file.write(text + "\n")

    def transform(self, name, matrix):
        self.raw(f"{name} {matrix_text(matrix)}")

    @contextlib.contextmanager
    def lights_with(self, parameters):
        """Adds parameters to all lights that are written meanwhile."""
        before, self._of_lights = self._of_lights, {**self._of_lights, **parameters}
        try:
            yield
        finally:
            self._of_lights = before

    @contextlib.contextmanager
    def whole(self):
        """Keeps the text that is written meanwhile if nothing is raised, and drops it otherwise."""
        file, self._file = self._file, io.StringIO()
        try:
            yield
            file.write(self._file.getvalue())
        finally:
            self._file = file
