// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A map of the image's tiles with unreliable error bars, and the kinds of light that cause them.

import {el} from '../dom';

import * as numbers from './numbers';
import type {Study, Tile} from './schema';
import {seriesAt, svg, swatch} from './svg';
import {Tips} from './tips';

// Opacity of a tile that is barely unreliable, and of a wholly unreliable one.
const OPACITY_MIN = 0.35;
const NONE_FOUND = 'None of the rendered tiles has unreliable errors.';
const NOT_LOOKED_FOR = 'Kinds of paths were not separated, so tiles were not assessed.';

// Names of the kinds in the order of their colors.
export function kindNames(study: Study): string[] {
  const names = [...study.paths, ...study.unreliable_tiles.map(({path}) => ({name: path}))];
  return [...new Set(names.map(({name}) => name))];
}

export function tileMap(study: Study): HTMLElement {
  const id = 'chart-tiles';
  const {width_px: width, height_px: height, unreliable_tiles: tiles} = study;
  if (!tiles.length) {
    const words = study.paths.length ? NONE_FOUND : NOT_LOOKED_FOR;
    return el('p', {id, class: 'empty', 'data-count': '0'}, words);
  }
  const names = kindNames(study);
  const map =
      svg('svg', {viewBox: [0, 0, width, height].join(' '), preserveAspectRatio: 'none'},
          ...tiles.map((tile) => rectOf(tile, names)));
  const plot =
      el('div', {
        class: 'tile-plot',
        role: 'group',
        'aria-label': 'Map of the image with ' + tiles.length +
            ' unreliable tiles; arrow keys move ' +
            'from one to the next',
      },
         map);
  plot.style.aspectRatio = width + ' / ' + height;
  plot.style.setProperty('--aspect', String(width / height));
  const tips = new Tips(plot);
  new ResizeObserver(
      () => tips.set(tiles.map(
          (tile) => ({
            x: (tile.x0 + tile.x1) / 2 / width * plot.clientWidth,
            y: (tile.y0 + tile.y1) / 2 / height * plot.clientHeight,
            lines: [tile.path, numbers.share(tile.fraction) + ' of the variance', placeOf(tile)],
          }))))
      .observe(plot);
  return el(
      'figure', {id, class: 'tiles', 'data-count': String(tiles.length)}, plot,
      legend(tiles, names));
}

export const placeOf = ({x0, y0, x1, y1}: Tile) => `pixels ${x0}, ${y0} to ${x1}, ${y1}`;

function rectOf(tile: Tile, names: string[]): SVGElement {
  const rect = svg('rect', {
    x: tile.x0,
    y: tile.y0,
    width: tile.x1 - tile.x0,
    height: tile.y1 - tile.y0,
    'fill-opacity': OPACITY_MIN + (1 - OPACITY_MIN) * (tile.fraction ?? 0),
  });
  rect.style.fill = seriesAt(names.indexOf(tile.path)).color;
  return rect;
}

function legend(tiles: Tile[], names: string[]): HTMLElement {
  const items = names.flatMap((name, i) => {
    const count = tiles.filter(({path}) => path === name).length;
    if (!count) return [];
    return [el(
        'li', {}, swatch(seriesAt(i)), name + ': ' + count + (count > 1 ? ' tiles' : ' tile'))];
  });
  return el('ul', {class: 'legend'}, ...items);
}
