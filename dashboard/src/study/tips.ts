// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The note beside the item at the pointer or selected by the arrow keys, in a focused chart.

import {el} from '../dom';

export interface Tip {
  // Relative to the plot, in CSS pixels.
  x: number;
  y: number;
  // The first line is a heading.
  lines: string[];
}

// A pointer farther away than this selects nothing.
const REACH_REM = 2.5;
const GAP_PX = 12;

export class Tips {
  private tips: Tip[] = [];
  private index = -1;
  private readonly ring = el('div', {class: 'tip-ring', hidden: ''});
  private readonly note = el('div', {class: 'tip', role: 'status', hidden: ''});

  // `plot` takes the focus; positions are relative to it.
  constructor(private readonly plot: HTMLElement) {
    plot.tabIndex = 0;
    plot.classList.add('tip-plot');
    plot.append(this.ring, this.note);
    plot.addEventListener('pointermove', (event) => this.point(event));
    plot.addEventListener('pointerdown', (event) => this.point(event));
    plot.addEventListener('pointerleave', () => this.show(-1));
    plot.addEventListener('blur', () => this.show(-1));
    plot.addEventListener('keydown', (event) => this.press(event));
  }

  // `tips` is in the order of the arrow keys. Hides the current note.
  set(tips: Tip[]) {
    this.tips = tips;
    this.show(-1);
  }

  private point(event: PointerEvent) {
    const box = this.plot.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    let nearest = -1;
    let distance = REACH_REM * parseFloat(getComputedStyle(document.documentElement).fontSize);
    this.tips.forEach((tip, i) => {
      const away = Math.hypot(tip.x - x, tip.y - y);
      if (away < distance) [nearest, distance] = [i, away];
    });
    this.show(nearest);
  }

  private press(event: KeyboardEvent) {
    const last = this.tips.length - 1;
    const places: Record<string, number> = {
      ArrowRight: Math.min(last, this.index + 1),
      ArrowDown: Math.min(last, this.index + 1),
      ArrowLeft: Math.max(0, this.index - 1),
      ArrowUp: Math.max(0, this.index - 1),
      Home: 0,
      End: last,
      Escape: -1,
    };
    const place = places[event.key];
    if (place === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    this.show(place);
  }

  private show(index: number) {
    this.index = index;
    const tip = this.tips[index];
    this.ring.hidden = this.note.hidden = !tip;
    if (!tip) return;
    const [heading, ...lines] = tip.lines;
    this.note.replaceChildren(
        el('strong', {}, heading ?? ''), ...lines.map((line) => el('span', {}, line)));
    this.ring.style.translate = tip.x + 'px ' + tip.y + 'px';
    const {offsetWidth: width, offsetHeight: height} = this.note;
    const room = this.plot.clientWidth - width;
    const right = tip.x + GAP_PX;
    const x = right <= room ? right : Math.max(0, tip.x - GAP_PX - width);
    const above = tip.y - GAP_PX - height;
    this.note.style.translate =
        Math.min(x, Math.max(0, room)) + 'px ' + (above >= 0 ? above : tip.y + GAP_PX) + 'px';
  }
}
