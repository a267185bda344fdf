// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds the converter of USD: one script for Node.js, which is part of the program `sheaf`.

import {readFileSync} from 'node:fs';
import {defineConfig} from 'vite';

// The licenses of the packages that become part of the script.
const notice = '/*! Copyright the Sheaf authors. SPDX-License-Identifier: Apache-2.0\n' +
    ['fflate', 'jpeg-js']
        .map(
            name => '\n' + name + ':\n\n' +
                readFileSync('node_modules/' + name + '/LICENSE', 'utf8').replaceAll('*/', ''))
        .join('') +
    '*/';

export default defineConfig({
  publicDir: false,
  build: {
    outDir: 'dist_usd',
    target: 'node18',
    modulePreload: false,
    ssr: true,
    minify: true,
    rollupOptions: {
      input: 'src/usd/main.ts',
      output: {format: 'cjs', entryFileNames: 'usd.cjs', banner: notice},
    },
  },
  // All packages are part of the script.
  ssr: {noExternal: true},
});
