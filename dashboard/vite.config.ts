// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds a few scripts and a style sheet under fixed names, which CMakeLists.txt in this folder
// lists. The coordinator sends them with digests, so the names need no hashes.

import {readFileSync} from 'node:fs';
import {defineConfig} from 'vite';
import type {Plugin} from 'vite';

const NOTICE = '/*! Copyright the Sheaf authors. SPDX-License-Identifier: Apache-2.0\n' +
    '    Contains packages of others, see licences.txt. */\n';

// Minification drops comments: restores the notice, with the license of the bundled library.
function notices(): Plugin {
  return {
    name: 'sheaf-notices',
    // Runs after Vite's own plugins, which make the style sheet.
    enforce: 'post',
    generateBundle(_, bundle) {
      for (const file of Object.values(bundle)) {
        if (file.type === 'chunk')
          file.code = NOTICE + file.code;
        else if (/\.(css|js)$/.test(file.fileName))
          file.source = NOTICE + file.source;
      }
      const licences = ['uplot', 'fflate', 'jpeg-js'].map(
          name => '\n\n' + name + ', https://www.npmjs.com/package/' + name + ':\n\n' +
              readFileSync('node_modules/' + name + '/LICENSE', 'utf8'));
      this.emitFile({
        type: 'asset',
        fileName: 'licences.txt',
        source: 'Sheaf: Copyright the Sheaf authors. SPDX-License-Identifier: Apache-2.0' +
            licences.join(''),
      });
    },
  };
}

export default defineConfig({
  base: './',
  plugins: [notices()],
  worker: {format: 'es', rollupOptions: {output: {entryFileNames: '[name].js'}}},
  build: {
    outDir: 'dist',
    target: 'es2022',
    // The server's content security policy forbids inlined images and scripts.
    assetsInlineLimit: 0,
    modulePreload: false,
    cssCodeSplit: false,
    rollupOptions: {
      output: {
        entryFileNames: 'app.js',
        chunkFileNames: '[name].js',
        assetFileNames: '[name][extname]',
      },
    },
  },
});
