// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The sections about the scene: costs and gains of its effects, the noise by kind of light, and
// tiles with unreliable error bars.

import type {Column, Row} from './bars';
import {barChart} from './bars';
import {wordsOfEffects, wordsOfPaths} from './light_words';
import * as numbers from './numbers';
import {isKnown} from './numbers';
import {errorScale, linearBetween, linearScale, logScale} from './scale';
import type {Effect, Study} from './schema';
import {section} from './section';
import {seriesAt} from './svg';
import {numbersTable} from './table';
import {kindNames, placeOf, tileMap} from './tile_map';

// If one replicate contributes at least this fraction of a kind's variance, its error bars are
// unreliable.
const RARE_SHARE_MAX = 0.5;

// A loss that noise hides may be measured below 0.
const lossOf = ({relative_mse: loss}: Effect) =>
    isKnown(loss) && loss <= 0 ? 'none seen' : numbers.typicalError(loss);

export function effectsSection(study: Study): HTMLElement {
  const {effects} = study;
  const columns: Column[] = [
    {
      heading: 'Fraction of the time',
      scale: linearScale(effects.map((effect) => effect.time_fraction), numbers.roundShare),
      origin: 0,
      marks: [0],
    },
    {
      heading: 'Variance with over without',
      scale: logScale([1, ...effects.map((effect) => effect.variance_ratio)]),
      origin: 1,
      marks: [1],
    },
    {
      heading: 'Error of the image without',
      scale: errorScale(effects.map((effect) => effect.relative_mse)),
      origin: null,
      marks: [],
    },
  ];
  const rows = effects.map(
      (effect): Row => ({
        name: effect.name,
        note: effect.problem ? 'not measured: ' + effect.problem :
                               'ablated scene: ' + effect.ablation,
        series: null,
        cells: effect.problem ?
            [] :
            [
              {value: effect.time_fraction, words: numbers.share(effect.time_fraction)},
              {value: effect.variance_ratio, words: numbers.times(effect.variance_ratio)},
              {value: effect.relative_mse, words: lossOf(effect)},
            ],
      }));
  return section(
      'effects', 'Cost and influence of each effect',
      [
        'The scene with each effect is compared with the scene without it: the fraction of the ' +
            'time that the effect takes, its influence on the variance of a sample (right of 1 ' +
            'is noisier with it), and the error of the image without it.',
        'An effect that takes a large fraction of the time may be removed if the error without ' +
            'it is tiny.',
        ...wordsOfEffects(study),
      ],
      barChart(
          'chart-effects', 'Cost of each effect, and error of the image without it', columns, rows,
          'No effect of the scene was measured.'),
      numbersTable(
          'effects',
          [
            'Effect', 'Ablated scene', 'Fraction of the time', 'Time with over without',
            'Variance with over without', 'Mean without', 'relMSE without', 'Problem'
          ],
          effects.map(
              (effect) =>
                  [effect.name, effect.ablation, numbers.share(effect.time_fraction),
                   numbers.measured(effect.time_ratio, effect.time_ratio_error),
                   numbers.plain(effect.variance_ratio),
                   numbers.measuredShare(effect.mean_change, effect.mean_change_error),
                   numbers.plain(effect.relative_mse), effect.problem ?? '']),
          2));
}

export function pathsSection(study: Study): HTMLElement {
  const {paths} = study;
  const names = kindNames(study);
  const top = paths.flatMap((path) => [path.light_fraction, path.noise_fraction]).filter(isKnown);
  const scale = linearBetween(0, Math.max(0.1, ...top), numbers.roundShare);
  const columns: Column[] = [
    {heading: 'Fraction of the light', scale, origin: 0, marks: [0]},
    {heading: 'Fraction of the noise', scale, origin: 0, marks: [0]},
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
                    {value: path.light_fraction, words: numbers.share(path.light_fraction)},
                    {value: path.noise_fraction, words: numbers.share(path.noise_fraction)},
                    {
                      value: path.largest_replicate_fraction,
                      words: numbers.share(path.largest_replicate_fraction),
                      isAlarming: isKnown(path.largest_replicate_fraction) &&
                          path.largest_replicate_fraction > RARE_SHARE_MAX,
                    },
                  ],
                }));
  return section(
      'paths', 'Sources of the noise',
      [
        'Most samples are spent on light that makes more of the noise than of the image.',
        'If one of the replicates makes more than half of a kind’s variance, the kind is sampled ' +
            'too rarely for reliable error bars; such a fraction is marked.',
        ...wordsOfPaths(study),
      ],
      barChart(
          'chart-paths', 'Fraction of the light and of the noise of each kind of path', columns,
          rows, 'Light and noise were not separated by kinds of paths.'),
      numbersTable(
          'kinds of paths',
          [
            'Kind', 'Meaning', 'Fraction of the light', 'Fraction of the noise',
            'Variance from one replicate'
          ],
          paths.map(
              (path) =>
                  [path.name, path.meaning, numbers.share(path.light_fraction),
                   numbers.share(path.noise_fraction),
                   numbers.share(path.largest_replicate_fraction)]),
          2));
}

export function tilesSection(study: Study): HTMLElement {
  const count = study.unreliable_tiles.length;
  const all = study.assessed_tile_count;
  const found = count && all ? count + ' of ' + all + ' tiles contain fireflies. ' : '';
  return section(
      'tiles', 'Where error bars are unreliable',
      [found +
       'In these tiles a few very bright samples make most of the noise, so error bars of their ' +
       'pixels may be too small; the errors above include them. More samples help. The color is ' +
       'the kind of path with the largest fraction of the tile’s variance; stronger colors are ' +
       'larger fractions.'],
      tileMap(study),
      numbersTable(
          'unreliable tiles', ['Tile', 'Kind of path', 'Fraction of the variance'],
          study.unreliable_tiles.map(
              (tile) => [placeOf(tile), tile.path, numbers.share(tile.fraction)]),
          2));
}
