// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Builds the page of `sheaf study`: one HTML file that loads nothing. The build puts script and
// style into study.html; the program replaces the remaining mark by the study's JSON.

import {readFileSync} from 'node:fs';
import {defineConfig} from 'vite';
import type {Plugin} from 'vite';

// Replaces a mark by a text. A function prevents replace() from interpreting patterns in the text.
const put = (page: string, mark: string, text: string) => page.replace(mark, () => text);

function onePage(): Plugin {
  return {
    name: 'sheaf-one-page',
    // Runs after Vite's own plugins, which make the style sheet.
    enforce: 'post',
    generateBundle(_, bundle) {
      let page = readFileSync('study.html', 'utf8');
      for (const [name, file] of Object.entries(bundle)) {
        const [mark, text] =
            file.type === 'chunk' ? ['@script@', file.code] : ['@style@', String(file.source)];
        // An end tag within the text would end the element early.
        if (/<\/(script|style)|<!--/i.test(text)) throw new Error(name + ' ends its own element');
        page = put(page, mark, text);
        delete bundle[name];
      }
      this.emitFile({type: 'asset', fileName: 'study.html', source: page});
    },
  };
}

export default defineConfig({
  plugins: [onePage()],
  build: {
    outDir: 'dist_study',
    target: 'es2022',
    modulePreload: false,
    cssCodeSplit: false,
    rollupOptions: {input: 'src/study/study.ts', output: {format: 'iife'}},
  },
});
