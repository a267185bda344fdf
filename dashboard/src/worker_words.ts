// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Words and numbers of a worker, for all lists of workers.

import type {Worker} from './api';
import * as format from './format';
import type {Store} from './store';

// "rendering shot 7, frame 3 at 64, 32 and 1 more".
export function doingOf(store: Store, worker: Worker): string {
  const [lease] = worker.leases;
  if (!lease) return worker.state === 'idle' ? 'nothing to do' : '';
  const [, job = '', frame = ''] = /^(jobs\/[^/]+)\/frames\/(.*)$/.exec(lease.frame_name) ?? [];
  const title = lease.pilot ? 'a quote' : store.jobs.get(job)?.title || job;
  const more = worker.lease_count > 1 ? ' and ' + (worker.lease_count - 1) + ' more' : '';
  const where = lease.task === 'light' ? ', light paths' :
      lease.task === 'training'        ? ', training' :
                                         ' at ' + format.place(lease.tile);
  return lease.phase + ' ' + title + ', frame ' + frame + where + more;
}

// "node7" of the certificate's name "worker:node7"; without certificates it is the worker's id.
export const identityOf = (worker: Worker) => worker.identity.replace(/^worker:/, '');

// "node7 (worker-1) on render-1": each name once.
export function titleOf(worker: Worker): string {
  const name = format.shortName(worker.name);
  const identity = identityOf(worker);
  const known = identity && identity !== name ? identity + ' (' + name + ')' : name;
  const {host} = worker;
  // Ids that workers choose begin with the host.
  return host && host !== identity && !name.startsWith(host) ? known + ' on ' + host : known;
}

// "2 scenes, 1.23 GB".
export function cacheOf(worker: Worker): string {
  const count = worker.warm_scene_count;
  if (count === 0) return '';
  const memory =
      worker.scene_memory_bytes === null ? '' : ', ' + format.bytes(worker.scene_memory_bytes);
  return (count === 1 ? '1 scene' : count + ' scenes') + memory;
}
