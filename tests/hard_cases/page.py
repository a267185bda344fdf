# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""The page of the hard cases: one HTML file that loads nothing else, for light and dark themes."""
import html
import math
import re

STYLE = """
:root { color-scheme: light dark; --page: #fff; --text: #1b1d21; --soft: #5d636d; --line: #d9dce1;
  --head: #f3f4f6; --good: #11693a; --bad: #b3261e; --bad-page: #fdecea; }
@media (prefers-color-scheme: dark) {
  :root { --page: #16181c; --text: #e6e8eb; --soft: #a2a8b2; --line: #353a42; --head: #1f2329;
    --good: #6fd39a; --bad: #ff9a91; --bad-page: #3a1d1b; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 84rem; padding: 1.5rem; background: var(--page);
  color: var(--text); font: 15px/1.45 system-ui, sans-serif; }
h1 { margin: 0 0 .5rem; font-size: 1.6rem; }
h2 { margin: 2rem 0 .5rem; font-size: 1.2rem; }
p { max-width: 60rem; }
nav a { margin-right: 1rem; }
a { color: inherit; }
.summary { font-size: 1.05rem; font-weight: 600; }
.soft, small { color: var(--soft); }
.scroll { overflow-x: auto; }
table { width: 100%; min-width: 76rem; border-collapse: collapse;
  font-variant-numeric: tabular-nums; }
th, td { padding: .4rem .55rem; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; }
th { background: var(--head); white-space: nowrap; }
td.case { width: 26%; }
td.figure, td.naive { width: 16%; }
td.number, td.verdict { white-space: nowrap; }
td small { display: block; }
.good { color: var(--good); font-weight: 600; }
.bad { color: var(--bad); font-weight: 600; }
tr.red td { background: var(--bad-page); }
summary { cursor: pointer; color: var(--soft); }
details ul { margin: .3rem 0; padding-left: 1.1rem; overflow-wrap: anywhere; }
"""

HEAD = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width">
<link rel="icon" href="data:,">
<title>Sheaf: hard cases</title>
<style>{style}</style>
</head>
<body>
<h1>Hard cases</h1>
<p class="summary">{summary}</p>
<p>Each of the {count} cases of docs/hard-cases.md breaks a common way to compute it. The error bar
is five standard errors of a statistical figure, and the tolerance of a computed one; the deviation
is in standard errors (z) or in units of the last place of a float (ulp). The naive value is
computed for the same input by the formula that is named below it.</p>
<nav>{links}</nav>
"""

COLUMNS = ("case", "figure", "expected", "measured", "error bar", "deviation", "naive",
           "verdict", "time")


def text(value):
    return html.escape(str(value))


def prose(words):
    """Text with powers as superscripts, from 10^-6 and 1e-6."""
    powers = re.sub(r"\b1e(?=-?\d)", "10^", text(words))
    return re.sub(r"\^(-?)(\d+)", lambda m: f"<sup>{'−' * len(m[1])}{m[2]}</sup>", powers)


def number(value, digits=9):
    """Significant digits, with powers of ten as superscripts."""
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    shown = mantissa.replace("-", "−")
    return f"{shown}·10<sup>{int(exponent)}</sup>".replace("-", "−") if exponent else shown


def deviation(figure):
    if figure["z"] is not None:
        return f"z = {number(figure['z'], 2)}"
    if figure["ulps"] is not None:
        return f"{number(figure['ulps'], 2)} ulp"
    return f"{number(abs(figure['measured'] - figure['expected']), 2)}"


def naive_cell(figure, case):
    if "naive" not in figure:
        return f"<small>none: {text(case['no_naive'] or 'see the other figures')}</small>"
    kind = "within the bar" if figure["naive_holds"] else "beyond the bar"
    return (f"{number(figure['naive'], 7)} <small>{prose(figure['naive_by'])}</small>"
            f"<small>{kind}</small>")


def figure_cells(figure, case):
    verdict = ('<span class="good">holds</span>' if figure["holds"] else
               '<span class="bad">beyond its bar</span>')
    return (f'<td class="figure">{prose(figure["figure"])}</td>'
            f'<td class="number">{number(figure["expected"])}</td>'
            f'<td class="number">{number(figure["measured"])}</td>'
            f'<td class="number">{number(figure["bar"], 2)}</td>'
            f'<td class="number">{deviation(figure)}</td>'
            f'<td class="naive">{naive_cell(figure, case)}</td><td class="verdict">{verdict}</td>')


def tests_list(case):
    items = "".join(f"<li>{text(test['test'])}: {test['result']}"
                    f"{', %.2f s' % test['seconds'] if test['seconds'] else ''}</li>"
                    for test in case["tests"])
    count = len(case["tests"])
    return f"<details><summary>{count} test{'s' * (count != 1)}</summary><ul>{items}</ul></details>"


def case_cell(case, span):
    return (f'<td class="case" rowspan="{span}" id="{text(case["name"])}">'
            f'<strong>{text(case["name"])}</strong> {prose(case["case"])}'
            f'<small>Why: {prose(case["why"])}.</small>'
            f'<small>Expected: {prose(case["expected"])}.</small>'
            f'<small>Source: {prose(case["source"])}.</small>{tests_list(case)}</td>')


def case_rows(case):
    is_red = case["verdict"] == "red"
    problems = "".join(f'<div class="bad">{text(problem)}</div>' for problem in case["problems"])
    cells = [figure_cells(figure, case) for figure in case["figures"]]
    if is_red or not cells:
        cells.append(f'<td colspan="7">{problems or "no figure"}</td>')
    rows = []
    for i, inner in enumerate(cells):
        first = case_cell(case, len(cells)) if i == 0 else ""
        last = (f'<td class="number" rowspan="{len(cells)}">{case["seconds"]:.2f} s</td>'
                if i == 0 else "")
        rows.append(f'<tr class="{case["verdict"]}">{first}{inner}{last}</tr>')
    return "\n".join(rows)


def section_table(cases):
    head = "".join(f"<th>{column}</th>" for column in COLUMNS)
    body = "\n".join(case_rows(case) for case in cases)
    return (f'<div class="scroll"><table><thead><tr>{head}</tr></thead>\n'
            f"<tbody>\n{body}\n</tbody></table></div>")


def render(result, summary):
    """The page of the results of hard_cases.py."""
    sections = {}
    for case in result["cases"]:
        sections.setdefault(case["section"], []).append(case)
    links = "".join(f'<a href="#s{i}">{text(title)}</a>' for i, title in enumerate(sections))
    parts = [HEAD.format(style=STYLE, summary=text(summary), count=len(result["cases"]),
                         links=links)]
    for i, (title, cases) in enumerate(sections.items()):
        green = sum(case["verdict"] == "green" for case in cases)
        parts.append(f'<h2 id="s{i}">{text(title)} <span class="soft">{green} of {len(cases)} '
                     f"hold</span></h2>\n{section_table(cases)}")
    return "\n".join(parts) + "\n</body>\n</html>\n"
