# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Turns the --help text of one of Sheaf's programs into a manual page, in the macros of man(7)."""
import re

# Where common/command_line begins the second column.
COLUMN = 26


def escape(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text)


def entries(lines):
    """The (name, explanation) of the two columns of an options' or commands' section."""
    found = []
    for line in lines:
        name, text = line[2:COLUMN], line[COLUMN:]
        if line.startswith("  ") and line[2:3] not in ("", " "):
            # A name that reaches into the second column has its explanation on the next line.
            both = re.split(r"  +", line[2:], maxsplit=1)
            if len(both) == 1 or len(name.rstrip()) < len(name):
                name, text = (name, text) if len(both) > 1 else (line[2:], "")
            found.append([name.strip(), []])
        found[-1][1].append((text if line[2:3] not in ("", " ") else line).strip())
    return [(name, " ".join(filter(None, words))) for name, words in found]


def term(name):
    """An entry's name: options bold, values slanted."""
    words = []
    for word in name.split(" "):
        comma = "," if word.endswith(",") else ""
        font = "B" if word.startswith("-") or name.islower() and " " not in name else "I"
        words.append(f"\\f{font}{escape(word.rstrip(','))}\\fR{comma}")
    return " ".join(words)


def blocks(text):
    """The text as (heading, lines); the heading is empty for lines that have none."""
    heading, lines = "", []
    for line in text.split("\n"):
        if re.fullmatch(r"[A-Z][^.]*:", line):
            yield heading, lines
            heading, lines = line[:-1], []
        elif heading and line and not line.startswith(" "):
            yield heading, lines  # Back to plain text.
            heading, lines = "", [line]
        else:
            lines.append(line)
    yield heading, lines


def man_page(name, section, help_text, date, version, see_also):
    before, _, rest = help_text.partition("\nUsage: ")
    usage, _, rest = rest.partition("\n")
    description = " ".join(before.split())
    summary = re.split(r"[.:;] ", description)[0].rstrip(".")
    # As whatis(1) shows it: a phrase in small letters.
    summary = summary[0].lower() + summary[1:] if not summary[:2].isupper() else summary
    page = [f'.TH "{name.upper()}" "{section}" "{date}" "{version}" "Sheaf"',
            ".SH NAME", f"{escape(name)} \\- {escape(summary)}",
            ".SH SYNOPSIS"]
    words = usage.split(" ")
    page.append(" ".join(f"\\fB{escape(word)}\\fR" if word.islower() else f"\\fI{escape(word)}\\fR"
                         for word in words))
    page += [".SH DESCRIPTION", escape(description.rstrip(".") + ".")]
    in_options = False
    for heading, lines in blocks(rest):
        lines = [line for line in lines if line.strip()]
        if not lines:
            continue
        if not heading:
            page += [".PP", *map(escape, lines)]
        elif heading.startswith("Example"):
            page += [".SH EXAMPLES", ".nf", *(escape(line[2:]) for line in lines), ".fi"]
        else:
            top = {"Options": "OPTIONS", "Subcommands": "COMMANDS", "Arguments": "ARGUMENTS"}
            if heading in top:
                page.append(f".SH {top[heading]}")
                in_options = heading == "Options"
            else:
                page += [] if in_options else [".SH OPTIONS"]
                in_options = True
                page.append(f".SS {escape(heading)}")
            for entry, explanation in entries(lines):
                page += [".TP", term(entry), escape(explanation) or "\\&"]
    if see_also:
        linked = (re.fullmatch(r"(.*)(\(\d\))", other).groups() for other in sorted(see_also))
        page += [".SH SEE ALSO", ",\n".join(f"\\fB{escape(other)}\\fR{number}"
                                           for other, number in linked)]
    return "\n".join(page) + "\n"
