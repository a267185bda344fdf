# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Blender's light groups as groups of Sheaf, and lights of negative power: they shine in groups of
their own, which F12 subtracts from the image.
"""

GROUPS_MAX = 31  # Sheaf has 64 groups: two for each of Blender's, and two without a name there.
NEGATIVE = "negative"


def layer_name(index, is_negative=False):
    """The group's layers in Sheaf's image. index: in the view layer; -1 for lights without one."""
    parts = ([f"group{index + 1}"] if index >= 0 else []) + ([NEGATIVE] if is_negative else [])
    return "-".join(parts)


class LightGroups:
    """The groups of one frame's lights."""

    def __init__(self, view_layer, has_groups, can_subtract, report):
        names = [group.name for group in view_layer.lightgroups]
        if names and not has_groups:
            report.left_out(f'view layer "{view_layer.name}"', "Light Groups: their passes are "
                            "black beside those of Kinds of Light")
        if len(names) > GROUPS_MAX:
            report.left_out(f'view layer "{view_layer.name}"',
                            f"Light Groups beyond {GROUPS_MAX}: their passes are black")
        self._indices = {name: i for i, name in enumerate(names[:GROUPS_MAX])} if has_groups else {}
        self.can_subtract = can_subtract and has_groups
        self.has_negative = False

    def parameters(self, name, is_negative=False):
        """Parameters of a light in Blender's group of this name, or in none."""
        self.has_negative |= is_negative
        found = layer_name(self._indices.get(name, -1), is_negative)
        return {"string lightgroup": found} if found else {}


def group_of(instance, instance_object):
    """The name of an object's group, or of that which makes it."""
    own = getattr(instance_object, "lightgroup", "")
    if not own and instance.is_instance and instance.parent is not None:
        return getattr(instance.parent, "lightgroup", "")
    return own
