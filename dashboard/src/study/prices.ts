// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The first section: what each of four prices buys, as crops of the image with their errors and
// times on this machine and on the farm, and what a given number of minutes buys.

import {el} from '../dom';

import * as numbers from './numbers';
import {isKnown} from './numbers';
import type {Crop, CropImage, Price, Study} from './schema';
import {section} from './section';

const ID = 'prices';
const EMPTY = 'No crops were rendered.';
const MINUTES = 10;
const MINUTES_MAX = 100_000;

const KINDS: Record<string, string> = {
  'largest error': 'Region of the largest error',
  'representative': 'Representative region',
};

// Threads that render, and their name.
interface Renderer {
  name: string;
  threads: number;
}

const many = (n: number, what: string) => numbers.count(n) + ' ' + what + (n === 1 ? '' : 's');

// 1, half and all of the workers.
export const workerCounts =
    (all: number) => [...new Set([1, Math.round(all / 2), all])].filter((n) => n >= 1 && n <= all);

function renderersOf({threads, farm}: Study): Renderer[] {
  const renderers: Renderer[] = [];
  if (isKnown(threads) && threads > 0)
    renderers.push({name: 'This machine, ' + many(threads, 'thread'), threads});
  if (!farm || !(farm.thread_count > 0)) return renderers;
  for (const workers of workerCounts(farm.worker_count)) {
    const share = Math.round(farm.thread_count * workers / farm.worker_count);
    renderers.push(
        {name: `Farm, ${many(workers, 'worker')} (${many(share, 'thread')})`, threads: share});
  }
  return renderers;
}

// relMSE of the base for this many samples per pixel: on the line between measured points, and
// beyond them along the rate. Null if nothing was measured.
export function errorAt(study: Study, samples: number): number|null {
  const base = study.entries.find((entry) => entry.is_base);
  const points = (base?.points ?? []).flatMap(({samples: n, relative_mse: error}) => {
    return isKnown(error) && error > 0 && n > 0 ? [{n, error}] : [];
  });
  const right = points.findIndex(({n}) => n >= samples);
  const b = points[right < 0 ? points.length - 1 : right];
  if (!b) return null;
  const a = points[right - 1];
  const rate = a ? Math.log(a.error / b.error) / Math.log(b.n / a.n) : base?.rate ?? 1;
  return b.error * (samples / b.n) ** -rate;
}

// Studies of frames with light paths may have fewer than four.
function pricesText(count: number): string {
  const number = ['one', 'two', 'three', 'four'][count - 1] ?? 'four';
  return number + (count === 1 ? ' price' : ' prices');
}

export function pricesSection(study: Study): HTMLElement {
  const {farm} = study;
  const words = [
    'Crops of the image as given, at ' + pricesText(study.prices.length) +
        '. An error is the typical error of a pixel, ' +
        'relative to its brightness, as everywhere in Sheaf: the root of relMSE, which ' +
        '--target-error takes (±10 % is a relMSE of 0.01). Nothing is denoised.',
  ];
  if (farm && farm.thread_count > 0) {
    const others = farm.other_job_count;
    words.push(
        'Times on the farm at ' + farm.address +
        ' assume threads as fast as those of this machine' +
        (others > 0 ? ' and leave out its ' + many(others, 'other job') : '') +
        '. sheaf quote measures on the farm itself.');
  } else if (farm) {
    words.push('No worker is connected to ' + farm.address + ', so it has no times.');
  }
  if (study.light)
    words.push(
        'Crops show light paths of the image itself: as many passes as samples, at most ' +
        numbers.count(study.light.reference_passes) + '.');
  const cards = study.prices.map((price, i) => cardOf(study, price, i));
  const list = cards.length ?
      el('ol', {id: ID + '-cards', class: 'prices', 'data-count': String(cards.length)}, ...cards) :
      el('p', {id: ID + '-cards', class: 'empty', 'data-count': '0'}, EMPTY);
  return section(ID, 'What you get, and what it costs', words, list, calculator(study));
}

function cardOf(study: Study, price: Price, index: number): HTMLElement {
  const {samples, cpu_seconds: seconds} = price;
  const facts =
      el('dl', {class: 'price-facts'}, el('dt', {}, 'Samples per pixel'),
         el('dd', {}, numbers.samples(samples)));
  for (const {name, threads} of renderersOf(study)) {
    facts.append(el('dt', {}, name), el('dd', {}, numbers.time(wallOf(study, seconds, threads))));
  }
  facts.append(el('dt', {}, 'Processor time'), el('dd', {}, numbers.time(seconds)));
  const figures = study.crops.flatMap((crop) => {
    const image = crop.images[index];
    return image ? [figureOf(crop, image, samples)] : [];
  });
  const heading =
      isKnown(price.relative_mse) ? numbers.typicalError(price.relative_mse) : 'error not known';
  return el('li', {class: 'price'}, el('h3', {class: 'price-error'}, heading), facts, ...figures);
}

const wallOf = ({thread_use: use}: Study, seconds: number|null, threads: number) =>
    isKnown(seconds) && use > 0 ? seconds / (threads * use) : null;

function figureOf(crop: Crop, image: CropImage, samples: number): HTMLElement {
  const name = KINDS[crop.kind] ?? crop.kind;
  const picture = el('img', {
    src: 'data:image/png;base64,' + image.png_base64,
    width: String(crop.x1 - crop.x0),
    height: String(crop.y1 - crop.y0),
    alt: name + ' at ' + many(samples, 'sample') + ' per pixel',
    title: `pixels ${crop.x0}, ${crop.y0} to ${crop.x1}, ${crop.y1}`,
  });
  const words = name + ': ' + numbers.typicalError(image.relative_mse) + ' within it';
  return el('figure', {class: 'crop'}, picture, el('figcaption', {}, words));
}

// A field for minutes, and what they buy on each renderer.
function calculator(study: Study): HTMLElement|null {
  const perSample = study.cpu_seconds_per_sample;
  const renderers = renderersOf(study);
  if (!isKnown(perSample) || !(perSample > 0) || !renderers.length) return null;
  const field = el('input', {
                  id: 'minutes',
                  type: 'number',
                  min: '0',
                  max: String(MINUTES_MAX),
                  step: 'any',
                  value: String(MINUTES),
                }) as HTMLInputElement;
  const list = el('ul', {id: 'minutes-buy', class: 'plain-list', 'aria-live': 'polite'});
  const update = () => {
    const minutes = Math.min(MINUTES_MAX, Number(field.value));
    const items = renderers.map(({name, threads}) => {
      const training = study.training_cpu_seconds ?? 0;
      const samples = (60 * minutes * threads * study.thread_use - training) / perSample;
      return el('li', {}, name + ': ' + wordsOf(study, samples));
    });
    list.replaceChildren(...items);
  };
  field.addEventListener('input', update);
  update();
  const label = el('label', {for: 'minutes'
  }, 'What do I get in');
  return el('div', {class: 'buys'}, el('p', {class: 'buys-field'}, label, field, 'minutes?'), list);
}

function wordsOf(study: Study, samples: number): string {
  if (!(samples >= 1)) return 'less than one sample per pixel';
  const error = errorAt(study, samples);
  const words = numbers.count(Math.floor(samples)) + ' samples per pixel';
  if (error === null) return words;
  const measured = study.entries.find(({is_base}) => is_base)?.points.at(-1)?.samples ?? 0;
  return numbers.typicalError(error) + ' with ' + words +
      (samples > measured ? ' (extrapolated)' : '');
}
