// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The sections that compare entries: error against time, time to equal error, bias floors, and
// convergence rates.

import {el} from '../dom';

import type {Cell, Column, Row} from './bars';
import {barChart} from './bars';
import {errorTimeChart} from './error_time_chart';
import {wordsOfErrors} from './light_words';
import * as numbers from './numbers';
import {isKnown} from './numbers';
import {errorScale, linearBetween, logScale} from './scale';
import type {Entry, Study} from './schema';
import {section} from './section';
import {numbersTable} from './table';

// An undetected bias floor is limited to this many standard errors, in the text and in the drawing.
const LIMIT_ERRORS = 2;
// Range of the axis of rates; the rate of Monte Carlo is in its middle.
const RATE_LOW = 0.5;
const RATE_HIGH = 1.5;

const yes = (is: boolean) => is ? 'yes' : 'no';

const baseOf = (study: Study) => study.entries.find((entry) => entry.is_base);

const rowsOf = (study: Study, cellOf: (entry: Entry) => Cell): Row[] => study.entries.map(
    (entry) => ({
      name: entry.name + (entry.is_base ? ' (base)' : '') + (entry.is_unbiased ? '' : ' (biased)'),
      note: entry.how,
      series: null,
      cells: [cellOf(entry)],
    }));

export function errorSection(study: Study): HTMLElement {
  const rows = study.entries.flatMap(
      ({name, is_unbiased, points}) => points.map(
          (point) =>
              [name, yes(!is_unbiased), numbers.samples(point.samples),
               numbers.time(point.cpu_seconds), numbers.typicalError(point.relative_mse),
               numbers.plain(point.relative_mse), numbers.plain(point.relative_mse_error),
               yes(point.on_pareto_front)]));
  const floors = study.entries.filter(({bias_floor: floor}) => floor?.is_significant).length;
  return section(
      'error', 'Error against processor time',
      [
        'Each point is the image at a number of samples per pixel: lower and further left is ' +
            'better. Vertical bars are one standard error.',
        'The thick line is the efficient front: the least error for each time, among the curves ' +
            'shown that render the same image. The thin line is the Monte Carlo rate from the ' +
            'base: half the error for four times the time. ' +
            (floors ? 'Dotted lines are bias floors: no number of samples has a smaller error.' :
                      'No entry has a significant bias floor.'),
        ...wordsOfErrors(study),
      ],
      errorTimeChart(study),
      numbersTable(
          'errors and times',
          [
            'Entry', 'Biased', 'Samples', 'Processor time', 'Error of a pixel', 'relMSE',
            'Standard error of relMSE', 'On the front'
          ],
          rows, 2));
}

export function gainSection(study: Study): HTMLElement {
  const base = baseOf(study)?.name ?? 'the base';
  const values = study.entries.flatMap(
      ({gain}) => isKnown(gain?.value) ?
          [gain.value, gain.value + (gain.error ?? 0), gain.value - (gain.error ?? 0)] :
          []);
  const column: Column = {
    heading: 'Time of the base over time of the entry',
    scale: logScale([1, ...values]),
    origin: 1,
    marks: [1],
  };
  const rows = rowsOf(study, ({gain, is_base}) => ({
                               value: gain?.value,
                               error: gain?.error,
                               words: gain ? numbers.measured(gain.value, gain.error) :
                                   is_base ? '1' :
                                             'not known',
                             }));
  return section(
      'gain', 'Time to the same error',
      ['Processor time of “' + base + '” over that of each entry, to the error of the last point ' +
       'of the entry. Right of 1 is faster, left of it slower; whiskers are one standard error.'],
      barChart(
          'chart-gain', 'Time of the base over that of each entry, to the same error', [column],
          rows, 'No two entries were compared at the same error.'),
      numbersTable(
          'time to the same error',
          ['Entry', 'How', 'Gain', 'Standard error', 'Unbiased against the base'],
          study.entries.map(
              (entry) =>
                  [entry.name, entry.how, numbers.plain(entry.gain?.value),
                   numbers.plain(entry.gain?.error), yes(entry.is_unbiased)]),
          2));
}

// The highest floor compatible with the measurement; null if unknown.
function limitOf({bias_floor: floor}: Entry): number|null {
  if (!floor || !isKnown(floor.relative_mse)) return null;
  return Math.max(0, floor.relative_mse) + LIMIT_ERRORS * (floor.error ?? 0);
}

