// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Which jobs a filter's words and state select.

import type {Job} from './api';

// Prefixes of words in the filter that look at one field.
const FIELDS: Record<string, (job: Job) => string> = {
  'user:': (job) => job.owner,
  'show:': (job) => job.show,
  'state:': (job) => job.state,
};

// The text that words are looked for in; each version of a job is an object of its own.
const texts = new WeakMap<Job, string>();

function textOf(job: Job): string {
  let text = texts.get(job);
  if (text === undefined) {
    text = [job.title, job.state, job.name, job.owner, job.show].join(' ').toLowerCase();
    texts.set(job, text);
  }
  return text;
}

// The jobs of a state ('' for all) that match all words.
export function filterJobs(jobs: readonly Job[], state: string, filter: string): readonly Job[] {
  const words = filter.toLowerCase().split(/\s+/).filter((word) => word !== '');
  if (words.length === 0 && state === '') return jobs;
  return jobs.filter((job) => matches(job, state, words));
}

function matches(job: Job, state: string, words: readonly string[]): boolean {
  if (state && job.state !== state) return false;
  return words.every((word) => {
    const field = Object.keys(FIELDS).find((prefix) => word.startsWith(prefix));
    if (!field) return textOf(job).includes(word);
    return FIELDS[field]?.(job).toLowerCase().includes(word.slice(field.length)) ?? false;
  });
}
