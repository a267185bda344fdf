// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds SVG elements. Colors come from the style sheet, so a change of theme needs no redrawing.

// Obtained from the parser: the page must not contain any address, not even the name of a
// namespace.
const namespace = (() => {
  const probe = document.createElement('div');
  probe.innerHTML = '<svg></svg>';
  return probe.firstElementChild?.namespaceURI ?? null;
})();

type Attributes = Record<string, string|number|null>;

// svg("circle", {cx: 1, cy: 2, r: 3}). A null value omits the attribute; text becomes a text node.
export function svg(
    tag: string, attributes: Attributes = {}, ...children: (Node|string)[]): SVGElement {
  const element = document.createElementNS(namespace, tag) as SVGElement;
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null) continue;
    element.setAttribute(name, typeof value === 'number' ? round(value) : value);
  }
  element.append(...children);
  return element;
}

// Rounds to a hundredth of a pixel.
const round = (value: number) => String(Math.round(value * 100) / 100);

// Marks of the entries, so that they differ by more than color. Centered at (0, 0), with size `r`.
const SHAPES: ((r: number) => string)[] = [
  (r) => `M${- r},0A${r},${r} 0 1 1 ${r},0A${r},${r} 0 1 1 ${- r},0Z`,
  (r) => `M${- r},${- r}H${r}V${r}H${- r}Z`,
  (r) => `M0,${- 1.3 * r}L${1.3 * r},0L0,${1.3 * r}L${- 1.3 * r},0Z`,
  (r) => `M0,${- 1.2 * r}L${1.2 * r},${r}H${- 1.2 * r}Z`,
  (r) => `M0,${1.2 * r}L${1.2 * r},${- r}H${- 1.2 * r}Z`,
];
// Number of colors --series-0, --series-1, ... in the style sheet. Coprime to the number of shapes.
const COLOR_COUNT = 8;

export interface Series {
  // For example "var(--series-3)".
  color: string;
  shape: (r: number) => string;
}

// The color and shape of the entry or kind at `index` in all charts.
export function seriesAt(index: number): Series {
  const shape = SHAPES[index % SHAPES.length];
  if (!shape) throw new Error('no shape for series ' + index);
  return {color: 'var(--series-' + index % COLOR_COUNT + ')', shape};
}

// The mark before a name in the legend of curves: a piece of the curve with its mark.
export function curveSwatch({color, shape}: Series, isBiased: boolean): SVGElement {
  const line =
      svg('line', {class: isBiased ? 'curve biased' : 'curve', x1: -14, x2: 14, y1: 0, y2: 0});
  const mark = svg('path', {class: 'point', d: shape(5)});
  const box = svg(
      'svg', {class: 'swatch wide', viewBox: '-15 -8 30 16', 'aria-hidden': 'true'}, line, mark);
  box.style.setProperty('--series', color);
  return box;
}

// The mark before a name in a legend.
export function swatch({color, shape}: Series): SVGElement {
  const mark = svg('path', {d: shape(5)});
  mark.style.fill = color;
  return svg('svg', {class: 'swatch', viewBox: '-8 -8 16 16', 'aria-hidden': 'true'}, mark);
}