function bestErrorOf({points}: Entry): number|null {
  const errors = points.map((point) => point.relative_mse).filter(isKnown);
  return errors.length ? Math.min(...errors) : null;
}

function floorWords(entry: Entry): string {
  const floor = entry.bias_floor;
  const limit = limitOf(entry);
  if (!floor || limit === null) return 'not known';
  return floor.is_significant ? numbers.typicalError(floor.relative_mse) :
                                'none found, below ' + numbers.typicalError(limit);
}

export function biasSection(study: Study): HTMLElement {
  const floorValues = study.entries.flatMap((entry) => {
    const floor = entry.bias_floor;
    if (!floor?.is_significant) return [limitOf(entry)];
    return [floor.relative_mse, (floor.relative_mse ?? 0) + (floor.error ?? 0)];
  });
  const column: Column = {
    heading: 'Error of a pixel that remains at any number of samples',
    scale: errorScale([...floorValues, ...study.entries.map(bestErrorOf)]),
    origin: null,
    marks: [],
  };
  const rows = rowsOf(study, (entry) => {
    const isFound = entry.bias_floor?.is_significant === true;
    return {
      value: isFound ? entry.bias_floor?.relative_mse : limitOf(entry),
      error: entry.bias_floor?.error,
      isLimit: !isFound,
      other: entry.bias_floor ? bestErrorOf(entry) : null,
      words: floorWords(entry),
      isAlarming: isFound && entry.is_unbiased,
    };
  });
  return section(
      'bias', 'Bias floors',
      [
        'The mean squared error is the square of the bias plus the variance. More samples reduce ' +
            'the variance towards 0; the square of the bias remains and is the floor of the error.',
        'A dot is a floor with its standard error. Where no floor was found, a pale band extends ' +
            'to the highest floor that agrees with the measurement (' + LIMIT_ERRORS +
            ' standard errors). A ring is the lowest error measured for the entry.'
      ],
      barChart(
          'chart-bias', 'Bias floor of each entry', [column], rows,
          'No bias floor could be determined from these points.'),
      numbersTable(
          'bias floors',
          [
            'Entry', 'In words', 'relMSE of the floor', 'Standard error', 'Significant',
            'Lowest error measured', 'Unbiased against the base'
          ],
          study.entries.map(
              (entry) =>
                  [entry.name, floorWords(entry), numbers.plain(entry.bias_floor?.relative_mse),
                   numbers.plain(entry.bias_floor?.error),
                   yes(entry.bias_floor?.is_significant === true),
                   numbers.plain(bestErrorOf(entry)), yes(entry.is_unbiased)]),
          2));
}

export function rateSection(study: Study): HTMLElement {
  const ends = study.entries.flatMap(
      ({rate, rate_error: error}) =>
          isKnown(rate) ? [rate - (error ?? 0), rate + (error ?? 0)] : []);
  const column: Column = {
    heading: 'Exponent',
    scale: linearBetween(Math.min(RATE_LOW, ...ends), Math.max(RATE_HIGH, ...ends)),
    origin: null,
    marks: [1],
  };
  const rows = rowsOf(study, ({rate, rate_error: error}) => ({
                               value: rate,
                               error,
                               words: isKnown(rate) ? numbers.measured(rate, error) : 'not known',
                             }));
  return section(
      'rate', 'How fast the variance falls',
      ['The variance falls as 1 / samples to the power of this exponent. The line at 1 is Monte ' +
       'Carlo: half the variance for twice the samples. Well-distributed samples have a larger ' +
       'exponent where the image is smooth; rarely sampled light has a smaller one.'],
      barChart(
          'chart-rate', 'Exponent by which the variance of each entry falls', [column], rows,
          'Too few points to estimate how fast the variance falls.'),
      numbersTable(
          'rates', ['Entry', 'Exponent', 'Standard error'],
          study.entries.map(
              (entry) =>
                  [entry.name, numbers.plain(entry.rate), numbers.plain(entry.rate_error)])));
}

// Every entry, its difference from the base, and its command-line flag.
export function entriesList(study: Study): HTMLElement {
  const items = study.entries.map(({name, how, flag}) => {
    const item = el('li', {}, el('strong', {}, name), how ? ': ' + how : '');
    if (flag) item.append(', ', el('code', {}, flag));
    return item;
  });
  return el('ul', {class: 'plain-list'}, ...items);
}
