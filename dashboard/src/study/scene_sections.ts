// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The sections about the scene itself: what its effects cost and give, which light makes the noise,
// and where error bars cannot be trusted.

import type {Column, Row} from './bars';
import {barChart} from './bars';
import * as numbers from './numbers';
import {isKnown} from './numbers';
import {linearBetween, linearScale, logScale} from './scale';
import type {Study} from './schema';
import {section} from './section';
import {seriesAt} from './svg';
import {numbersTable} from './table';
import {kindNames, placeOf, tileMap} from './tile_map';

// From this share of a kind's variance in one replicate on its error bars are unreliable.
const RARE_SHARE_MAX = 0.5;

export function effectsSection(study: Study): HTMLElement {
  const {effects} = study;
  const columns: Column[] = [
    {
      heading: 'Share of the time',
      scale: linearScale(effects.map((effect) => effect.time_share), numbers.roundShare),
      origin: 0,
      marks: [0],
    },
    {
      heading: 'Variance, with over without',
      scale: logScale([1, ...effects.map((effect) => effect.variance_ratio)]),
      origin: 1,
      marks: [1],
    },
    {
      heading: 'relMSE of the picture without',
      scale: logScale(effects.map((effect) => effect.rel_mse), numbers.powerTick),
      origin: null,
      marks: [],
    },
  ];
  const rows = effects.map(
      (effect): Row => ({
        name: effect.name,
        note: effect.problem ? 'not measured: ' + effect.problem : 'against ' + effect.without,
        series: null,
        cells: effect.problem ?
            [] :
            [
              {value: effect.time_share, words: numbers.share(effect.time_share)},
              {value: effect.variance_ratio, words: numbers.times(effect.variance_ratio)},
              {value: effect.rel_mse, words: numbers.plain(effect.rel_mse)},
            ],
      }));
  return section(
      'effects', 'What each effect costs and gives',
      [
        'The scene with each effect against the scene without it: the share of the time that it ' +
            'takes, how it changes the variance of a sample (right of 1 is noisier with it), and ' +
            'how far the picture without it is from the one with it.',
        'An effect with a large share of the time and a tiny error without it may be left out.'
      ],
      barChart(
          'chart-effects', 'Cost of each effect, and what the picture is without it', columns, rows,
          'No effect of the scene was measured.'),
      numbersTable(
          'effects',
          [
            'Effect', 'Left out as', 'Time share', 'Time with over without',
            'Variance with over without', 'Mean without', 'relMSE without', 'Problem'
          ],
          effects.map(
              (effect) =>
                  [effect.name, effect.without, numbers.share(effect.time_share),
                   numbers.measured(effect.time_ratio, effect.time_ratio_error),
                   numbers.plain(effect.variance_ratio),
                   numbers.measuredShare(effect.mean_change, effect.mean_change_error),
                   numbers.plain(effect.rel_mse), effect.problem ?? '']),
          2));
}

export function pathsSection(study: Study): HTMLElement {
  const {paths} = study;
  const names = kindNames(study);
  const top = paths.flatMap((path) => [path.light_share, path.noise_share]).filter(isKnown);
  const scale = linearBetween(0, Math.max(0.1, ...top), numbers.roundShare);
  const columns: Column[] = [
    {heading: 'Share of the light', scale, origin: 0, marks: [0]},
    {heading: 'Share of the noise', scale, origin: 0, marks: [0]},
    {
      heading: 'Variance from one replicate',
      scale: linearBetween(0, 1, numbers.roundShare),
      origin: 0,
      marks: [RARE_SHARE_MAX],
    },
  ];
  const rows =
      paths.map((path): Row => ({
                  name: path.name,
                  note: path.meaning,
                  series: seriesAt(names.indexOf(path.name)),
                  cells: [
                    {value: path.light_share, words: numbers.share(path.light_share)},
                    {value: path.noise_share, words: numbers.share(path.noise_share)},
                    {
                      value: path.rare_share,
                      words: numbers.share(path.rare_share),
                      isAlarming: isKnown(path.rare_share) && path.rare_share > RARE_SHARE_MAX,
                    },
                  ],
                }));
  return section(
      'paths', 'Which light makes the noise',
      [
        'Light that makes more of the noise than of the picture is what samples are spent on.',
        'Where one of the replicates makes more than half of a kind’s variance, the kind is met ' +
            'too rarely for its error bars to be trusted: such a share is marked.'
      ],
      barChart(
          'chart-paths', 'Share of the light and of the noise of each kind of light path', columns,
          rows, 'Light and noise were not told apart by kinds of light paths.'),
      numbersTable(
          'kinds of light paths',
          [
            'Kind', 'Meaning', 'Share of the light', 'Share of the noise',
            'Variance from one replicate'
          ],
          paths.map(
              (path) =>
                  [path.name, path.meaning, numbers.share(path.light_share),
                   numbers.share(path.noise_share), numbers.share(path.rare_share)]),
          2));
}

export function tilesSection(study: Study): HTMLElement {
  return section(
      'tiles', 'Where error bars are unreliable',
      ['Tiles of those that were rendered whose errors are not reliable, as too few of their ' +
       'samples make the noise. The colour is the kind of light path with the largest share of ' +
       'the tile’s variance; the stronger, the larger the share.'],
      tileMap(study),
      numbersTable(
          'unreliable tiles', ['Tile', 'Kind of path', 'Share of the variance'],
          study.unreliable_tiles.map(
              (tile) => [placeOf(tile), tile.path, numbers.share(tile.share)]),
          2));
}
