// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Checks manifests by the schemas of Kubernetes, KEDA and the Prometheus operator, offline:
//
//     node validate.mjs FILE ...      from a folder with the packages of `run` beside it
import {readFileSync} from 'fs';
import * as yaml from 'js-yaml';

const packages = {
  'keda.sh': '@kubernetes-models/keda',
  'monitoring.coreos.com': '@kubernetes-models/prometheus-operator',
};

let bad = 0;
for (const path of process.argv.slice(2)) {
  for (const manifest of yaml.loadAll(readFileSync(path, 'utf8'))) {
    const {apiVersion, kind, metadata} = manifest;
    const group = apiVersion.includes('/') ? apiVersion.split('/')[0] : '';
    const what = `${path}: ${apiVersion} ${kind} ${metadata?.name}`;
    try {
      const models = await import(`${packages[group] ?? 'kubernetes-models'}/${apiVersion}/${kind}`);
      new models[kind](manifest).validate();
      console.log('valid', what);
    } catch (error) {
      ++bad;
      console.log('INVALID', what, error.message);
    }
  }
}
process.exit(bad ? 1 : 0);
