// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The coordinator's HTTP API. Names go into paths segment by segment, escaped.

const BASE = '/api/v1/';

const pathOf = (name) => BASE + name.split('/').map(encodeURIComponent).join('/');

async function request(path, options = {}) {
  const response = await fetch(path, {cache: 'no-store', ...options});
  const body = await response.json();
  if (response.ok) return body;
  const error = new Error(body.error ? body.error.message : response.statusText);
  error.status = response.status;
  throw error;
}

const query = (pageSize, token) =>
    '?page_size=' + pageSize + (token ? '&page_token=' + encodeURIComponent(token) : '');

export const listJobs = (pageSize, token) => request(BASE + 'jobs' + query(pageSize, token));
export const getJob = (name, pageSize, token) => request(pathOf(name) + query(pageSize, token));
export const listWorkers = () => request(BASE + 'workers');
export const listCounters = () => request(BASE + 'counters');
// The header tells the coordinator that a page of its own asks, not one of another site.
export const cancelJob = (name) =>
    request(pathOf(name) + ':cancel', {method: 'POST', headers: {'X-Sheaf-Request': '1'}});

export const eventsPath = BASE + 'events';
export const previewPath = (frame) =>
    pathOf(frame.name) + '/preview.png?version=' + frame.preview_version;
export const outputPath = (frame) => pathOf(frame.name) + '/output.exr';
