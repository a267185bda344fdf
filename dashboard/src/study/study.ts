// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The page of `sheaf study`: a single file that loads nothing, built from the JSON it contains.

import './study.css';

import {byId, el, setText} from '../dom';
import {startTheme} from '../theme';

import {biasSection, entriesList, errorSection, gainSection, rateSection} from './entry_sections';
import {imageOf} from './light_words';
import * as numbers from './numbers';
import {isKnown} from './numbers';
import {pricesSection} from './prices';
import {effectsSection, pathsSection, tilesSection} from './scene_sections';
import type {Study} from './schema';
import {readStudy} from './schema';
import {section} from './section';

function fact(name: string, words: string): HTMLElement {
  return el('div', {}, el('dt', {}, name), el('dd', {}, words));
}

function summary(study: Study): HTMLElement {
  const sentences = study.recommendation.map((text) => el('li', {}, text));
  const found = sentences.length ?
      el('ul', {id: 'recommendation', class: 'recommendation'}, ...sentences) :
      el('p', {id: 'recommendation', class: 'empty'}, 'The numbers allow no recommendation.');
  return section('summary', 'Recommendations', [], found);
}

function lightFacts({light}: Study): HTMLElement[] {
  if (!light) return [];
  return [
    fact('Light paths', 'measured on ' + imageOf(light)),
    fact('Light passes of the reference', numbers.count(light.reference_passes)),
    fact('Time of a light pass', numbers.time(light.cpu_seconds_per_pass)),
  ];
}

function trainingFacts({training_cpu_seconds: training}: Study): HTMLElement[] {
  if (!isKnown(training) || !(training > 0)) return [];
  return [fact('Time of the training', numbers.time(training))];
}

function facts(study: Study): HTMLElement {
  const {width_px: width, height_px: height, pixels, reference} = study;
  const all = width * height;
  const share = isKnown(pixels) && all > 0 ? ', ' + numbers.share(pixels / all) + ' of all' : '';
  const list =
      el('dl', {class: 'facts'}, fact('Scene', study.scene),
         fact('Image', width + ' × ' + height + ' pixels'),
         fact('Pixels studied', numbers.count(pixels) + share),
         fact('Duration of the study', numbers.time(study.seconds)),
         fact('Threads', numbers.count(study.threads)),
         fact(
             'Reference',
             reference ? numbers.count(reference.samples) + ' samples per pixel' : 'none'),
         fact('Error of the reference', numbers.typicalError(reference?.relative_mse)),
         fact('Time of the reference', numbers.time(reference?.cpu_seconds)),
         ...lightFacts(study), ...trainingFacts(study));
  return section(
      'facts', 'Scope of the study',
      ['Every error is measured against a reference that the study rendered, and the error of ' +
       'the reference is subtracted.'],
      list,
      study.entries.length ? entriesList(study) :
                             el('p', {class: 'empty'}, 'No settings were compared.'));
}

function notStudied(study: Study): HTMLElement {
  const items = study.not_studied.map((text) => el('li', {}, text));
  return section(
      'not-studied', 'Not studied', [],
      items.length ? el('ul', {class: 'plain-list'}, ...items) :
                     el('p', {class: 'empty'}, 'The study lists nothing that it omitted.'));
}

function start() {
  const study = readStudy(byId('study').textContent ?? '');
  document.title = 'Study of ' + study.scene;
  setText(byId('title'), 'Study of ' + study.scene);
  byId('sections')
      .append(
          pricesSection(study), summary(study), errorSection(study), gainSection(study),
          biasSection(study), rateSection(study), effectsSection(study), pathsSection(study),
          tilesSection(study), facts(study), notStudied(study));
}

try {
  start();
} catch (error) {
  byId('sections').append(el('p', {class: 'empty', role: 'alert'}, String(error)));
  throw error;
} finally {
  // Called last: browsers without storage for local files may throw here.
  startTheme();
}
