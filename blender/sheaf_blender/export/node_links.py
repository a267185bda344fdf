# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Follows links of node trees through groups, reroutes and muted nodes."""
import dataclasses

DEPTH_MAX = 200  # Reroutes, groups and muted nodes in a row; a longer chain counts as not linked.


@dataclasses.dataclass(frozen=True)
class Place:
    """A node within the groups that lead to it: their group nodes, outermost first."""
    node: object
    groups: tuple = ()


@dataclasses.dataclass(frozen=True)
class Input:
    """An input socket and the groups around it."""
    socket: object
    groups: tuple = ()


def input_of(place, *names):
    """The input of the first of these names or identifiers that the node has, or None."""
    for name in names:
        for socket in place.node.inputs:
            if name in (socket.identifier, socket.name) and socket.enabled:
                return Input(socket, place.groups)
    return None


def source(wanted):
    """(Place, output socket) that feeds the input, or the input itself if nothing does.

    Returns (place, output, None) or (None, None, input whose own value counts).
    """
    socket, groups = wanted.socket, wanted.groups
    for _ in range(DEPTH_MAX):
        links = [link for link in socket.links if not link.is_muted] if socket.is_linked else []
        if not links:
            return None, None, Input(socket, groups)
        output = links[0].from_socket
        node = output.node
        if node.mute:
            through = next((link for link in node.internal_links if link.to_socket == output), None)
            if through is None:
                return None, None, Input(socket, groups)
            socket = through.from_socket
        elif node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.type == "GROUP" and node.node_tree:
            inner = _group_output(node.node_tree)
            found = inner and next((s for s in inner.inputs if s.identifier == output.identifier),
                                   None)
            if found is None:
                return None, None, Input(socket, groups)
            socket, groups = found, groups + (node,)
        elif node.type == "GROUP_INPUT" and groups:
            outer = next((s for s in groups[-1].inputs if s.identifier == output.identifier), None)
            if outer is None:
                return None, None, Input(socket, groups)
            socket, groups = outer, groups[:-1]
        else:
            return Place(node, groups), output, None
    return None, None, Input(socket, groups)  # A circle of reroutes or muted nodes.


class Memory:
    """Reads each output once, however many inputs it feeds, and ends circles of links."""

    def __init__(self, report, item):
        self._report, self._item = report, item
        self._found = {}
        self._reading = set()

    def read(self, place, output, reader, circular):
        """The result of reader(), or that of an earlier call; circular within its own reading."""
        key = (place.node.as_pointer(), output.identifier,
               tuple(group.as_pointer() for group in place.groups))
        if key in self._found:
            return self._found[key]
        if key in self._reading:
            self._report.left_out(self._item, f'links in a circle through "{place.node.name}"')
            return circular
        self._reading.add(key)
        try:
            self._found[key] = reader()
        finally:
            self._reading.remove(key)
        return self._found[key]


def _group_output(tree):
    outputs = [node for node in tree.nodes if node.type == "GROUP_OUTPUT"]
    active = [node for node in outputs if node.is_active_output]
    return (active or outputs or [None])[0]


def output_node(tree, engines=("ALL", "CYCLES", "EEVEE")):
    """The active output of a material, world or light, as Cycles chooses it."""
    outputs = [node for node in tree.nodes
               if node.type in ("OUTPUT_MATERIAL", "OUTPUT_WORLD", "OUTPUT_LIGHT")]
    for target in (("CYCLES", "ALL"), engines):
        fitting = [node for node in outputs if getattr(node, "target", "ALL") in target]
        active = [node for node in fitting if node.is_active_output]
        if fitting:
            return (active or fitting)[0]
    return None
