# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Command blocks of documents: indented by four spaces after an empty line, outside of lists.

A block that no test runs says why, in a comment before it: <!-- not run: REASON -->
"""
import os
import re
import shlex

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAMS = ("sheaf", "sheaf-coordinator", "sheaf-worker", "sheaf-autoscaler")
MARK = re.compile(r"<!-- not run: (.+?) -->")


class Block:
    """The lines of one block, and why it is not run: "" if it is."""

    def __init__(self, lines, reason):
        self.lines, self.reason = lines, reason

    def text(self):
        return "\n".join(self.lines)


def read(path):
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        return file.read()


def blocks(path):
    """The blocks of a document, in its order."""
    found, lines, reason, in_list, after_empty = [], [], "", False, True
    for line in read(path).split("\n") + ["end"]:
        if line.startswith("    ") and (lines or (after_empty and not in_list)):
            lines.append(line[4:])
        elif line.strip() or not lines:
            if lines:
                found.append(Block("\n".join(lines).rstrip().split("\n"), reason))
                lines, reason = [], ""
            mark = MARK.fullmatch(line.strip())
            if mark:
                reason = mark[1]
            elif line.strip():
                reason = ""
                in_list = bool(re.match(r"([-*]|\d+\.) ", line)) or (in_list and line[0] == " ")
        else:
            lines.append("")
        after_empty = not line.strip()
    return found


def program_calls(block):
    """The calls of Sheaf's programs in a block, as lists of words; scripts are split at ; and |."""
    text = block.text().replace("\\\n", " ")
    calls = []
    for line in text.split("\n"):
        try:
            lexer = shlex.shlex(line, posix=True, punctuation_chars=";|&()<>")
            lexer.whitespace_split, lexer.commenters = True, "#"
            words = list(lexer)
        except ValueError:
            continue  # A quotation over several lines.
        call, before = None, ""
        for word in words:
            if re.fullmatch(r"[;|&()<>]+", word):
                call, word = None, ""
            elif call is None and word in PROGRAMS and (word != "sheaf" or before in ("", "--")):
                call = [word]  # "sheaf" alone is the name of other things too.
                calls.append(call)
            elif call is not None:
                call.append(word)
            before = word
    return calls
